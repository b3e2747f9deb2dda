"""A smooth motion of the axes beside the setpoints, and how far the two are apart.

Pieces are quintic polynomials through position, velocity and acceleration at both ends, in whole numbers of
cycles. The motion and its velocity are continuous by construction, whatever rounding made of these values.
"""

from itertools import pairwise

import attrs
import numpy as np

from gen_profile.assurance.certificate.arithmetic.balls import UNIT, Array, Ball, ball, stack
from gen_profile.assurance.certificate.axes.axis_track import FINER, Track
from gen_profile.motion.profile import Profile
from gen_profile.support.errors import CertificateError

DEGREE = 5  # position, velocity and acceleration at both ends
FEWEST = 5  # setpoints in a piece
ROUNDS = 12  # of halving pieces
SAGITTA = 0.25  # share of what straight lines between setpoints leave out, to which a motion is fitted


@attrs.frozen(kw_only=True, eq=False)
class AxisMotion:
    """Quintic pieces.

    Attributes
    ----------
    knots : (pieces + 1,) array
        s, rising.
    position, velocity : (pieces + 1, m) arrays
        m and m/s (or rad …).
    acceleration : (pieces, 2, m) array
        At the beginning and the end of every piece.
    """

    knots: Array
    position: Array
    velocity: Array
    acceleration: Array

    @property
    def halves(self) -> Ball:
        """Half of every piece's length in s, shape (pieces,)."""
        return 0.5 * (ball(self.knots[1:]) - self.knots[:-1])

    def coefficients(self) -> Ball:
        """Position as powers of x, which goes from −1 to 1 over a piece, shape (6, pieces, m)."""
        half = self.halves[:, None]
        first, last = ball(self.position[:-1]), ball(self.position[1:])
        speeds = half * self.velocity[:-1], half * self.velocity[1:]
        curvatures = half * half * self.acceleration[:, 0], half * half * self.acceleration[:, 1]
        mean, way = 0.5 * (first + last), 0.5 * (last - first)
        lead, turn = 0.5 * (speeds[0] + speeds[1]), 0.5 * (speeds[1] - speeds[0])
        bend, twist = 0.5 * (curvatures[0] + curvatures[1]), 0.5 * (curvatures[1] - curvatures[0])
        fourth = 0.125 * (bend - turn)
        second = 0.25 * (3.0 * turn - bend)
        fifth = 0.125 * (twist - 3.0 * (lead - way))
        third = 0.5 * (lead - way) - 2.0 * fifth
        return stack([mean - second - fourth, way - third - fifth, second, third, fourth, fifth])

    def profile(self) -> Profile:
        """Take the motion as one that machines can follow, rounded."""
        c, half = self.coefficients().mid, np.asarray(self.halves.mid)
        shifted = np.zeros((len(half), DEGREE + 1, c.shape[2]))
        for power in range(DEGREE + 1):  # x = s / half − 1
            binomial = np.poly1d([1.0, -1.0]) ** power
            for rank, factor in enumerate(binomial.coeffs[::-1]):
                shifted[:, rank] += factor * c[power] / half[:, None] ** rank
        return Profile(
            knots=self.knots,
            coefficients=shifted,
            target=self.position[-1],
            final_velocity=self.velocity[-1],
            method="smoothed",
        )


def powers(coefficients: Ball, x: Ball, order: int) -> Ball:
    """Evaluate a derivative by x at nodes, shape (pieces, nodes, m)."""
    for _ in range(order):
        factors = np.arange(1.0, len(coefficients.mid))[:, None, None]
        coefficients = coefficients[1:] * factors
    result = ball(0.0)
    for power in range(len(coefficients.mid) - 1, -1, -1):
        result = result * x[None, :, None] + coefficients[power][:, None, :]
    return result


def widened(coefficients: Ball, reach: Array | float, order: int) -> Ball:
    """Enclose a derivative by x for all |x| ≤ reach, complex ones, too, shape (pieces, m)."""
    for _ in range(order):
        coefficients = coefficients[1:] * np.arange(1.0, len(coefficients.mid))[:, None, None]
    rest = sum((coefficients[k].most * reach**k for k in range(1, len(coefficients.mid))), start=0.0)
    return Ball(coefficients[0].mid, (coefficients[0].rad + rest) * (1.0 + 1e-12))


