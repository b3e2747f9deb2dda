"""A planner block, written to files and proved."""

from collections.abc import Sequence
from pathlib import Path

from gen_profile.assurance.proof.verdict import HISTORIES
from gen_profile.delivery.designs.planner import Deployment
from gen_profile.delivery.designs.planner import deploy_planner as _deploy_planner
from gen_profile.spec.arguments import as_names, as_path, as_text
from gen_profile.spec.model import Spec
from gen_profile.spec.reading import as_spec
from gen_profile.spec.values import require_whole
from gen_profile.support.progress import Progress, no_progress, require_progress


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
