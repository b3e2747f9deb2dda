"""The account of a rope that changes on the way, beside integrals of the machine written anew."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from gen_profile.planner.design import planner_constants
from gen_profile.planner.execution import BlockInstance
from gen_profile.spec.reading import preset_spec
from gen_profile_exporters.planner.blocks.followed import account_texts

LOAD = 1400.0
ORDERS = {
    "nOrder": "DINT", "fTaken": "LREAL", "nBefore": "DINT", "nSlots": "DINT", "nMet": "DINT", "nGap": "DINT",
    "fAfter": "LREAL", "fPart": "LREAL", "bRests": "BOOL", "fRope": "LREAL",
    "fSwing": "LREAL", "fSwingRate": "LREAL", "bTaken": "BOOL",
}  # fmt: skip
BUDGET = 9000
SENSOR = 'planner.sensor={quantity="angle", of="theta1", noise=0.002, offset=0.005, delay=[0.05, 0.15]}'
DISTURBANCE = "planner.disturbance={swing={payload=0.5}, settle=12.0}"


@pytest.fixture(scope="module")
def spec():
    return preset_spec("bay-crane", ["planner.live_rate={L1=0.3}", "check.uncertain={L1=0.01}"])


class Account:
    """The account called with orders."""

    def __init__(self, spec):
        _, self.constants = planner_constants(spec)
        text = account_texts(self.constants)
        slots = int(text.split("cSlots : DINT := ")[1].split(";")[0])
        self.slots, self.plan, self.rows, self.pairs = slots, 2 * slots + 4, 13, 6
        orders = "\n".join(f"{name} : {type_};" for name, type_ in ORDERS.items())
        handed = ", ".join(f"{name} := {name}" for name in ORDERS if name != "fRope")
        self.block = BlockInstance(f"""{text}
FUNCTION_BLOCK Called
VAR_INPUT {orders} gTrial : ARRAY [0..{self.plan - 1}] OF LREAL; END_VAR
VAR_OUTPUT
    bBusy : BOOL; fWorst : LREAL; fLeft : LREAL; fCalm : LREAL; nSpent : DINT; nSlot : DINT;
    aRadius : ARRAY [0..{self.pairs - 1}] OF LREAL; aValue : ARRAY [0..{self.rows - 1}] OF LREAL;
    aRow : ARRAY [0..{self.rows * slots - 1}] OF LREAL;
END_VAR
VAR
    account : bay_crane_account; i : DINT; aLive : ARRAY [0..1] OF LREAL;
    aTrial : ARRAY [0..{self.plan - 1}] OF LREAL;
END_VAR
FOR i := 0 TO {self.plan - 1} DO aTrial[i] := gTrial[i]; END_FOR;
aLive[0] := fRope;
aLive[1] := {LOAD!r};
account({handed}, nOperations := {BUDGET}, fUnit := 2.0,
    aLive := aLive, aTrial := aTrial, aRow := aRow, aValue := aValue, aRadius := aRadius);