def fitted(track: Track, near: float, longest: float, watch: float) -> AxisMotion:
    """Fit a motion to that of the axes: splines with as many knots as it takes.

    Parameters
    ----------
    track : Track
    near : float
        How near is near enough, in m (or rad).
    longest : float
        Of a piece in s.
    watch : float
        How long to go on after the last point, in s.

    Raises
    ------
    CertificateError
        There are too few setpoints.
    """
    from scipy.interpolate import make_lsq_spline  # noqa: PLC0415  (loads slowly)

    times, position, bent = track.times[::FINER], track.position.mid[::FINER], _smoothed(track)
    last = track.parts[1]
    if last < 2 * FEWEST:
        raise CertificateError(
            f"The file has {last + 1} setpoints; a certificate needs at least {2 * FEWEST + 1} of them: "
            "choose a shorter cycle (export.cycle_time)."
        )
    knots = np.unique(np.concatenate([_spread(times, *part, longest) for part in pairwise(track.parts)]))
    leaps = track.parts[1:-1] * (DEGREE - 2)  # up to where only the velocity is continuous
    allowed = np.maximum(SAGITTA * np.abs(np.diff(position, 2, axis=0)).max() / 8.0, near)
    for _ in range(ROUNDS):
        inner = times[np.sort([*knots[1:-1], *leaps])]
        ends = [times[:1].repeat(DEGREE + 1), inner, times[-1:].repeat(DEGREE + 1)]
        spline = make_lsq_spline(times, bent, np.concatenate(ends), DEGREE)
        off = np.abs(spline(times) - bent).max(axis=1)
        halved = [
            (first + end) // 2
            for first, end in pairwise(knots.tolist())
            if end - first >= 2 * FEWEST and off[first : end + 1].max() > allowed
        ]
        if not halved:
            break
        knots = np.unique([*knots, *halved])
    begun, ended = (np.nextafter(times[knots], side) for side in (times[-1], times[0]))
    accelerations = np.stack([spline(begun[:-1], nu=2), spline(ended[1:], nu=2)], axis=1)
    values = [spline(times[knots], nu=order) for order in range(2)]
    return _balanced(track, _with_rest(track, times[knots], (*values, accelerations), longest, watch))


