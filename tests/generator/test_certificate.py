"""What a certificate proves, held against Arb's arithmetic, exact solutions, and dense grids of machines."""

from functools import cache, partial
from itertools import pairwise
from types import SimpleNamespace

import attrs
import flint
import numpy as np
import pytest
from numpy.polynomial import chebyshev as series

import gen_profile as gp
from gen_profile.assurance.certificate import certify, theorem
from gen_profile.assurance.certificate.boxes import covers
from gen_profile.assurance.certificate.certify import _tails, attempt
from gen_profile.assurance.verification.batch import on_processors
from gen_profile.motion.profile import SampledProfile

CLOSE = 1.05  # how far a bound may be above the truth


@cache
def planned(preset, *overrides):
    spec = gp.preset_spec(preset, overrides)
    return spec, gp.sample(gp.plan(spec).command, spec.export.cycle_time)


@cache
def crane():
    """The paper's crane with a rope that is known better, and setpoints in tenths of a micrometre."""
    spec, setpoints = planned("paper", "robustness.uncertain={L1=0.08}", "export.cycle_time=0.002")
    position = np.round(setpoints.position, 7)
    setpoints = SampledProfile(cycle_time=0.002, position=position, resolution=np.array([1e-7]))
    return attempt(spec, setpoints)


def greatest(found):
    return found.bounds.max(axis=0)


def rate_in_arb(plant, x, q_a, v, p):
    """Evaluate f from the machine's own text alone; how D changes along the motion by a difference."""
    n, tiny = len(plant.unactuated), flint.arb(2) ** -300

    def solved(q, dq, at):
        terms = plant.equations(q, dq, at, v, p)
        push = flint.arb_mat([[-a for a in column] for column in zip(*terms.M_au, strict=True)]) * column_of(
            v
        )
        force = column_of([k + g for k, g in zip(terms.K_u, terms.G_u, strict=True)])
        mass = flint.arb_mat([[flint.arb(1) * entry for entry in row] for row in terms.M_uu])
        return entries(mass.solve(force)), entries(mass.solve(push))

    q, w = x[:n], x[n:]
    _, driven = solved(q, w, q_a)
    dq = [a + b for a, b in zip(w, driven, strict=True)]
    free, _ = solved(q, dq, q_a)
    ends = [
        solved(
            [a + s * b for a, b in zip(q, dq, strict=True)],
            dq,
            [a + s * b for a, b in zip(q_a, v, strict=True)],
        )[1]
        for s in (tiny, -tiny)
    ]
    return [*dq, *(a - (up - down) / (2 * tiny) for a, up, down in zip(free, *ends, strict=True))]


def column_of(values):
    return flint.arb_mat([[flint.arb(1) * value] for value in values])


def entries(column):
    return [column[row, 0] for row in range(column.nrows())]


def sum_in_arb(coefficients, *places):
    """Evaluate Chebyshev series at a place each."""
    found = np.vectorize(flint.arb, otypes=[object])(coefficients)
    for place in reversed(places):
        found = found @ np.array([place.chebyshev_t(power) for power in range(found.shape[-1])], dtype=object)
    return found.tolist()