bBusy := account.bBusy;
fWorst := account.fWorst;
fLeft := account.fLeft;
fCalm := account.fCalm;
nSpent := account.nSpent;
nSlot := account.nSlot;
END_FUNCTION_BLOCK
""")
        self.bound = np.tile(0.025 * np.array([0.8, 0.2]), 3)  # half of what is allowed
        self.rope = 6.0

    def call(self, order, trial=(), **given):
        given = {"fRope": self.rope} | given
        row = [order, *(given.get(name, 0.0) for name in list(ORDERS)[1:])]
        row = np.r_[row, trial, np.zeros(self.plan - len(trial))]
        for _ in range(500):
            busy, worst, left, calm, spent, self.cycles, *arrays = self.block.call(row[None])[0]
            assert spent <= BUDGET
            if not busy:
                radii, values, rows = np.split(np.array(arrays), [self.pairs, self.pairs + self.rows])
                return worst, left, calm, radii, values, rows.reshape(self.rows, self.slots)
        raise AssertionError("never done")

    def follow(self, accelerations, ropes):
        for acceleration, rope in zip(accelerations, ropes, strict=True):
            self.rope = rope
            self.call(14)
            self.call(21, fTaken=acceleration)


def stiffness(spec, rope, stretch=1.0):
    """Of sway against the axis, by the tensions of both ropes: hook, then load."""
    hook, sling = spec.plant.parameters["m1"], spec.plant.parameters["L2"]
    g = spec.plant.parameters["g"]
    upper, lower = (hook + LOAD) * g / rope, LOAD * g / sling
    matrix = np.array([[(upper + lower) / hook, -lower / hook], [-lower / LOAD, lower / LOAD]])
    return stretch**2 * matrix


def machine(spec, rope, stretch=1.0):
    """State matrix of sway and its rate, and what an acceleration does."""
    matrix = np.zeros((4, 4))
    matrix[:2, 2:], matrix[2:, :2] = np.eye(2), -stiffness(spec, rope, stretch)
    return matrix, np.array([0.0, 0.0, 1.0, 1.0])


def shown(spec, rope, state, stretch=1.0):
    """Of each mode, slow first, as much of the load's sway as it makes at most."""
    squares, shapes = np.linalg.eig(stiffness(spec, rope, stretch))
    order, inverse = np.argsort(squares), np.linalg.inv(shapes)
    sizes = []
    for mode in order:
        push = shapes[:, mode] * inverse[mode].sum()
        largest = np.abs(push).argmax()
        pair = shapes[largest, mode] * (inverse[mode] @ np.reshape(state, (2, 2)).T)
        sizes.append(np.hypot(pair[0], pair[1] / np.sqrt(squares[mode])))
    return np.array(sizes)


CYCLES = 68  # of a slot: a twentieth of the period at 6 m
SLOT = CYCLES * 0.004


def ahead(spec, state, coefficients, ropes, stretch=1.0):
    """State behind slots of constant ropes, by matrix exponentials: acceleration in lines between."""
    for j, rope in enumerate(ropes):
        matrix, push = machine(spec, rope, stretch)
        before, behind = np.diff(coefficients[j : j + 3]) / SLOT
        wide = np.zeros((6, 6))
        wide[:4, :4], wide[:4, 4], wide[4, 5] = matrix, push, 1.0
        start = np.r_[state, before, (behind - before) / SLOT]
        state = (expm(SLOT * wide) @ start)[:4]
    return state


@pytest.fixture
def account(spec):
    account = Account(spec)
    account.call(5)
    account.call(21)
    account.call(1)
    slow = np.sqrt(np.linalg.eigvals(stiffness(spec, 6.0)).min())
    assert account.cycles == CYCLES == round(2.0 * np.pi / slow / 20 / account.constants.cycle)
    return account


def stretches(account):
    error = account.constants.stated_error
    return 1.0, 1.0 - error, 1.0 + error


def hoisted(account, rate):
    """Follow a motion for three seconds while the rope changes; its accelerations and ropes."""
    cycle, draw = account.constants.cycle, np.random.default_rng(3)
    accelerations = np.interp(np.arange(750) * cycle, np.linspace(0, 3, 9), draw.uniform(-0.3, 0.3, 9))
    ropes = 6.0 + rate * np.arange(1, 751) * cycle
    account.follow(accelerations, ropes)
    return accelerations, ropes


def integrated(spec, account, accelerations, rope, gravity=lambda _t: 1.0):
    """States at the end, by stretch; rope and share of gravity are functions of time."""
    cycle = account.constants.cycle
    times, push = cycle * np.arange(len(accelerations) + 1), np.r_[0.0, accelerations]

    def rates(t, state, stretch):
        matrix, by = machine(spec, rope(t), stretch * np.sqrt(gravity(t)))
        return matrix @ state + by * np.interp(t, times, push)

    accurate = {"rtol": 1e-10, "atol": 1e-12, "max_step": cycle}
    return {
        stretch: solve_ivp(rates, (0.0, times[-1]), np.zeros(4), args=(stretch,), **accurate).y[:, -1]
        for stretch in stretches(account)
    }