def _spread(times: Array, first: int, last: int, longest: float) -> Array:
    """Choose knots evenly in a part of a motion."""
    count = max(2, int(np.ceil((times[last] - times[first]) / longest)))
    return np.linspace(first, last, min(count, (last - first) // FEWEST) + 1).round().astype(int)


def _smoothed(track: Track) -> Array:
    """Take the track's means over a cycle around every setpoint, less what a bend adds to a mean."""
    areas, half = track.areas.mid, FINER // 2
    sums = areas[half:-half].reshape(-1, FINER, areas.shape[1]).sum(axis=1)
    ends = track.times[half::FINER]
    smooth = track.position.mid[::FINER].copy()
    smooth[1:-1] = sums / np.diff(ends)[:, None]
    smooth[1:-1] -= np.diff(smooth, 2, axis=0) / 24.0
    return np.asarray(smooth)


def _with_rest(
    track: Track, knots: Array, values: tuple[Array, Array, Array], longest: float, watch: float
) -> AxisMotion:
    """Begin at rest at the first setpoint, and go on after the last one."""
    position, velocity, accelerations = values
    position[0], velocity[0] = track.position.mid[0], 0.0
    position[-1], velocity[-1] = track.position.mid[-1], track.velocity
    after = knots[-1] + np.linspace(0.0, watch, 1 + int(np.ceil(watch / longest)))[1:]
    onward = track.position.mid[-1] + (after - knots[-1])[:, None] * track.velocity
    return AxisMotion(
        knots=np.concatenate([knots, after]),
        position=np.concatenate([position, onward]),
        velocity=np.concatenate([velocity, np.tile(track.velocity, (len(after), 1))]),
        acceleration=np.concatenate([accelerations, np.zeros((len(after), 2, position.shape[1]))]),
    )


def _balanced(track: Track, motion: AxisMotion) -> AxisMotion:
    """Bend every piece by a multiple of (1 − x²)², so that its mean is that of the axes."""
    ends = np.searchsorted(track.times, motion.knots[motion.knots <= track.times[-1]])
    gone = np.concatenate([0.0 * track.areas.mid[:1], np.cumsum(track.areas.mid, axis=0)])
    c, half = motion.coefficients().mid[:, : len(ends) - 1], motion.halves.mid[: len(ends) - 1, None]
    off = np.diff(gone[ends], axis=0) / (2.0 * half) - (c[0] + c[2] / 3.0 + c[4] / 5.0)
    acceleration = motion.acceleration.copy()
    acceleration[: len(off)] += (15.0 * off / half**2)[:, None]
    return attrs.evolve(motion, acceleration=acceleration)


@attrs.frozen(kw_only=True, eq=False)
class Gap:
    """How far the axes are from a smooth motion of theirs at most: bounds over every piece, (pieces, m).

    The difference ε of positions has the form ε̄ + ψ' on every piece, where ψ vanishes at both ends: setpoints
    lie on both sides of a motion that is fitted to them, with the same means, so ψ is smaller than ε by far.

    Attributes
    ----------
    position, velocity : (pieces, m) arrays
        Of ε and its rate η.
    mean : (pieces, m) array
        Of ε̄.
    integral : (pieces, m) array
        Of ψ, in m s (or rad s).
    mean_position, mean_integral : (pieces, m) arrays
        Of the means of |ε| and |ψ| over time.
    mean_squares : (pieces, 2 m, 2 m) array
        Of the means of all products of two of |ε| and |η|, those of |ε| first.
    """

    position: Array
    velocity: Array
    mean: Array
    integral: Array
    mean_position: Array
    mean_integral: Array
    mean_squares: Array


def gap_between(motion: AxisMotion, track: Track) -> Gap:
    """Bound how far the axes are from a motion.

    Between two points, the axes are away from a straight line by |a| h²/8 at most, and from its velocity by
    |a| h/2, with a their acceleration; so is the motion. Rounded setpoints leap about a smooth one:
    means over a piece are summed up from point to point, and are a fraction of the greatest values.
    """
    c, half = motion.coefficients(), motion.halves
    bend = (widened(c, 1.0, 2) / (half * half)[:, None]).most
    ends = np.minimum(np.searchsorted(track.times, motion.knots), len(track.times) - 1)
    rows = []
    for piece, (first, last) in enumerate(pairwise(ends.tolist())):
        part = _part(track, first, last) if last > first else _beyond(track, motion.knots[piece : piece + 2])
        rows.append(_piece_gap(c[:, piece : piece + 1], half[piece], bend[piece], part))
    names = [field.name for field in attrs.fields(Gap)]
    return Gap(**{name: np.array([getattr(row, name) for row in rows]) * (1.0 + 1e-12) for name in names})


def _part(track: Track, first: int, last: int) -> Track:
    """Cut a part out of a track."""
    points, between = slice(first, last + 1), slice(first, last)
    return attrs.evolve(
        track,
        times=track.times[points],
        position=track.position[points],
        areas=track.areas[between],
        bend=track.bend[between],
    )


def _beyond(track: Track, times: Array) -> Track:
    """Go straight on after the track's last point."""
    onward = (ball(times) - track.times[-1])[:, None] * track.velocity + track.position[-1]
    position = Ball(onward.mid, onward.rad + track.creep)
    area = 0.5 * (ball(times[1:]) - times[:-1])[:, None] * (position[1:] + position[:-1])
    return attrs.evolve(track, times=times, position=position, areas=area, bend=track.late_bend[None])


def _piece_gap(c: Ball, half: Ball, bend: Array, track: Track) -> Gap:
    """Bound all that `Gap` holds, over one piece."""
    times, at = ball(track.times), track.position
    begin, end = times[:1], times[-1:]

    def x_of(times: Ball) -> Ball:
        return (times - 0.5 * (begin + end)) / half

    step = times[1:] - times[:-1]
    middle = 0.5 * (times[1:] + times[:-1])
    longest, curvature = step.most.max(), bend + track.bend.max(axis=0)
    faster = ((at[1:] - at[:-1]) / step[:, None] - powers(c, x_of(middle), 1)[0] / half).most
    faster = faster + curvature * longest / 2.0
    apart = _greater((at - powers(c, x_of(times), 0)[0]).most) + curvature * longest**2 / 8.0
    primitives = stack([0.0 * c[0], *(c[k] / (k + 1.0) for k in range(DEGREE + 1))])
    primitive = powers(primitives, x_of(times), 0)[0]
    gone = _running_sum(track.areas) - half * (primitive - primitive[:1])
    mean = gone[-1:] / (end - begin)
    swung = _greater((gone - mean * (times - begin)[:, None]).most) + faster * longest**2 / 8.0
    share, both = step.most / (end - begin).mid, np.concatenate([apart, faster], axis=1)
    return Gap(
        position=apart.max(axis=0),
        velocity=faster.max(axis=0),
        mean=mean.most[0],
        integral=swung.max(axis=0),
        mean_position=share @ apart,
        mean_integral=share @ swung,
        mean_squares=np.einsum("k,ki,kj->ij", share, both, both),
    )


def _greater(values: Array) -> Array:
    """Take the greater one of two neighbours."""
    return np.maximum(values[1:], values[:-1])


def _running_sum(values: Ball) -> Ball:
    """Add rows up, from nothing."""
    terms = len(values.mid) + 1

    def summed(array: Array) -> Array:
        return np.concatenate([np.zeros((1, array.shape[1])), np.cumsum(array, axis=0)])

    rad = summed(values.rad) + terms * UNIT * summed(np.abs(values.mid))
    return Ball(summed(values.mid), rad * (1.0 + 2 * terms * UNIT))
