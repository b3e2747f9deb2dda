"""An external FMU that judges: the keys of ``[check]`` that name it, and which of its variables are what."""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import attrs

from gen_profile.plants.plant import Plant
from gen_profile.spec.structure import MISFIT, Checked, Faults, Structurer, kinds_of
from gen_profile.spec.values import NONE, Bounds, LoadName, Named, ParameterName, Pattern, Words, example
from gen_profile.support.bounded_file import read_bounded
from gen_profile.support.private_folder import agree
from gen_profile.support.units import units_of

KEYS = ("fmu", "fmu_sha256", "input", "output", "parameters", "units", "time_limit", "step")
FED_RATES = {"acceleration": "/s^2", "velocity": "/s", "setpoint": ""}  # of an axis, behind its SI unit
INPUTS = tuple(FED_RATES)
TIME_LIMIT = 60.0  # s
FILE = Annotated[
    str,
    Pattern(r"(?is).+\.fmu", "the name of an FMU"),
    Words("must name an FMU, such as customer.fmu, found {found}"),
]
VariableName = Annotated[str, Named("variable")]


@attrs.frozen(kw_only=True)
class ExternalFmu(Checked, table="check"):
    """An external FMU that judges in place of ours.

    Attributes
    ----------
    name : str
        File name, without folders: it lies beside whatever it judged.
    path : Path
        Where the file lies now.
    sha256 : str
    input : str
        What its inputs are: ``"acceleration"``, ``"velocity"`` or ``"setpoint"`` of the axes.
    inputs : tuple of str
        Its variables, one per axis.
    sway : mapping of str to str
        Its variables by load, of those loads that it has.
    parameters : mapping of str to str
        Its variables by the plant's parameters.
    units : mapping of str to str
        What its variables are in, where that differs from what the FMU declares, if it does.
    time_limit : float
        s, for all scenarios together.
    step : float or None
        s, the only communication step that it takes; None where it takes any.
    """

    name: str
    path: Path = attrs.field(eq=False)
    sha256: str
    input: str
    inputs: tuple[str, ...]
    sway: Mapping[LoadName, str]
    parameters: Annotated[Mapping[ParameterName, str], example('L1 = "rope"')]
    units: Annotated[Mapping[VariableName, str], example('rope = "mm"')] = NONE
    time_limit: Annotated[float, Bounds(above=0.0), Words("must be a positive time in s, found {found}")]
    step: Annotated[float, Bounds(least=1e-6, most=1.0, meaning="s (4 ms are 0.004)")] | None = None

    def si_units(self, plant: Plant) -> dict[str, str]:
        """Name the SI unit of each of its variables."""
        per = FED_RATES[self.input]
        fed = {name: f"{axis.unit}{per}" for name, axis in zip(self.inputs, plant.actuated, strict=False)}
        set_to = {variable: plant.units[name] for name, variable in self.parameters.items()}
        return {**fed, **dict.fromkeys(self.sway.values(), "m"), **set_to}

    def to_dict(self) -> dict[str, Any]:
        """Write the keys of ``[check]``."""
        return {
            "fmu": self.name,
            "fmu_sha256": self.sha256,
            "input": {self.input: list(self.inputs)},
            "output": {"sway": dict(self.sway)},
            "parameters": dict(self.parameters),
            **({"units": dict(self.units)} if self.units else {}),
            "time_limit": self.time_limit,
            **({"step": self.step} if self.step is not None else {}),
        }


def external_fmu(
    check: dict[str, Any], plant: Plant | None, folder: Path, structurer: Structurer
) -> ExternalFmu | None:
    """Take the keys of an external FMU out of the table ``[check]``.

    Parameters
    ----------
    check : dict
        Loses these keys.
    plant : Plant or None
    folder : Path
        What the FMU's file name is relative to.
    structurer : Structurer
    """
    given = {key: check.pop(key) for key in KEYS if key in check}
    if not given or plant is None:
        return None
    name = structurer.fit(given.get("fmu"), FILE, "check.fmu")
    if name is MISFIT:
        return None
    input_, inputs = _inputs(given.get("input"), plant, structurer)
    kinds, limit = kinds_of(ExternalFmu), given.get("time_limit", TIME_LIMIT)
    foreign = ExternalFmu(
        name=Path(name).name,
        path=folder / name,
        sha256=_sha256(folder / name, given.get("fmu_sha256"), structurer.faults),
        input=input_,
        inputs=inputs,
        sway=_sway(given.get("output"), plant, structurer),
        parameters=structurer.fit(given.get("parameters", {}), kinds["parameters"], "check.parameters", {}),
        time_limit=structurer.fit(limit, kinds["time_limit"], "check.time_limit", TIME_LIMIT),
        step=structurer.fit(given.get("step"), kinds["step"], "check.step", None),
    )
    return attrs.evolve(foreign, units=_units(given.get("units", {}), foreign, plant, structurer))


def _units(table: Any, foreign: ExternalFmu, plant: Plant, structurer: Structurer) -> Mapping[str, str]:
    """Read the units of variables, each one that measures what the variable is meant to."""
    fitting = {name: (si, *units_of(si)) for name, si in foreign.si_units(plant).items()}
    choices = {name: Literal.__getitem__(tuple(dict.fromkeys(units))) for name, units in fitting.items()}
    of_variables = attrs.evolve(structurer, names={"variable": choices})
    units: Mapping[str, str] = of_variables.fit(table, kinds_of(ExternalFmu)["units"], "check.units", NONE)
    return units


def _sha256(path: Path, stated: Any, faults: Faults) -> str:
    try:
        actual = hashlib.sha256(read_bounded(path)).hexdigest()
    except (OSError, ValueError) as error:
        problem = getattr(error, "strerror", error)
        faults.add("check.fmu", "{path} cannot be read ({problem})", path=path, problem=problem)
        return ""
    if stated is not None and stated != actual:
        faults.add("check.fmu", "{path} is not the FMU that was checked with; its SHA-256 differs", path=path)
    else:
        agree(actual)
    return actual


def _inputs(table: Any, plant: Plant, structurer: Structurer) -> tuple[str, tuple[str, ...]]:
    """Read which quantity goes in, and the variable of each axis."""
    if not isinstance(table, Mapping) or len(table) != 1 or next(iter(table)) not in INPUTS:
        template = 'must name the inputs by one of {names}, such as {{ acceleration = "u" }}'
        structurer.faults.add("check.input", template, names=", ".join(INPUTS))
        return INPUTS[0], ()
    ((quantity, names),) = table.items()
    axes = len(plant.actuated)
    words = Words("must name one variable of the FMU per axis ({axes})", axes=axes)
    one_per_axis: Any = Annotated[tuple.__class_getitem__((str,) * axes), words]
    listed = [names] if isinstance(names, str) else names
    return quantity, structurer.fit(listed, one_per_axis, f"check.input.{quantity}", ())


def _sway(table: Any, plant: Plant, structurer: Structurer) -> Mapping[str, str]:
    """Read the variable of each load's sway; a single one is the end load's."""
    names = table.get("sway") if isinstance(table, Mapping) and set(table) == {"sway"} else None
    if isinstance(names, str):
        return {plant.loads[-1]: names}
    if not isinstance(names, Mapping) or not names or not all(isinstance(one, str) for one in names.values()):
        problem = 'must name the sway of the end load or of loads by name, such as { sway = "load.dx" }'
        structurer.faults.add("check.output", problem)
        return {}
    sway: Mapping[str, str] = structurer.fit(names, kinds_of(ExternalFmu)["sway"], "check.output.sway")
    return sway
