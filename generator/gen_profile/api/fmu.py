"""FMUs, and systems of two."""

from collections.abc import Sequence
from enum import Enum
from pathlib import Path
from typing import TypeVar

from gen_profile.delivery.designs.fmu import Export, platform_names
from gen_profile.delivery.designs.fmu import export_fmu as _export_fmu
from gen_profile.spec.arguments import as_names, as_path, as_text
from gen_profile.spec.model import Spec
from gen_profile.spec.reading import as_spec
from gen_profile.support.errors import SpecError
from gen_profile.support.progress import Progress, no_progress, require_progress
from gen_profile.support.suggestion import suggestion
from gen_profile_fmu.description.fmu_files import Version
from gen_profile_fmu.model.contents import AUTHOR
from gen_profile_fmu.model.plant_variables import InputKind

Kind = TypeVar("Kind", bound=Enum)


def export_fmu(
    spec: Spec | Path | str,
    kind: str = "plant",
    path: Path | str | None = None,
    *,
    version: Version | str = Version.FMI2,
    input_kind: InputKind | str = InputKind.SETPOINT,
    platforms: Sequence[str] | str | None = None,
    author: str = AUTHOR,
    progress: Progress = no_progress,
) -> Export:
    """Write an FMU, or a system of two.

    Parameters
    ----------
    spec : Spec, or the path of one
    kind : str
        One of `KINDS`.
    path : Path or str, optional
        Named after the spec in the working folder if not given.
    version : Version or str
        ``"2"`` or ``"3"``.
    input_kind : InputKind or str
        What a plant's drives are asked for: ``"setpoint"``, ``"acceleration"`` or ``"velocity"``.
    platforms : sequence of str, or str, optional
        Names of `PLATFORMS`, none for sources only; this computer's by default.
    author : str
        Who made the model.
    progress : callable
        Told what is being done.

    Raises
    ------
    GenProfileError
        Nothing was written: a choice or the file's suffix is wrong, or there is no such motion.

    Examples
    --------
    >>> gp.export_fmu(gp.preset_spec("paper"), "plant", "crane.fmu").path.name
    'crane.fmu'
    """
    require_progress(progress)
    return _export_fmu(
        as_spec(spec),
        kind,
        as_path(path) if path else None,
        version=_one_of(Version, version, "version"),
        input_kind=_one_of(InputKind, input_kind, "input_kind"),
        platforms=platform_names("host") if platforms is None else tuple(as_names(platforms)),
        author=as_text(author, "author: a name"),
        progress=progress,
    )


def _one_of(kinds: type[Kind], value: Kind | str, place: str) -> Kind:
    """Take a member of an enumeration as it is, or by its value."""
    known = {str(member.value): member for member in kinds}
    taken = value if isinstance(value, kinds) else known.get(str(value))
    if taken is None:
        raise SpecError(f"{place}: unknown value {value!r}{suggestion(str(value), known)}")
    return taken