@pytest.mark.slow
def test_the_defect_is_bounded_as_arb_finds_it_from_the_machines_text():
    found = crane()
    theorem, plant = found.theorem, found.theorem.spec.machine()
    coefficients = np.stack([one.coefficients() for one in found.motions])
    proof = theorem.enclosure(found.boxes, coefficients, found.scales)
    with np.errstate(all="ignore"):
        bound, axes = proof.defect()[0], theorem.axes
    low, high = (float(end.mid[0, 0]) for end in theorem.ranges.enclosed(found.boxes))
    powers = axes.coefficients().mid
    random, shares = np.random.default_rng(5), []
    with flint.ctx.workprec(1000):
        for piece in random.choice(len(bound), 12, replace=False):
            t, y = random.uniform(-1.0, 1.0, 2)
            c, half = coefficients[0, piece], 0.5 * float(np.diff(axes.knots)[piece])
            x = sum_in_arb(c, flint.arb(t), flint.arb(y))
            slope = sum_in_arb(series.chebder(c, axis=1), flint.arb(t), flint.arb(y))
            q_a = [flint.arb(float(np.polyval(powers[::-1, piece, 0], t)))]
            v = [flint.arb(float(np.polyval(np.polyder(powers[::-1, piece, 0]), t) / half))]
            rope = 0.5 * (low + high) + 0.5 * (high - low) * y
            p = SimpleNamespace(
                **{name: flint.arb(value) for name, value in theorem.spec.plant.parameters.items()}
            )
            p.L1 = flint.arb(rope)
            exact = rate_in_arb(plant, x, q_a, v, p)
            defect = [abs(float(dx / half - f)) for dx, f in zip(slope, exact, strict=True)]
            assert (np.array(defect) <= bound[piece]).all()
            shares.append(max(defect) / bound[piece].max())
    assert max(shares) > 1e-3  # neither is the bound an idle one


@cache
def joint(tau):
    """The flexible joint, whose equations are linear, behind drives with a lag or without."""
    lag = (f"actuator={{type='first-order', tau={tau}}}",) if tau else ()
    finer = ("robustness.uncertain={J=0.08}", "export.cycle_time=0.002", "limits.sway=1")
    spec, setpoints = planned("flexible-joint", *finer, *lag)
    return attempt(spec, setpoints)


@pytest.mark.slow
@pytest.mark.parametrize(("find", "tau"), [(crane, 0.0), (partial(joint, 0.03), 0.03)], ids=["crane", "lag"])
def test_the_axes_are_as_near_to_the_smooth_motion_as_is_said(find, tau):
    theorem = find().theorem
    gap, knots, setpoints = theorem.gap, theorem.axes.knots, theorem.setpoints
    smooth, start, last = theorem.axes.profile(), setpoints.position[0, 0], setpoints.times[-1]
    times = np.linspace(0.0, last, (len(setpoints.times) - 1) * 200 + 1)
    axis = np.interp(times, setpoints.times, setpoints.position[:, 0])
    if tau:  # which takes straight lines as they are
        from scipy.signal import lsim  # noqa: PLC0415  (half a second in each process that collects)

        axis = start + lsim(([1.0], [tau, 1.0]), axis - start, times)[1]
    for piece in np.flatnonzero(knots[1:] <= last)[::5]:
        first, end = (round(200 * knot / setpoints.cycle_time) for knot in knots[piece : piece + 2])
        t = times[first : end + 1]
        off = axis[first : end + 1] - smooth(t).position[:, 0]
        mean = np.trapezoid(off, t) / (t[-1] - t[0])
        integral = np.concatenate([[0.0], np.cumsum(0.5 * (off[1:] + off[:-1] - 2.0 * mean) * np.diff(t))])
        assert np.abs(off).max() <= gap.position[piece, 0] + 1e-13
        assert np.abs(np.diff(off) / np.diff(t)).max() <= gap.velocity[piece, 0] + 1e-8
        assert abs(mean) <= gap.mean[piece, 0] + 1e-11  # of the trapezoids
        assert np.abs(integral).max() <= gap.integral[piece, 0] + 1e-14
        rate, apart = np.diff(off) / np.diff(t), 0.5 * np.abs(off[1:] + off[:-1])
        both = np.stack([apart, np.abs(rate)])
        assert apart.mean() <= gap.mean_position[piece, 0] + 1e-13
        assert np.abs(integral).mean() <= gap.mean_integral[piece, 0] * (1.0 + 1e-6) + 1e-14
        assert (both @ both.T / len(rate) <= gap.mean_squares[piece] * (1.0 + 1e-6) + 1e-12).all()
    moving = gap.position[gap.position > 1e-12]
    assert moving.max() < 2e-5 * np.ptp(setpoints.position)
    assert gap.mean.max() < 1e-4 * moving.max()


