"""Proving a written planner block: all histories run, the worst sought, some of them judged by FMPy, too."""

import os
from collections.abc import Sequence
from contextlib import AbstractContextManager, ExitStack
from functools import partial

import attrs
import numpy as np

from gen_profile.assurance.proof.closed_loop import ClosedLoop
from gen_profile.assurance.proof.exercised import required, sensor_met
from gen_profile.assurance.proof.followed import LATENESS
from gen_profile.assurance.proof.histories import Histories, other_stops
from gen_profile.assurance.proof.judging import Judge
from gen_profile.assurance.proof.lateness import chosen
from gen_profile.assurance.proof.numbering import KEPT, LONG, RHYTHMS, Numbering
from gen_profile.assurance.proof.sensing import faults_of
from gen_profile.assurance.proof.verdict import HISTORIES, JudgedHistory, Proof
from gen_profile.assurance.verification.cosimulation import ERROR_FLOOR
from gen_profile.assurance.verification.monte_carlo import CURVATURE
from gen_profile.spec.model import Spec
from gen_profile.support.plugins import require_installed
from gen_profile.support.progress import Progress, no_progress

BY_FMPY = 100  # of so many histories, one is judged by FMPy
FEWEST_BY_FMPY = 2
SEED_DIGITS = 8  # hexadecimal ones


def prove(
    spec: Spec,
    text: str,
    *,
    histories: int = HISTORIES,
    workers: int | None = None,
    scheduler: str | None = None,
    compares: bool = True,
    progress: Progress = no_progress,
) -> Proof:
    """Prove a written block on many histories, which the whole spec draws, `check.seed` among it.

    Parameters
    ----------
    spec : Spec
        Whose planner block it is.
    text : str
        The block, as it was written.
    histories : int
    workers : int, optional
        Processors to use; all that there are by default. What is found does not depend on it.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers run the histories instead.
    compares : bool
        Whether some commands are compared with the quickest motions, which takes its time.
    progress : callable
        Told what is being done.

    Raises
    ------
    ExportError
        It is no planner block's text.
    CosimulationError
        Something cannot be compiled or loaded.
    SpecError
        No worker of the scheduler answers, or they cannot do it.
    OutputError
        Dask is not installed.
    """
    numbering = Numbering.of(Histories.of(spec), histories, seed_of(spec))
    with ExitStack() as stack:
        judge: Judge | None = None
        if scheduler is not None:  # before anything takes its time
            on_cluster = _on_cluster(spec, text, scheduler, progress)
            judge = stack.enter_context(on_cluster)
        loop = stack.enter_context(closed_loop(spec, text, numbering.histories, workers, progress))
        judge = judge or partial(loop.judged, progress=progress)
        judged = judge(numbering, range(len(numbering.drawn)))
        for numbers in numbering.rounds:
            climbs = numbering.group(numbers[0]) == RHYTHMS
            among = [one for one in judged if (one.group == RHYTHMS) == climbs]
            numbering = numbering.after_round([one.number for one in _worst(spec, among)])
            judged += judge(numbering, numbers)
        return _verdict(spec, loop, numbering, judged, progress, compares=compares)


def seed_of(spec: Spec) -> int:
    """Give the seed of a spec's histories, from its hash: no two users' blocks meet the same ones."""
    return int(spec.sha256()[:SEED_DIGITS], base=16)


def replay(
    spec: Spec, text: str, numbering: Numbering, number: int, progress: Progress = no_progress
) -> Proof:
    """Run one history again.

    Parameters
    ----------
    numbering : Numbering
        With the rounds that a search has made.
    number : int
        Of the history, below `numbering.count`.

    Returns
    -------
    Proof
        That judges nothing else, with the history's trace.
    """
    with closed_loop(spec, text, numbering.histories, 1, progress) as loop:
        judged = loop.judged(numbering, [number])
        return _verdict(spec, loop, numbering, judged, progress)


def closed_loop(
    spec: Spec, text: str, histories: Histories, workers: int | None, progress: Progress
) -> ClosedLoop:
    """Load block and machine for that many processors."""
    progress("compiling block and machine, once")
    return ClosedLoop(spec, text, histories, workers=workers or os.cpu_count() or 1)


def _on_cluster(spec: Spec, text: str, scheduler: str, progress: Progress) -> AbstractContextManager[Judge]:
    """Let the workers of a Dask scheduler judge."""
    require_installed("A scheduler needs Dask", "sweep", "dask", "distributed")
    from gen_profile.assurance.proof.on_cluster import judged_on_cluster  # noqa: PLC0415  # Dask is an extra

    return judged_on_cluster(spec, text, scheduler, progress)


