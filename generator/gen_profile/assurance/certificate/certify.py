"""Proving a bound of every machine's sway: boxes are halved until it is close, or there are too many."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import attrs
import numpy as np

from gen_profile.assurance.certificate import approximation
from gen_profile.assurance.certificate.arithmetic.balls import Array
from gen_profile.assurance.certificate.axes.axis_motion import fitted
from gen_profile.assurance.certificate.boxes import DyadicBox, halves, shares, volume
from gen_profile.assurance.certificate.in_order import in_order
from gen_profile.assurance.certificate.packing import Motions
from gen_profile.assurance.certificate.sway_limits import limits_of
from gen_profile.assurance.certificate.theorem import Theorem, followed, ranges_of
from gen_profile.dynamics.evaluation.residual_sway import observation_time
from gen_profile.dynamics.problem.parameter_box import Box
from gen_profile.motion.profile import SampledProfile
from gen_profile.spec.model import Spec
from gen_profile.support.errors import CertificateError

FEW = 16  # boxes, up to which `CertificateOptions.radians_per_box` holds
FEWEST_TERMS = 4  # of series in parameters
LEAST_POWER, WIDEST = 1e-6, 0.5  # what they leave out where motions change little; how wide a range counts as
POINT = 40  # halvings, after which a range is one machine
PLACES = 17  # along a range, at which phases are looked at
SLACK = 1e-3  # relative, by which a bound is stated higher than found, as other rounding could break it
NEAR = 1e-5  # of what is allowed: a smooth motion that is as near to the axes' is near enough
LOOSEST = 0.05  # of the move: more that is allowed does not tell what is near enough

Progress = Callable[[int, int], None]


@attrs.frozen(kw_only=True)
class CertificateOptions:
    """How close a bound is to come, and how far it goes for it; see docs/certificate.md for the evidence.

    Attributes
    ----------
    close : float
        Times the greatest sway met: a bound as low is close enough.
    close_to_limit : float
        Of what is allowed: likewise a bound that is above the sway by as much.
    radians_per_box, radians_per_wide_box : float
        rad by which a mode's phase at the end varies over a box at first, where boxes are few and many.
    radians_per_piece : float
        rad of the fastest mode that a piece of time covers at most.
    truncation : float
        What series in parameters leave out, relative.
    max_nodes : int
        At which equations are evaluated in all: some twenty minutes.
    max_halvings : int
        Beyond the first boxes, of all ranges in sum.
    max_fruitless : int
        Rounds in a row that bring no bound nearer, after which no more are tried.
    worth_halving : float
        Of what the worst bound is too high by, to which it comes down in a round that brings it nearer.
    """

    close: float = 1.03
    close_to_limit: float = 2e-3
    radians_per_box: float = 2.5
    radians_per_wide_box: float = 5.0
    radians_per_piece: float = 3.0
    truncation: float = 1e-5
    max_nodes: int = 5 * 10**8
    max_halvings: int = 8
    max_fruitless: int = 4
    worth_halving: float = 0.8


USUAL = CertificateOptions()


@attrs.frozen(kw_only=True, eq=False)
class Attempt:
    """What came of a try to prove a bound.

    Attributes
    ----------
    theorem : Theorem
    boxes : tuple of DyadicBox
        Of which a bound is proved.
    motions : tuple of Motions
    scales : array
        Of `Approximation`, for these boxes.
    bounds : (boxes, limits) array
        m, of `Theorem.allowed`.
    largest_met : (limits,) array
        Greatest sway that was met, in m, and by how much nearer than the clearance.
    fraction : float
        Of the whole box, of which a bound is proved.
    reached : bool
        Whether a bound was found of any machine, be it by itself.
    """

    theorem: Theorem
    boxes: tuple[DyadicBox, ...]
    motions: tuple[Motions, ...]
    scales: Array
    bounds: Array
    largest_met: Array
    fraction: float
    reached: bool = True


def attempt(
    spec: Spec,
    setpoints: SampledProfile,
    progress: Progress = lambda _, __: None,
    *,
    options: CertificateOptions = USUAL,
) -> Attempt:
    """Prove bounds for boxes of machines, the worst of them as tightly as is wanted.

    Parameters
    ----------
    spec : Spec
    setpoints : SampledProfile
        Replayed from an artefact.
    progress : callable
        Told how many boxes are done, and of how many so far.
    options : CertificateOptions

    Raises
    ------
    CertificateError
        No proof is written for what the spec asks.
    CosimulationError
        Machines cannot be integrated.
    """
    theorem, waiting = _prepared(spec, setpoints, options)
    most = options.max_nodes // theorem.nodes  # boxes
    deepest = max(sum(level for level, _ in box) for box in waiting) + options.max_halvings
    limits = theorem.allowed
    done, tried = dict[DyadicBox, _Proof](), 0
    largest_met, fruitless, before = np.zeros(len(limits)), 0, np.inf
    middle = tuple((POINT, 2 ** (POINT - 1)) for _ in theorem.ranges.names)
    while waiting:
        prove = partial(_prove, theorem, _wanted(theorem, largest_met, options))
        for batch, proofs, here in in_order(prove, _integrated(theorem, waiting)):
            done.update(zip(batch, proofs, strict=True))
            largest_met = np.fmax(largest_met, here)
            tried += len(batch)
            progress(tried, tried + len(waiting))
        wanted = _wanted(theorem, largest_met, options)
        coarse = [box for box, proof in done.items() if not (proof.bound <= wanted).all()]
        coarse = [box for box in coarse if box and sum(level for level, _ in box) < deepest]
        above = np.array([done[box].bound - wanted for box in waiting])
        proved = np.isfinite(above).all(axis=1)
        worst = float(above.max()) if proved.all() else np.inf
        nearer = worst < options.worth_halving * before if proved.all() else bool(proved.any())
        fruitless, before = 0 if nearer else fruitless + 1, min(before, worst)
        if tried == len(done) and not proved.any():  # at first
            _, (alone,), _ = prove(next(_integrated(theorem, [middle])))
            if not np.isfinite(alone.bound).all():
                return _attempt(theorem, {}, largest_met, reached=False)
        if tried + 2 * len(coarse) > most or fruitless == options.max_fruitless:
            break
        waiting = [part for box in coarse for part in halves(box, int(np.argmax(done[box].tails)))]
        for box in coarse:
            del done[box]
    return _attempt(theorem, done, largest_met)


def _first_boxes(box: Box, most: float, options: CertificateOptions = USUAL) -> list[DyadicBox]:
    """Halve ranges until phases turn little over each part: few boxes, or wider ones where they are many.

    Of many boxes most are wider, as loads swing little in most of them; the others are halved later.

    Raises
    ------
    CertificateError
        There are too many.
    """
    for turn, allowed in ((options.radians_per_box, FEW), (options.radians_per_wide_box, most)):
        waiting, found = [((0, 0),) * len(box.ranges)], list[DyadicBox]()
        while waiting and len(waiting) + len(found) <= allowed:
            part = waiting.pop()
            turns = _turns(box, part)
            if turns.max(initial=0.0) > turn:
                waiting += reversed(halves(part, int(turns.argmax())))
            else:
                found.append(part)
        if not waiting:
            return found
    raise _too_wide(box, most)


def _too_wide(box: Box, most: float) -> CertificateError:
    return CertificateError(
        f"The ranges of {', '.join(box.ranges)} are too wide for a certificate: it takes "
        f"more than {most:.0f} boxes; narrow them, or let fewer parameters vary (check.uncertain)."
    )


def _turns(box: Box, part: DyadicBox) -> Array:
    """Tell how far modes' phases at the end turn along each range of a part at most, in rad."""
    lines = _lines(*map(np.array, shares(part)))
    return np.array([np.abs(np.diff(box.phases(line), axis=0)).sum(axis=0).max() for line in lines])


