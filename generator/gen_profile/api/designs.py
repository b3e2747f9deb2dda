"""A motion, written to files and checked."""

from collections.abc import Sequence
from pathlib import Path

from gen_profile.delivery.designs.design import Design
from gen_profile.delivery.designs.design import design as _design
from gen_profile.spec.arguments import as_names, as_path
from gen_profile.spec.model import Spec
from gen_profile.spec.reading import as_spec
from gen_profile.support.progress import Progress, no_progress, require_progress


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