def predicted(rope, rate, slots):
    """Ropes in the middles of each two slots, and behind all."""
    return np.clip(rope + rate * SLOT * np.r_[np.arange(slots) // 2 * 2 + 1.0, slots], 3.0, 9.0)


@pytest.mark.parametrize("rate", [0.0, 0.3, -0.3])
def test_what_swings_now_and_goes_on_is_that_of_an_integrator(spec, account, rate):
    accelerations, ropes = hoisted(account, rate)
    states = integrated(spec, account, accelerations, lambda t: 6.0 + rate * t)
    for _ in range(3):
        account.call(1)
    _, left, *_ = account.call(22)
    *between, last = predicted(ropes[-1], rate, 3)
    due = [
        shown(spec, last, ahead(spec, state, np.zeros(6), between, stretch), stretch).sum()
        for stretch, state in states.items()
    ]
    assert left == pytest.approx(max(due), rel=3e-3)


def test_a_hoist_that_stops_makes_the_load_swing_by_less_gravity(spec, account):
    cycle, begin, slows = account.constants.cycle, 3.0, 0.3
    accelerations = np.r_[np.full(500, 0.25), np.full(500, -0.25)]

    def rope(t):
        s = np.clip(t - begin, 0.0, slows)
        return 6.0 + 0.3 * np.minimum(t, begin) + 0.3 * s - 0.3 * s * s / slows / 2

    account.follow(accelerations, rope(cycle * np.arange(1, 1001)))
    g = spec.plant.parameters["g"]
    states = [
        integrated(spec, account, accelerations, rope, gravity)[1.0]
        for gravity in (
            lambda _t: 1.0,
            lambda t: 1.0 + (0.3 / slows / g if begin < t < begin + slows else 0.0),
        )
    ]
    account.call(1)
    *_, values, _rows = account.call(2, nSlots=3, nMet=2)
    ends = [shown(spec, rope(4.0), ahead(spec, state, np.zeros(8), 6 * [rope(4.0)])) for state in states]
    found = 2.0 * SLOT * np.hypot(*values[:2])
    by_weight = ends[1][0] - ends[0][0]  # of which the rate of a rope is measured late
    assert abs(found - ends[1][0]) < 0.3 * by_weight


@pytest.mark.parametrize("after", [0.0, 0.6])
def test_rows_give_what_a_row_of_coefficients_leaves_on_each_machine(spec, account, after):
    accelerations, ropes = hoisted(account, 0.3)
    states = integrated(spec, account, accelerations, lambda t: 6.0 + 0.3 * t)
    draw = np.random.default_rng(4)
    fixed, trial = draw.uniform(-1.0, 1.0, 3), draw.uniform(-1.0, 1.0, 17)
    for coefficient in fixed:
        account.call(1, fTaken=coefficient)
    _, _, _, radii, values, rows = account.call(
        2, trial, nBefore=5, nSlots=12, nMet=2, nGap=1, fAfter=after, fPart=0.7
    )
    *between, last = predicted(ropes[-1], 0.3, 20)
    all_ = np.r_[fixed, trial, after, after]
    for number, (stretch, state) in enumerate(states.items()):
        due = shown(spec, last, ahead(spec, state, all_, between, stretch), stretch)
        for mode in range(2):
            row = 2 * (2 * number + mode) + (number > 0)
            left = rows[row : row + 2, :12] @ trial[5:] - 2.0 * values[row : row + 2]
            assert SLOT * np.hypot(*left) == pytest.approx(due[mode], rel=5e-3, abs=1e-5)
    inner = 0.9 * np.cos(np.pi / 12) * 0.7 / SLOT / 2.0
    assert np.allclose(radii[:4], inner * account.bound[2:])


@pytest.mark.slow
def test_a_machine_with_a_sensor_is_followed_on_the_rope_that_it_has():
    changes = ["planner.live={L1=[3.0, 9.0], m2=[500.0, 2000.0]}", SENSOR, DISTURBANCE]
    spec = preset_spec("bay-crane", changes)
    account = Account(spec)
    account.call(5)
    account.call(23, bTaken=1.0, fPart=1.0, fSwing=0.2, fSwingRate=0.1)
    for coefficient in (0.1, -0.2, 0.3):
        account.call(1, fTaken=coefficient)
    _, left, *_ = account.call(22)
    squares, shapes = np.linalg.eig(stiffness(spec, 6.0))
    shape = shapes[:, squares.argmin()]
    state = np.outer([0.2, 0.1], shape / shape[np.abs(shape).argmax()]).ravel()
    due = [
        shown(spec, 6.0, ahead(spec, state, np.r_[0.1, -0.2, 0.3, 0.0, 0.0], 3 * [6.0], s), s).sum()
        for s in stretches(account)
    ]
    assert left == pytest.approx(max(due), rel=1e-4)


@pytest.mark.slow
def test_a_machine_between_both_ends_of_wide_errors_is_left_with_no_more_than_is_stated():
    """Of two pushes far apart, those halfway to an end are left with more than ends and that as given."""
    changes = ["planner.live={L1=[3.0, 9.0], m2=[500.0, 2000.0]}", SENSOR, DISTURBANCE]
    spec = preset_spec("bay-crane", [*changes, "check.uncertain={L1=0.2}"])
    account = Account(spec)
    account.call(5)
    account.call(1)
    machines = 1.0 + account.constants.stated_error * np.linspace(-1.0, 1.0, 41)

    trial = np.r_[0.02, np.zeros(95), -0.02]
    coefficients, ropes = np.r_[0.0, 0.0, 0.0, trial, 0.0, 0.0], (len(trial) + 3) * [6.0]
    left = [shown(spec, 6.0, ahead(spec, np.zeros(4), coefficients, ropes, s), s).sum() for s in machines]
    account.call(3, trial, nSlots=len(trial), fPart=1.0)
    account.call(4)
    account.call(6)
    assert max(left) > 1.1 * max(left[0], left[20], left[-1])
    assert account.call(22)[1] == pytest.approx(max(left), rel=0.03)


def test_plans_are_weighed_committed_foreseen_and_calm_or_not(spec, account):
    """Two slots pass, in which what was committed is executed, and nothing else is foreseen."""
    draw = np.random.default_rng(8)
    trial = 0.02 * draw.uniform(-1.0, 1.0, 14)
    due = [
        shown(spec, 6.0, ahead(spec, np.zeros(4), np.r_[0, 0, 0, trial, 0, 0], 17 * [6.0], s), s)
        for s in stretches(account)
    ]
    bounds = np.reshape(account.bound, np.shape(due)).sum(axis=1)  # a machine's modes are added
    left_on = np.sum(due, axis=1)
    assert account.call(3, trial, nSlots=14)[0] == pytest.approx(np.max(left_on / bounds), rel=1e-3)
    account.call(4)
    account.call(3, 0.1 * trial, nSlots=14)
    account.call(6)
    _, left, calm, *_ = account.call(22)
    assert left == pytest.approx(np.sum(due, axis=1).max(), rel=1e-3)
    allowed = np.array([0.25, 0.25, 1.25, 1.25, 1.25, 1.25]) * account.bound
    assert calm == pytest.approx(np.max(np.ravel(due) / allowed), rel=1e-3)
    assert account.call(22, bRests=1.0)[2] < calm
    # levels are what is left, where that is more
    levels = np.maximum(np.ravel(due), account.bound)
    most = np.max(2.0 * left_on / np.maximum(left_on, bounds))
    assert account.call(3, 2.0 * trial, nSlots=14)[0] == pytest.approx(most, rel=1e-3)
    bounds = account.call(2, nSlots=5, nMet=2, fPart=0.5)[3]
    parts = account.call(2, nSlots=5, nMet=0, fPart=0.5)[3]
    inner = 0.9 * np.cos(np.pi / 12) * 0.5 / SLOT / 2.0
    assert np.allclose(bounds[:4], inner * account.bound[2:])
    assert np.allclose(parts, inner * levels, rtol=1e-3)
    # as time passes all stays as foreseen
    knots = np.diff(np.r_[0.0, 0.0, 0.0, trial[:1]]) / SLOT
    for number, coefficient in enumerate(trial[:2]):
        account.call(1, fTaken=coefficient)
        first, last = np.diff(np.r_[0.0, 0.0, trial[:2]])[number : number + 2] / SLOT
        assert number or first == knots[0]
        account.follow(first + (last - first) * np.arange(1, CYCLES + 1) / CYCLES, np.full(CYCLES, 6.0))
    account.call(1, fTaken=trial[2])
    assert account.call(22)[1] == pytest.approx(left, rel=1e-3)
    # an inserted coefficient comes first, and what is mixed lies between
    account.call(7, fTaken=0.3)
    account.call(8, fPart=0.25)
    account.call(4)
    account.call(6)
    mixed = 0.25 * np.r_[0.3, trial[3:]] + 0.75 * np.r_[trial[3:], 0.0]
    coefficients = np.r_[0.0, 0.0, 0.0, trial[:3], mixed, 0.0, 0.0]
    due = [
        shown(spec, 6.0, ahead(spec, np.zeros(4), coefficients, 18 * [6.0], s), s).sum()
        for s in stretches(account)
    ]
    assert account.call(22)[1] == pytest.approx(max(due), rel=1e-3)


def test_noise_of_the_hoist_s_encoder_makes_little_of_the_state(spec):
    sways = []
    for noise in (0.0, 0.003):
        account = Account(spec)
        account.call(5)
        draw = np.random.default_rng(2)
        ropes = 6.0 + 0.0004 * np.arange(750) + noise * draw.standard_normal(750)
        account.follow(np.full(750, 0.2), ropes)
        account.call(1)
        sways.append(account.call(22)[1])
    assert sways[1] == pytest.approx(sways[0], rel=0.03)


def test_a_measured_mode_takes_the_place_of_what_the_axis_alone_caused(spec, account):
    """The fast one stays as it was, whatever the slow one is measured to be."""
    hoisted(account, 0.0)
    ends = []
    for swing, rate in ((None, None), (0.3, -0.1), (0.0, 0.0)):
        if swing is not None:
            account.call(23, bTaken=1.0, fPart=1.0, fSwing=swing, fSwingRate=rate)
        account.call(1)
        *_, values, _rows = account.call(2, nSlots=3, nMet=2)
        ends.append(2.0 * SLOT * np.hypot(values[0:4:2], values[1:4:2]))
    slow = np.sqrt(np.linalg.eigvals(stiffness(spec, 6.0)).min())
    before, measured, none = ends
    assert before.min() > 1e-3
    assert measured[0] == pytest.approx(np.hypot(0.3, 0.1 / slow), rel=1e-4)
    assert none[0] < 1e-9
    assert measured[1] == pytest.approx(before[1], rel=1e-6) == pytest.approx(none[1], rel=1e-6)
    for _ in range(2):
        account.call(23, bTaken=1.0, fPart=0.2, fSwing=0.3, fSwingRate=-0.1)
    account.call(1)
    assert account.call(22)[1] == pytest.approx((1.0 - 0.8**2) * np.hypot(0.3, 0.1 / slow), rel=0.1)