def _lines(low: Array, high: Array) -> Array:
    """List places along every range, in the middle of the others, (ranges, places, ranges)."""
    lines = np.tile(0.5 * (low + high), (len(low), PLACES, 1))
    for column, (begin, end) in enumerate(zip(low, high, strict=True)):
        lines[column, :, column] = np.linspace(begin, end, PLACES)
    return lines


def _wanted(theorem: Theorem, largest_met: Array, options: CertificateOptions) -> Array:
    """Tell how low bounds should be, by the greatest sway seen; a clearance has to be kept, and no more."""
    limits = theorem.allowed
    wanted = np.maximum(options.close * largest_met, largest_met + options.close_to_limit * limits)
    wanted[len(theorem.limits) :] = limits[len(theorem.limits) :]
    return np.where(largest_met < limits, np.minimum(wanted, limits / (1.0 + SLACK)), wanted)


def _terms(turn: float, width: float, truncation: float) -> int:
    """Tell how many terms a series needs over a box: as cos(turn y / 2) does, and 1 / (1 + width y)."""
    size, terms = 1.0, 0
    while terms < FEWEST_TERMS or size > truncation or (0.5 * width) ** terms > LEAST_POWER:
        terms += 1
        size *= 0.25 * turn / terms
    return terms


@attrs.frozen(kw_only=True, eq=False)
class _Proof:
    """Of one box: what it needs, its bounds in m, or nan, and how much each parameter's series leaves out."""

    motions: Motions | None
    scales: Array
    bound: Array
    tails: Array


