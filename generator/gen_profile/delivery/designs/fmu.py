"""From a spec to an FMU of its plant, motion or planner, of the plant with either, or to a system of FMUs."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from gen_profile.delivery.designs.fmu_kinds import KINDS
from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.methods.solvers.plan import plan
from gen_profile.motion.profile import Profile
from gen_profile.planner.design import planner_block
from gen_profile.planner.directions import planned_axes
from gen_profile.spec.model import Spec
from gen_profile.support.artefacts.manifest import sha256
from gen_profile.support.artefacts.writing import deliver
from gen_profile.support.errors import CosimulationError, InfeasibleProblem, OutputError, SpecError
from gen_profile.support.progress import Progress, no_progress
from gen_profile.support.suggestion import suggestion
from gen_profile_exporters.planner.c_source import c_name
from gen_profile_fmu.building.build import build_fmu
from gen_profile_fmu.building.platforms import PLATFORMS, host_platform
from gen_profile_fmu.description.fmu_files import Version
from gen_profile_fmu.description.system_structure import Component, ssp
from gen_profile_fmu.model.contents import AUTHOR, Model, plant_model, profile_model, system_model
from gen_profile_fmu.model.nominals import smooth_move, state_nominals
from gen_profile_fmu.model.planner import planned_system_model, planner_model
from gen_profile_fmu.model.plant_variables import InputKind, PlantInstance

START_PERIODS = 2.0  # of the slowest swing, that a move takes of which the shortest duration is asked for
LEADERS = {"ssp": "profile", "planned-ssp": "planner"}  # of systems of two FMUs: what the plant follows


@attrs.frozen(kw_only=True)
class Export:
    """An FMU, or a system of FMUs, that was written.

    Attributes
    ----------
    path : Path
    content : bytes
    identifier : str
        The FMU's model identifier, or the system's name.
    version : Version
    platforms : tuple of str
        That it has binaries for.
    """

    path: Path
    content: bytes = attrs.field(repr=False)
    identifier: str
    version: Version
    platforms: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON."""
        host = host_platform()
        return {
            "path": str(self.path),
            "sha256": sha256(self.content),
            "bytes": len(self.content),
            "fmi": self.version.value,
            "model_identifier": self.identifier,
            "platforms": [{"name": name, "runs_here": name == host} for name in self.platforms],
        }


def export_fmu(
    spec: Spec,
    kind: str,
    path: Path | None,
    *,
    version: Version,
    input_kind: InputKind,
    platforms: tuple[str, ...],
    author: str = AUTHOR,
    progress: Progress = no_progress,
) -> Export:
    """Write an FMU, or a system of two, for platforms by their names; named after the spec without a path.

    Raises
    ------
    GenProfileError
        Nothing was written: the kind, a platform or the file's suffix is wrong, or there is no such motion.
    """
    if kind not in KINDS:
        raise SpecError(f"There is no FMU of the kind {kind!r}{suggestion(kind, KINDS)}")
    systems = {"ssp": spec.ascii_name, "planned-ssp": f"{spec.ascii_name} planned"}
    identifier = c_name(systems.get(kind, f"{spec.ascii_name} {kind}"))
    suffix = ".ssp" if kind in LEADERS else ".fmu"
    path = path or Path(f"{identifier}{suffix}")
    if path.suffix.lower() != suffix:
        raise OutputError(f"out {path}: name a file that ends in {suffix}, as other tools ask for.")
    for platform in platforms:
        if platform not in PLATFORMS:
            raise SpecError(f"platforms: unknown platform {platform!r}{suggestion(platform, PLATFORMS)}")

    def built(model: Model) -> bytes:
        return build_fmu(attrs.evolve(model, author=author), version, platforms, progress)

    if kind in LEADERS:
        leader, plant = (
            Component(name=name, model=_model(spec, name, input_kind, progress))
            for name in (LEADERS[kind], "plant")
        )
        content = ssp(identifier, leader, plant, spec.export.cycle_time, built)
    else:
        content = built(_model(spec, kind, input_kind, progress))
    deliver(path, content)
    return Export(path=path, content=content, identifier=identifier, version=version, platforms=platforms)


def platform_names(choice: str) -> tuple[str, ...]:
    """Turn ``"host"``, ``"all"`` or a platform's name into names of `PLATFORMS`."""
    return {"host": (host_platform(),), "all": tuple(PLATFORMS)}.get(choice, (choice,))


def _model(spec: Spec, kind: str, input_kind: InputKind, progress: Progress) -> Model:
    name = c_name(f"{spec.ascii_name} {kind}")
    if kind in ("profile", "system"):
        evaluation = plan(spec, progress=progress).evaluation
        if kind == "profile":
            return profile_model(name, spec.machine().actuated, evaluation.command)
        return system_model(name, _machine(spec, _nominals(spec, evaluation.motion)), evaluation.command)
    if kind == "plant":
        return plant_model(_machine(spec, _rough_nominals(spec)), input_kind, name)
    progress("finding the modes over the live ranges")
    text, live = planner_block(spec).text, tuple(spec.planner.live)
    if kind == "planner":
        return planner_model(name, text, _planned(spec), live)
    return planned_system_model(name, text, _machine(spec, _rough_nominals(spec)), _planned(spec), live)


def _planned(spec: Spec) -> dict[str, str]:
    """Name the axes that a planner block plans, by what the names of its inputs and outputs end in."""
    axes = spec.machine().actuated
    return {axis.suffix: axes[number].name for number, axis in planned_axes(spec).items()}


def _machine(spec: Spec, nominal: Mapping[str, float]) -> PlantInstance:
    move = spec.move
    return PlantInstance(
        plant=spec.machine(),
        parameters=spec.plant.parameters,
        tau=spec.actuator.tau or 0.0,
        period=spec.export.cycle_time,
        position=move.start,
        initial=move.initial,
        nominal=nominal,
    )


def _nominals(spec: Spec, motion: Profile) -> dict[str, float]:
    return state_nominals(spec.machine(), spec.plant.parameters, motion, spec.move.initial)


def _rough_nominals(spec: Spec) -> dict[str, float]:
    """Find how large the states become in a move as the spec's, without solving.

    None are found where that would throw a load over: a plant is good for other moves, too.
    """
    move, duration = spec.move, spec.move.duration
    try:
        if move.shortest:
            slowest = linearize(spec.machine(), spec.plant.parameters, move.target).frequencies[0]
            duration = START_PERIODS * 2.0 * np.pi / slowest
        return _nominals(spec, smooth_move(move.start, move.target, duration))
    except (CosimulationError, InfeasibleProblem):
        return {}