@pytest.mark.slow
def test_rounding_to_coarse_counts_is_taken_as_it_is():
    """Setpoints leap by 33 µm: where only the greatest leap of a piece counted, there was no bound."""
    spec, setpoints = planned("paper", "check.uncertain={}")
    counts = np.round(3e4 * setpoints.position) / 3e4
    found = attempt(spec, attrs.evolve(setpoints, position=counts, resolution=np.array([1.0 / 3e4])))
    assert found.bounds.shape == (1, 2)
    assert (found.largest_met <= found.bounds[0]).all() and found.bounds.max() < 4e-4


@pytest.mark.slow
@pytest.mark.parametrize("tau", [0.0, 0.03])
def test_an_exact_solution_in_arb_is_below_the_bound_and_close(tau):
    """Of the flexible joint: between setpoints its arm swings freely, or as its lagging drive pulls."""
    found = joint(tau)
    spec, watch = found.theorem.spec, found.theorem.until - found.theorem.arrival
    inertias = np.linspace(*spec.checked_ranges()["J"], 25).tolist()
    machines = [{**spec.plant.parameters, "J": J} for J in inertias]
    sways = [exact_joint(found.theorem.setpoints, machine, tau, watch) for machine in machines]
    worst = np.max(sways, axis=0)  # after the move, and at any time
    assert found.fraction == 1.0
    assert (worst <= greatest(found)).all() and (greatest(found) <= CLOSE * worst).all()


def exact_joint(setpoints, p, tau, watch):
    """Greatest sway of the tip after the motion, and ever, by matrix exponentials.

    Of (angle, its rate, how far the drive is behind, slope of the setpoints). Without a lag the rate leaps.
    """
    lags, rate = (1, 1 / flint.arb(tau)) if tau else (0, 0)
    with flint.ctx.workprec(128):
        stiffness, damping = flint.arb(p["k"]) / p["J"], flint.arb(p["c"]) / p["J"]
        a = flint.arb_mat(
            [[0, 1, 0, 0], [-stiffness, -damping, rate * rate, rate], [0, 0, -rate, -lags], [0, 0, 0, 0]]
        )
        step, x, ever = (a * flint.arb(setpoints.cycle_time)).exp(), flint.arb_mat(4, 1), 0.0
        position = [flint.arb(float(value)) for value in setpoints.position[:, 0]]
        slopes = [(last - first) / setpoints.cycle_time for first, last in pairwise(position)]
        for slope in [*slopes, flint.arb(0)]:
            x[1, 0] += (1 - lags) * (slope - x[3, 0])
            x[3, 0] = slope
            ever = max(ever, abs(float(x[0, 0])))
            x = step * x
        x, step = (a * flint.arb(10 * tau)).exp() * x, (a * flint.arb(watch / 2000)).exp()
        seen = []
        for _ in range(400):  # a fifth of the time; it is damped
            seen.append(abs(float(x[0, 0])))
            x = step * x
    return p["R"] * max(seen), p["R"] * max(ever, *seen)


def behind_lags():
    lag = "actuator={type='first-order', tau=0.2}"
    return attempt(*planned("single-pendulum-crane", "export.cycle_time=0.01", lag))


@pytest.mark.slow
@pytest.mark.parametrize("find", [crane, behind_lags])
def test_no_machine_of_a_dense_grid_sways_more_and_the_worst_nearly_as_much(find):
    found = find()
    spec, setpoints = found.theorem.spec, found.theorem.setpoints
    grid = {name: np.linspace(*ends, 61) for name, ends in spec.checked_ranges().items()}
    worst = gp.residual_sways(spec, setpoints, grid).max(axis=0)
    assert found.fraction == 1.0
    assert (worst <= greatest(found)).all()
    assert (greatest(found) <= CLOSE * worst).all()


