"""A file that was written, judged by co-simulation."""

from collections.abc import Sequence
from pathlib import Path

from gen_profile.assurance.verification.check import Judgement
from gen_profile.assurance.verification.check import check_artefact as _check_artefact
from gen_profile.spec.arguments import as_names, as_path
from gen_profile.spec.model import Spec
from gen_profile.spec.reading import as_spec
from gen_profile.support.progress import Progress, no_progress, require_progress


def check_artefact(
    path: Path | str,
    spec: Spec | Path | str | None = None,
    *,
    samples: int | None = None,
    row: int | None = None,
    strict: bool = False,
    scale: Sequence[str] | str = (),
    mirror: Sequence[str] | str = (),
    offset: Sequence[str] | str = (),
    progress: Progress = no_progress,
) -> Judgement:
    """Replay a file, co-simulate it, and compare it with its manifest.

    Parameters
    ----------
    path : Path or str
        Any artefact that the exporters write; its suffix names its format.
    spec : Spec, or the path of one, optional
        Taken from ``manifest.json`` beside the file when not given.
    samples : int, optional
        Draws in place of those that the spec asks for.
    row : int, optional
        Number of the only scenario to try.
    strict : bool
        Whether faults in the timing of setpoints count as well.
    scale, mirror, offset : sequences of str, or str
        A variant to judge, see `gen_profile.assurance.verification.check.varied`.
    progress : callable
        Told of a compilation, and how many scenarios beyond the machines are done, and of how many.

    Raises
    ------
    OutputError
        The file cannot be read, or there is no spec.
    SpecError
        There is no such scenario or axis.
    ExportError
        The file is damaged.
    CosimulationError

    Examples
    --------
    >>> gp.check_artefact("deploy/paper.csv").passed  # what gp.design wrote
    True
    """
    require_progress(progress)
    return _check_artefact(
        as_path(path),
        None if spec is None else as_spec(spec),
        samples=samples,
        row=row,
        strict=strict,
        scale=as_names(scale),
        mirror=as_names(mirror),
        offset=as_names(offset),
        progress=progress,
    )
