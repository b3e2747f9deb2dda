"""Methods side by side, and over errors of parameters."""

from collections.abc import Sequence
from pathlib import Path

from gen_profile.motion.profile import Profile, require_motion
from gen_profile.spec.arguments import as_names, as_number
from gen_profile.spec.model import Spec
from gen_profile.spec.reading import as_spec
from gen_profile.studies.comparison.compare import Comparison
from gen_profile.studies.comparison.compare import compare as _compare
from gen_profile.studies.comparison.robustness import Robustness
from gen_profile.studies.comparison.robustness import robustness as _robustness
from gen_profile.support.progress import Progress, no_progress, require_progress


def compare(
    spec: Spec | Path | str, progress: Progress = no_progress, *, own: Sequence[Profile] | Profile = ()
) -> Comparison:
    """Try every shaper and variants of the optimal motion on the machines of a spec.

    Parameters
    ----------
    spec : Spec, or the path of one
    progress : callable
        Told what is being done.
    own : sequence of Profile, or Profile
        Further motions of the axes, each of a ``method`` of its own.

    Examples
    --------
    >>> gp.compare(gp.preset_spec("paper"))
    <Comparison name: paper, methods: nzv, zv, ... fastest: optimal-beta0, gentlest: optimal-beta50>
    """
    require_progress(progress)
    return _compare(as_spec(spec), progress, own=_motions(own))


def robustness(
    spec: Spec | Path | str,
    parameters: Sequence[str] | str = (),
    *,
    methods: Sequence[str] | str = (),
    own: Sequence[Profile] | Profile = (),
    points: int | None = None,
    half_range: float | None = None,
    progress: Progress = no_progress,
) -> Robustness:
    """Try shapers and variants of the optimal motion over errors of one or two parameters.

    Parameters
    ----------
    spec : Spec, or the path of one
    parameters : sequence of str, or str
        One or two; the first uncertain one by default.
    methods : sequence of str, or str
        As `gen_profile.studies.comparison.candidates` names them; all by default.
    own : sequence of Profile, or Profile
        Further motions of the axes, each of a ``method`` of its own.
    points : int, optional
        Per parameter.
    half_range : float, optional
        Greatest relative error; by default one and a half times what the spec states.
    progress : callable
        Told what is being done.

    Raises
    ------
    SpecError
        A parameter or method is unknown, there are too few points, or the range is none.

    Examples
    --------
    >>> gp.robustness(gp.preset_spec("paper"), "L1", methods=["zv", "optimal-beta50"], points=5)
    <Robustness name: paper, errors: L1 -30 to +30 %, zv: 17.72 mm at worst, optimal-beta50: 4.781 mm ...>
    """
    require_progress(progress)
    return _robustness(
        as_spec(spec),
        as_names(parameters),
        methods=as_names(methods),
        own=_motions(own),
        points=points,
        half_range=None if half_range is None else as_number(half_range, "range"),
        progress=progress,
    )


def _motions(own: Sequence[Profile] | Profile) -> Sequence[Profile]:
    """Take motions as they are, or a single one; raises SpecError where one is no profile."""
    motions = own if isinstance(own, list | tuple) else (own,)
    for motion in motions:
        require_motion(motion)
    return motions
