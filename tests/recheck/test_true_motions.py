"""True motions, integrated from setpoint to setpoint, are within the errors that the re-checker bounds."""

from functools import partial, reduce
from itertools import pairwise, product
from math import hypot

import pytest
from certificates import certified, contents
from flint import arb, arb_mat

from gen_profile_recheck import enclosure
from gen_profile_recheck.boxes import Places, chebyshev_value
from gen_profile_recheck.check import Case
from gen_profile_recheck.jets import derivatives
from gen_profile_recheck.reading import read_json

SPECS = [
    ("single-pendulum-crane", "export.cycle_time=0.01", "robustness.uncertain={L0=0.02}"),
    ("slosh-tank", "robustness.uncertain={h=0.0005}", "export.cycle_time=0.02"),
]
PLACE, PIECES, STEPS = -1, 4, 4  # of the parameter; how many pieces, and steps from setpoint to setpoint


class EnoughError(Exception):
    """So many pieces are done."""


def middles(values):
    return [arb(float(one)) for one in values]


def step(rate, x, a, v, time):
    """Take a step of Runge and Kutta's with axes at constant speed."""

    def slope(known, share):
        away = [one + share * time * other for one, other in zip(x, known, strict=True)]
        return middles(rate(middles(away), [p + share * time * q for p, q in zip(a, v, strict=True)], v))

    first = slope([0] * len(x), 0)
    second = slope(first, 0.5)
    third = slope(second, 0.5)
    fourth = slope(third, 1)
    sums = zip(x, first, second, third, fourth, strict=True)
    return middles(one + time / 6 * (p + 2 * q + 2 * r + s) for one, p, q, r, s in sums)


def polynomial(coefficients, counts, places):
    basis = (
        reduce(arb.__mul__, map(lambda n, u: arb(chebyshev_value(n, u)), degrees, places))
        for degrees in product(*map(range, counts))
    )
    return sum((arb(one) * two for one, two in zip(coefficients, basis, strict=True)), start=arb(0))


def error_of(proof, k, place, x, positions):
    """Measure by how much a true motion is off X at the end of a piece, as the proof does."""
    machine, series, axes = proof.machine, proof.piece.series, proof.piece.axes
    a = [axis.smooth(arb(1)) for axis in axes]
    v = [axis.smooth.derivative()(arb(1)) / proof.piece.half for axis in axes]
    ends = [(arb_mat([[1] * one.nrows()]) * one).entries() for one in series]
    nearly = [polynomial(one, proof.piece.box.terms, [place]) for one in ends]
    lifts = derivatives(lambda v: machine.rate(nearly, a, v, k), v)
    gaps = [p - q for p, q in zip(positions, a, strict=True)]
    there = [
        one + sum((arb(g) * gap for g, gap in zip(row, gaps, strict=True)), start=arb(0))
        for one, row in zip(nearly, lifts, strict=True)
    ]
    ours, true = (one[: proof.n] + machine.speed(one, a, v, k) for one in (there, x))
    off = [one - other for one, other in zip(true, ours, strict=True)]
    scale = proof.scale.scale.at(Places([place]))
    return hypot(*(float(sum((s * e for s, e in zip(row, off, strict=True)), start=arb(0))) for row in scale))


@pytest.mark.slow
@pytest.mark.parametrize("spec", SPECS)
def test_errors_of_true_motions_are_bounded_and_not_by_far(tmp_path, monkeypatch, spec):
    files = contents(*certified(tmp_path, *spec))
    case = Case(files[0], read_json(files[1])["spec"], read_json(files[2]))
    met, before = [], enclosure.PieceProof.error_after

    def error_after(proof, error):
        if len(met) == PIECES:
            raise EnoughError
        met.append((proof, before(proof, error)))
        return met[-1][1]

    monkeypatch.setattr(enclosure.PieceProof, "error_after", error_after)
    with pytest.raises(EnoughError):
        case.prove(lambda done, boxes: None, 1)
    times, positions = case.setpoints.times, list(zip(*case.setpoints.positions, strict=True))
    k, rate, ratios = met[0][0].piece.box.constants(Places([arb(PLACE)])), case.machine.rate, []
    x = [arb(0)] * (2 * met[0][0].n)
    for (proof, bound), (begin, end) in zip(met, pairwise(case.proof.knots), strict=False):
        for row in range(times.index(begin), times.index(end)):
            time = (times[row + 1] - times[row]) / STEPS
            v = [(q - p) / (STEPS * time) for p, q in zip(positions[row], positions[row + 1], strict=True)]
            for number in range(STEPS):
                a = [p + number * time * q for p, q in zip(positions[row], v, strict=True)]
                x = step(partial(rate, k=k), x, middles(a), middles(v), time)
        ratios.append(error_of(proof, k, arb(PLACE), x, middles(positions[times.index(end)])) / float(bound))
    assert 0.5 < max(ratios) < 1