@pytest.mark.slow
def test_a_load_that_swings_in_two_directions_is_bounded_on_the_way_by_the_length_of_its_sway():
    spec, setpoints = planned("gantry-crane", "export.cycle_time=0.02", "limits.sway=1")
    found = attempt(spec, setpoints)
    responses = [
        gp.cosimulate(spec, setpoints, {"L": L}) for L in np.linspace(*spec.checked_ranges()["L"], 5)
    ]
    worst = max(np.hypot(*response.sway.T).max() for response in responses)
    assert found.fraction == 1.0 and len(found.theorem.limits) == 3
    assert worst <= greatest(found)[2] <= CLOSE * worst


@pytest.mark.slow
def test_several_parameters_make_one_box_together():
    spec, setpoints = planned(
        "single-pendulum-crane", "robustness.uncertain={L0=0.04, c=0.5}", "export.cycle_time=0.01"
    )
    found = attempt(spec, setpoints)
    grid = np.stack(
        np.meshgrid(*(np.linspace(*ends, 9) for ends in spec.checked_ranges().values())), -1
    ).reshape(-1, 2)
    worst = gp.residual_sways(spec, setpoints, {"L0": grid[:, 0], "c": grid[:, 1]}).max()
    # a bound is not narrowed further than to half a per cent of what is allowed
    nearly = CLOSE * worst + 5e-3 * spec.check.residual_sway["payload"]
    assert found.fraction == 1.0 and worst <= greatest(found)[0] <= nearly


@pytest.mark.slow
def test_how_many_processors_there_are_changes_nothing(monkeypatch):
    monkeypatch.setattr(theorem, "BATCH", 1)
    spec, setpoints = planned(
        "single-pendulum-crane", "robustness.uncertain={L0=0.4}", "export.cycle_time=0.02"
    )
    found = []
    for count in (1, 3):
        with on_processors(count):
            one = attempt(spec, setpoints)
        packed = [(motions.quanta, motions.packed) for motions in one.motions]
        found.append((one.boxes, packed, one.scales.tobytes(), one.bounds.tobytes()))
    assert len(found[0][0]) > 1 and found[0] == found[1]


@pytest.mark.slow
def test_what_interpolation_misses_over_a_wide_box_is_what_is_not_linear():
    """Bounds are close though the machines of the box differ by radians, where all counted they were not."""
    spec, setpoints = planned("double-pendulum-crane", "robustness.uncertain={L1=0.2, m2=0.25}")
    theorem, boxes = certify._prepared(spec, setpoints)
    (made,) = certify._integrated(theorem, boxes[:1])
    _, (proof,), met = certify._prove(theorem, np.zeros(2), made)
    assert (met <= proof.bound).all() and (proof.bound <= 1.03 * met).all()


@pytest.mark.slow
def test_a_loose_limit_leaves_the_smooth_motion_near_to_the_axes():
    """With 1 m, 3 micrometres off, boxes of heavy loads had no bound and were halved for twenty minutes."""
    allowed = ("robustness.uncertain={L1=0.4, m2=0.5}", "check.residual_sway=1")
    theorem, _ = certify._prepared(*planned("double-pendulum-crane", *allowed))
    assert theorem.gap.position.max() < 1e-6


@pytest.mark.slow
def test_parts_of_ranges_are_wide_where_phases_turn_little():
    spec, setpoints = planned("double-pendulum-crane", "robustness.uncertain={L1=0.4, m2=0.5}")
    theorem, boxes = certify._prepared(spec, setpoints)
    assert covers(boxes) and theorem.ranges.names == ("L1", "m2")
    lightest, heaviest = (
        [box[1][0] for box in boxes if box[1][1] == (end * (2 ** box[1][0] - 1))] for end in (0, 1)
    )
    assert min(lightest) > max(heaviest)  # the frequency changes more with a light load