def _fraction(spec: Spec, judged: JudgedHistory) -> float:
    """Tell how near a history comes to a limit; a fault is beyond all."""
    return np.inf if judged.faults else judged.fraction(spec.check.residual_sway, 0.0)


def _height(spec: Spec, judged: JudgedHistory) -> float:
    """Tell by what the search climbs: in a rhythm by what any stated error would leave."""
    by_errors = judged.left / min(spec.check.residual_sway.values())
    return max(_fraction(spec, judged), by_errors * (judged.group == RHYTHMS))


def _worst(spec: Spec, among: Sequence[JudgedHistory]) -> list[JudgedHistory]:
    """Choose those that a round climbs from: by sway, and the last one by what is possible sooner."""
    by_sway = sorted(among, key=lambda one: _height(spec, one), reverse=True)
    latest = sorted(among, key=_overdue, reverse=True)[:KEPT]
    slowest = max((one.compared() for one in latest), key=_overdue, default=None)
    kept = [one for one in by_sway if slowest is None or one.number != slowest.number][: KEPT - 1]
    return [*kept, *([] if slowest is None else [slowest])]


def _overdue(judged: JudgedHistory) -> float:
    """Tell by how many of its slowest periods the latest command of a history is late."""
    return max((one.overdue(LATENESS) / one.period for one in judged.obeyed), default=-np.inf)


def _compared(judged: Sequence[JudgedHistory], seed: int) -> tuple[JudgedHistory, ...]:
    """Ask the linear programme for the quickest of some commands of each kind."""
    places = [(k, j) for k, one in enumerate(judged) for j in range(len(one.obeyed))]
    found = {k: list(one.obeyed) for k, one in enumerate(judged)}
    for place in chosen([judged[k].obeyed[j] for k, j in places], seed):
        k, j = places[place]
        found[k][j] = found[k][j].compared()
    return tuple(attrs.evolve(one, obeyed=tuple(found[k])) for k, one in enumerate(judged))


def _required(spec: Spec) -> list[tuple[str, str]]:
    """List what a proof of a spec's block must have tried; hoisting changes ropes in every cycle."""
    changing = spec.planner.live_rate or spec.planner.live_noise
    live = () if changing else tuple(spec.planner.live)
    kinds = faults_of(len(spec.planner.sensor.names)) if spec.planner.sensor else ()
    met = [sensor_met(kind) for kind in (("", *kinds) if kinds else ())]
    prompts = other_stops(spec) is not None
    return required(live, met, hoists=bool(spec.planner.live_rate), prompts=prompts)


def _verdict(
    spec: Spec,
    loop: ClosedLoop,
    numbering: Numbering,
    judged: Sequence[JudgedHistory],
    progress: Progress,
    *,
    compares: bool = True,
) -> Proof:
    """Bound the error at the worst histories, and let FMPy judge these and some others."""
    sound = [one for one in judged if not one.faults]
    worst = sorted(sound, key=lambda one: _fraction(spec, one), reverse=True)[:KEPT]
    halved = 0.5 * min(loop.max_step, loop.cycle)
    error = ERROR_FLOOR
    for one in worst:
        finer = loop.run(one.history, max_step=halved).residual
        coarse = np.array(list(one.residual.values()))
        between = CURVATURE * (numbering.histories.fastest * loop.cycle) ** 2 / 8.0 * coarse.max()
        error = max(error, ERROR_FLOOR + float(np.abs(finer - coarse).max() + between))
    short = [one for one in worst + sound if one.group not in (RHYTHMS, LONG)]  # others take it too long
    chosen = np.random.default_rng(numbering.seed).permutation(len(short))
    some = [short[k] for k in chosen[: max(FEWEST_BY_FMPY, len(sound) // BY_FMPY)]]
    by_fmpy = {one.number: one for one in (*short[:1], *some)}
    if compares:
        progress("comparing some with the quickest motions")
        judged = _compared(judged, numbering.seed)
    apart = [0.0]
    for done, one in enumerate(by_fmpy.values()):
        progress("co-simulating some by FMPy", done, len(by_fmpy))
        apart.append(loop.distance_from_fmpy(one.history, one.cycles))
    return Proof(
        limit=dict(spec.check.residual_sway),
        error_bound=error,
        seed=numbering.seed,
        count=numbering.count,
        parents=numbering.parents,
        judged=tuple(judged),
        by_fmpy=tuple(by_fmpy),
        apart=float(np.max(apart)),
        sway_limit=spec.limits.sway,
        overshoot_limit=spec.limits.overshoot,
        demanded=spec.planner.lateness,
        required=_required(spec) if len(judged) == numbering.count >= HISTORIES else (),
    )