def _integrated(
    theorem: Theorem, boxes: Sequence[DyadicBox]
) -> Iterator[tuple[Sequence[DyadicBox], Array, Array]]:
    """Integrate machines of boxes: what a proof is to be of, and made of."""
    for batch in theorem.batches(boxes):
        motions = [approximation.approximate(theorem, [box]) for box in batch]
        yield batch, np.concatenate(motions), approximation.scales(theorem, batch)


def _prove(
    theorem: Theorem, targets: Array, made: tuple[Sequence[DyadicBox], Array, Array]
) -> tuple[Sequence[DyadicBox], list[_Proof], Array]:
    """Prove bounds for a batch, and tell the greatest sway that was met."""
    batch, coefficients, scales = made
    bounds = theorem.enclosure(batch, coefficients, scales).bounds(targets)
    proofs = [
        _Proof(
            motions=Motions.of(motion) if np.isfinite(bound).all() else None,
            scales=scale,
            bound=bound,
            tails=_tails(motion, theorem.terms),
        )
        for motion, scale, bound in zip(coefficients, scales, bounds.sway, strict=True)
    ]
    return batch, proofs, np.nanmax(bounds.largest_met, axis=0, initial=0.0)


def _attempt(
    theorem: Theorem, done: dict[DyadicBox, _Proof], largest_met: Array, *, reached: bool = True
) -> Attempt:
    """Keep the boxes with a bound."""
    proved = {box: proof for box, proof in done.items() if np.isfinite(proof.bound).all()}
    return Attempt(
        theorem=theorem,
        boxes=tuple(proved),
        motions=tuple(proof.motions for proof in proved.values() if proof.motions is not None),
        scales=np.array([proof.scales for proof in proved.values()]),
        bounds=np.array([proof.bound for proof in proved.values()]).reshape(-1, len(largest_met)),
        largest_met=largest_met,
        fraction=float(volume(proved)),
        reached=reached,
    )


def _tails(motion: Array, terms: Sequence[int]) -> Array:
    """Sum up coefficients of the highest two degrees in each parameter, as shares of their coordinate's."""
    sizes = np.abs(motion).sum(axis=(0, 2))
    totals = sizes.sum(axis=1, keepdims=True)
    sizes = (sizes / np.where(totals > 0.0, totals, 1.0)).reshape(-1, *terms)  # a load may not swing at all
    return np.array([sizes.take([-2, -1], axis=k).sum() for k in range(1, sizes.ndim)])


def _prepared(
    spec: Spec, setpoints: SampledProfile, options: CertificateOptions = USUAL
) -> tuple[Theorem, list[DyadicBox]]:
    """State the theorem, and cut its ranges into the first boxes.

    Raises
    ------
    CertificateError
        There are too many.
    """
    plant, ranges, watch = spec.machine(), ranges_of(spec), observation_time(spec)
    track = followed(spec, setpoints)
    box = Box(
        plant=plant,
        nominal=spec.plant.parameters,
        ranges=ranges.ends,
        ends=(spec.move.start, spec.move.target),
        duration=float(track.times[-1]) + watch,
    )
    none, whole = np.zeros(len(ranges.names)), np.ones(len(ranges.names))
    fastest = float(box.phases(np.concatenate([0.5 * whole[None], *_lines(none, whole)])).max())
    longest = options.radians_per_piece * box.duration / fastest
    limits = limits_of(spec)
    farthest = float(np.abs(np.subtract(spec.move.target, spec.move.start)).max())
    near = NEAR * min(*(limit.allowed for limit in limits), LOOSEST * farthest or np.inf)
    axes = fitted(track, max(0.6 * float(setpoints.resolution.max()), near), longest, watch)
    theorem = Theorem(
        spec=spec,
        axes=axes,
        ranges=ranges,
        limits=limits,
        setpoints=setpoints,
        terms=(1,) * len(ranges.names),
    )
    boxes = _first_boxes(box, options.max_nodes / theorem.nodes, options)
    turns = np.max([_turns(box, part) for part in boxes], axis=0)
    widths = np.minimum(np.max([ranges.widths(part) for part in boxes], axis=0), WIDEST)
    terms = [_terms(*each, options.truncation) for each in zip(turns.tolist(), widths.tolist(), strict=True)]
    theorem = attrs.evolve(theorem, terms=tuple(terms))
    if 3 * len(boxes) > (most := options.max_nodes / theorem.nodes):  # with the halves of each
        raise _too_wide(box, most)
    return theorem, boxes
