"""A motion, an FMU or a planner block, written to files."""

from collections.abc import Sequence
from enum import Enum
from pathlib import Path
from typing import TypeVar

from gen_profile.assurance.proof.verdict import HISTORIES
from gen_profile.delivery.designs.design import Design
from gen_profile.delivery.designs.design import design as _design
from gen_profile.delivery.designs.fmu import Export, platform_names
from gen_profile.delivery.designs.fmu import export_fmu as _export_fmu
from gen_profile.delivery.designs.planner import Deployment
from gen_profile.delivery.designs.planner import deploy_planner as _deploy_planner
from gen_profile.spec.arguments import as_names, as_path, as_text
from gen_profile.spec.model import Spec
from gen_profile.spec.reading import as_spec
from gen_profile.spec.values import require_whole
from gen_profile.support.errors import SpecError
from gen_profile.support.progress import Progress, no_progress, require_progress
from gen_profile.support.suggestion import suggestion
from gen_profile_fmu.description.fmu_files import Version
from gen_profile_fmu.model.contents import AUTHOR
from gen_profile_fmu.model.plant_variables import InputKind

Kind = TypeVar("Kind", bound=Enum)


def design(
    spec: Spec | Path | str,
    formats: Sequence[str] | str,
    folder: Path | str,
    *,
    check: bool = True,
    keep_failed: bool = False,
    progress: Progress = no_progress,
) -> Design:
    """Solve, export, replay what was written, co-simulate, and deliver what passes.

    Parameters
    ----------
    spec : Spec, or the path of one
    formats : sequence of str, or str
        Names known to the exporters' registry.
    folder : Path or str
        Made if needed; files of the same names are replaced, others left alone.
    check : bool
        Without it the manifest says ``"unverified"``.
    keep_failed : bool
        Deliver even what failed, marked so in the manifest.
    progress : callable
        Told what is being done.

    Raises
    ------
    GenProfileError
        Nothing was written.

    Examples
    --------
    >>> gp.design(gp.preset_spec("paper"), "csv", "deploy").passed
    True
    """
    require_progress(progress)
    spec, folder = as_spec(spec), as_path(folder)
    return _design(spec, as_names(formats), folder, check=check, keep_failed=keep_failed, progress=progress)


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
        author=author,
        progress=progress,
    )


def deploy_planner(
    spec: Spec | Path | str,
    formats: Sequence[str] | str,
    folder: Path | str,
    *,
    histories: int = HISTORIES,
    check: bool = True,
    keep_failed: bool = False,
    scheduler: str | None = None,
    progress: Progress = no_progress,
) -> Deployment:
    """Write a planner block, prove what was written, and deliver what passes.

    Parameters
    ----------
    spec : Spec, or the path of one
    formats : sequence of str, or str
        Names of formats that carry function blocks, or C. All hold the same program; one is executed.
    folder : Path or str
        Made if needed; files of the same names are replaced, others are left alone.
    histories : int
        Of commands, that it is proved on; fewer than 200 are a trial.
    check : bool
        Without it the manifest says ``"unverified"``.
    keep_failed : bool
        Deliver even what failed, marked so in the manifest. Otherwise changes are looked for that pass.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers run the histories.
    progress : callable
        Told what is being done.

    Raises
    ------
    GenProfileError
        Nothing was written.

    Examples
    --------
    >>> gp.deploy_planner(gp.preset_spec("bay-crane"), "plc", "block", histories=10).proof.passed
    True
    """
    require_progress(progress)
    spec = as_spec(spec)
    if scheduler is not None:
        as_text(scheduler, "scheduler: an address")
    require_whole(histories, 1, "histories")
    return _deploy_planner(
        spec,
        as_names(formats),
        as_path(folder),
        histories=histories,
        check=check,
        keep_failed=keep_failed,
        scheduler=scheduler,
        progress=progress,
    )


def _one_of(kinds: type[Kind], value: Kind | str, place: str) -> Kind:
    """Take a member of an enumeration as it is, or by its value."""
    known = {str(member.value): member for member in kinds}
    taken = value if isinstance(value, kinds) else known.get(str(value))
    if taken is None:
        raise SpecError(f"{place}: unknown value {value!r}{suggestion(str(value), known)}")
    return taken