@pytest.mark.slow
def test_three_parameters_of_two_pendulums_are_proved_together():
    """Whose determinant of inertia is a small difference; and no machine of a grid sways more."""
    ranges = "robustness.uncertain={L1=0.01, L2=0.01, m2=0.01}"
    spec, setpoints = planned("double-pendulum-crane", ranges, "export.cycle_time=0.004")
    found = attempt(spec, setpoints)
    shares = np.stack(np.meshgrid(*[np.linspace(0.0, 1.0, 2)] * 3), -1).reshape(-1, 3).T
    grid = {
        name: low + share * (high - low)
        for (name, (low, high)), share in zip(spec.checked_ranges().items(), shares, strict=True)
    }
    worst = gp.residual_sways(spec, setpoints, grid).max(axis=0)
    limits = np.array(list(spec.check.residual_sway.values()))
    assert found.fraction == 1.0
    assert (worst <= greatest(found)).all() and (greatest(found) <= CLOSE * worst + 5e-3 * limits).all()


@pytest.mark.slow
def test_a_limit_that_only_a_machine_between_breaks_is_never_proved():
    overrides = ("plant.L0=2", "plant.c=0", "move.start=[0,0]", "move.target=[3,0]", "move.duration=10")
    more = (
        "robustness={method='none', uncertain={L0=0.34}}",
        "cost.sway_weight=0",
        "export.cycle_time=0.005",
    )
    spec, setpoints = planned("single-pendulum-crane", *overrides, *more, "check.residual_sway=0.0245")
    found = attempt(spec, setpoints)
    ends = gp.residual_sways(spec, setpoints, {"L0": np.array([1.0 - 0.34, 1.0, 1.34]) * 2.0})
    assert ends.max() < 0.0245 < greatest(found)[0]


OWN = """
import attrs
import numpy as np

from gen_profile.plants.single_pendulum_crane import PLANT as known


def equations(q_u, dq_u, q_a, dq_a, p):
    terms = known.equations(q_u, dq_u, q_a, dq_a, p)
    return attrs.evolve(terms, G_u=[terms.G_u[0] - 0.001 * np.fabs(dq_u[0]) * dq_u[0]])


PLANT = attrs.evolve(known, type="air-drag", equations=equations)
"""


@pytest.mark.slow
def test_equations_with_a_kink_are_not_proved_and_not_tried_for_ever(tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    spec = tmp_path / "own.toml"
    spec.write_text(
        """name = "own"
plant = {file = "own.py", L0 = 3.0}
move = {target = [3.0, 0.0], duration = 9.0}
robustness = {uncertain = {L0 = 0.05}}
export = {cycle_time = 0.02}
"""
    )
    written = gp.design(gp.read_spec(spec), ["csv"], tmp_path / "out", check=False)
    proof = gp.certify_artefact(written.folder / written.artefacts[0].path)
    assert not proof.proved and proof.fraction == 0.0 and not proof.bounds
    assert proof.reasons()[0].startswith("No bound was found, not even of one machine in the middle")
    assert not list(written.folder.glob("*.certificate.json"))


@pytest.mark.slow
def test_a_hook_block_on_a_rope_that_is_hoisted_is_told_at_once_that_narrower_ranges_are_no_help():
    spec, setpoints = planned("hall-crane", "export.cycle_time=0.02")
    tried = []
    found = attempt(spec, setpoints, lambda done, _: tried.append(done))
    assert not found.reached and found.fraction == 0.0
    assert max(tried) <= 4  # boxes: none is halved without an end


def test_a_load_that_does_not_swing_has_no_tails():
    """As across the axis that moves."""
    with np.errstate(all="raise"):
        assert (_tails(np.zeros((2, 4, 5, 3)), (3,)) == 0.0).all()


@pytest.mark.slow
def test_a_motion_that_only_hoists_is_proved():
    spec, setpoints = planned("single-pendulum-crane", "move.target=[0.0, 1.0]", "export.cycle_time=0.01")
    found = attempt(spec, setpoints)
    assert found.fraction == 1.0
    assert greatest(found)[0] < 1e-12
