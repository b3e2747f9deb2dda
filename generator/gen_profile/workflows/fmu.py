"""From a spec to an FMU of its plant, of its motion, or of the plant that follows the motion."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import attrs

from gen_profile.spec import Spec
from gen_profile.workflows.delivery import deliver
from gen_profile.workflows.planning import plan, timed
from gen_profile_fmu.building import build_fmu
from gen_profile_fmu.fmu_files import Version
from gen_profile_fmu.model import Model, identifier_of, plant_model, profile_model, system_model
from gen_profile_fmu.plant_variables import InputKind, Machine
from gen_profile_fmu.platforms import PLATFORMS, host_platform

KINDS = ("plant", "profile", "system")


@attrs.frozen(kw_only=True)
class Export:
    """An FMU that was written.

    Attributes
    ----------
    path : Path
    content : bytes
    model : Model
    version : Version
    platforms : tuple of str
        That it has binaries for.
    """

    path: Path
    content: bytes
    model: Model
    version: Version
    platforms: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON."""
        host = host_platform()
        return {
            "path": str(self.path),
            "sha256": hashlib.sha256(self.content).hexdigest(),
            "bytes": len(self.content),
            "fmi": self.version.value,
            "model_identifier": self.model.identifier,
            "platforms": [{"name": name, "runs_here": name == host} for name in self.platforms],
        }


def export_fmu(
    spec: Spec,
    kind: str,
    *,
    version: Version,
    input_kind: InputKind,
    platforms: tuple[str, ...],
    path: Path | None,
    progress: Callable[[str], None] = lambda _: None,
) -> Export:
    """Write an FMU.

    Parameters
    ----------
    spec : Spec
    kind : str
        One of `KINDS`.
    version : Version
    input_kind : InputKind
        What a plant's drives are asked for; nothing else has inputs.
    platforms : tuple of str
        Names of `PLATFORMS`; none for sources only.
    path : Path or None
        Named after the spec in the working folder if not given.
    progress : callable
        Told what is being done.

    Raises
    ------
    GenProfileError
        Nothing was written.
    """
    model = _model(spec, kind, input_kind, progress)
    path = path or Path(f"{model.identifier}.fmu")
    content = build_fmu(model, version, platforms, progress)
    deliver(path, content)
    return Export(path=path, content=content, model=model, version=version, platforms=platforms)


def platform_names(choice: str) -> tuple[str, ...]:
    """Turn ``"host"``, ``"all"`` or a platform's name into names of `PLATFORMS`."""
    match choice:
        case "host":
            return (host_platform(),)
        case "all":
            return tuple(PLATFORMS)
    return (choice,)


def _model(spec: Spec, kind: str, input_kind: InputKind, progress: Callable[[str], None]) -> Model:
    name = identifier_of(f"{spec.name} {kind}")
    machine = Machine(
        plant=spec.machine(),
        parameters=spec.plant.parameters,
        tau=spec.actuator.tau or 0.0,
        period=spec.export.cycle_time,
        position=spec.move.start,
        initial=spec.move.initial,
    )
    if kind == "plant":
        return plant_model(machine, input_kind, name)
    progress("solving")
    command = plan(timed(spec)).trial.command
    if kind == "profile":
        return profile_model(name, machine.plant.actuated, command)
    return system_model(name, machine, command)
