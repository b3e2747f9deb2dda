"""Blocks that tell how a machine swings and what motions leave swinging, beside integrals by NumPy."""

import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gen_profile.planner.design import planner_constants
from gen_profile.planner.execution import BlockInstance
from gen_profile.planner.machine import frequencies, left_by_errors, live_modes
from gen_profile.spec.reading import preset_spec
from gen_profile_exporters.planner.blocks.sizes import Sizes
from gen_profile_exporters.planner.blocks.texts import planner
from gen_profile_exporters.playback.structured_text import literal

SLOTS = 64  # of the longest programme
SIZES = Sizes(watched=(-1.0, -0.5, 0.5, 1.0))
SWINGS = 10


def blocks_before_planner(spec):
    text = planner(planner_constants(spec)[1], SIZES)
    return text[: text.index("FUNCTION_BLOCK bay_crane_planner")]


@pytest.fixture(scope="module")
def spec():
    return preset_spec("bay-crane", [])


@pytest.fixture(scope="module")
def modes(spec):
    """What the block of modes gives at live parameters: cycles of a slot, and turns, fades and gains."""
    arrays = ("aTurnRe", "aTurnIm", "aFade", "aGain", "aTickRe", "aTickIm")
    own = "\n".join(f"{name} : ARRAY [0..{SWINGS}] OF LREAL;" for name in arrays)
    block = BlockInstance(f"""{blocks_before_planner(spec)}
FUNCTION_BLOCK Called
VAR_INPUT fL1 : LREAL; fm2 : LREAL; bStart : BOOL; END_VAR
VAR_OUTPUT bBusy : BOOL; nSlot : DINT; {own} END_VAR
VAR modes : bay_crane_modes; aLive : ARRAY [0..1] OF LREAL; END_VAR
aLive[0] := fL1;
aLive[1] := fm2;
modes(bStart := bStart, aLive := aLive, {", ".join(f"{name} := {name}" for name in arrays)});
bBusy := modes.bBusy;
nSlot := modes.nSlot;
END_FUNCTION_BLOCK
""")

    def given(rope, load):
        issued = block.call(np.array([[rope, load, start] for start in [1.0] + (SWINGS + 1) * [0.0]]))
        assert issued[-2, 0] == 1.0 and issued[-1, 0] == 0.0
        arrays = issued[-1, 2:].reshape(6, SWINGS + 1)
        assert (
            arrays[:, -1] == arrays[:, 0]
        ).all()  # for what great swings add, that of the machine as given
        return int(issued[-1, 1]), *arrays[:, :-1]

    return given


@pytest.mark.parametrize(("rope", "load"), [(3.0, 0.0), (6.3, 1200.0), (9.0, 2000.0)])
def test_modes_are_those_of_the_linearised_machine(spec, modes, rope, load):
    fitted, live = live_modes(spec), spec.planner.live
    point = [(2.0 * v - sum(live[n])) / (live[n][1] - live[n][0]) for n, v in (("L1", rope), ("m2", load))]
    rates = np.sort(frequencies(fitted.interpolant(point)[:2]))
    decays = fitted.interpolant(point)[2:4]
    errors, sways = np.split(fitted.others(point), [2])
    assert np.all(fitted.others(point) > 0.999 * left_by_errors(spec, point))
    cycles, real, imaginary, fade, gain, tick_real, tick_imaginary = modes(rope, load)
    slot = cycles * spec.export.cycle_time
    assert abs(slot * rates[0] * 20 / (2 * np.pi) - 1.0) < 0.03
    for machine, share in enumerate((0.0, *SIZES.watched)):
        omega = rates * (1.0 + share * errors)
        at = slice(2 * machine, 2 * machine + 2)
        assert np.allclose(real[at] + 1j * imaginary[at], np.exp(1j * omega * slot), rtol=0, atol=1e-9)
        tick = tick_real[at] + 1j * tick_imaginary[at]
        assert np.allclose(tick, np.exp(1j * omega * spec.export.cycle_time), rtol=0, atol=1e-12)
        assert np.allclose(fade[at], np.exp(-decays * slot), rtol=0, atol=1e-9)
        # the sway of one coefficient by an integral over its spline
        at_times = (np.arange(3000) + 0.5) / 1000.0
        spline = np.where(
            at_times < 1,
            at_times**2 / 2,
            np.where(at_times < 2, 0.75 - (at_times - 1.5) ** 2, (3 - at_times) ** 2 / 2),
        )
        for mode in range(2):
            wave = np.sum(spline * np.exp(1j * omega[mode] * slot * at_times)) / 1000.0 * slot
            assert gain[2 * machine + mode] == pytest.approx(sways[mode] * abs(wave), rel=1e-5)


ORDERS = {
    "nOrder": "DINT", "fTaken": "LREAL", "nBefore": "DINT", "nSlots": "DINT", "nMet": "DINT", "nGap": "DINT",
    "fAfter": "LREAL", "fPart": "LREAL", "bAnySlot": "BOOL", "bQuiet": "BOOL",
}  # fmt: skip
ROWS, PLAN = 13, 2 * SLOTS + 4
TAKEN = ("aTurnRe", "aTurnIm", "aTickRe", "aTickIm", "aFade", "aGain")


def knowing(text, machine, cycles, slot):
    """Put a machine that is given in place of the block of modes."""
    arrays = dict(zip(TAKEN, machine, strict=True))
    own = "".join(f"{name} : ARRAY [0..{SWINGS}] OF LREAL; " for name in TAKEN)
    known = "".join(
        f"c{n} : ARRAY [0..{SWINGS}] OF LREAL := [{', '.join(map(literal, [*map(float, v), float(v[0])]))}]; "
        for n, v in arrays.items()
    )
    copied = "".join(f"{name}[i] := c{name}[i]; " for name in TAKEN)
    stand_in = f"""FUNCTION_BLOCK bay_crane_modes
VAR_INPUT bStart : BOOL; nAxis : DINT; END_VAR
VAR_IN_OUT aLive : ARRAY [0..1] OF LREAL; {own} END_VAR
VAR_OUTPUT bBusy : BOOL; nSlot : DINT; fSlot : LREAL; nSpent : DINT; END_VAR
VAR i : DINT; END_VAR
VAR CONSTANT {known} END_VAR
FOR i := 0 TO {SWINGS} DO {copied} END_FOR;
nSlot := {cycles};
fSlot := {slot};
bBusy := bStart;
END_FUNCTION_BLOCK
"""
    begin, end = text.index("(* How the machine swings"), text.index("(* The account")
    return text[:begin] + stand_in + text[end:]


class Account:
    """An account of ten swings of a machine that is given, called with an order and a trial.

    Where a slot is given, in s, swings may be great.
    """

    def __init__(self, spec, machine, cycles, slot=None):
        text = knowing(blocks_before_planner(spec), machine, cycles, slot or 1.0)
        if slot is None:
            text, count = re.subn(r"(cTilt : LREAL := )[^;]*", r"\g<1>1.0E-9", text)
            assert count == 1
        orders = "\n".join(f"{name} : {type_};" for name, type_ in ORDERS.items())
        handed = ", ".join(
            f"{name} := {name}" for name in (*ORDERS, "aLive", "aTrial", "aRow", "aValue", "aRadius")
        )
        self.block = BlockInstance(f"""{text}
FUNCTION_BLOCK Called
VAR_INPUT {orders} gTrial : ARRAY [0..{PLAN - 1}] OF LREAL; END_VAR
VAR_OUTPUT
    bBusy : BOOL; fWorst : LREAL; fLeft : LREAL; nSpent : DINT;
    aRadius : ARRAY [0..5] OF LREAL; aValue : ARRAY [0..{ROWS - 1}] OF LREAL;
    aRow : ARRAY [0..{ROWS * SLOTS - 1}] OF LREAL;
END_VAR
VAR
    account : bay_crane_account; i : DINT;
    aLive : ARRAY [0..1] OF LREAL; aTrial : ARRAY [0..{PLAN - 1}] OF LREAL;
END_VAR
FOR i := 0 TO {PLAN - 1} DO aTrial[i] := gTrial[i]; END_FOR;
account(nOperations := 1500, fUnit := 2.0, {handed});
bBusy := account.bBusy;
fWorst := account.fWorst;
fLeft := account.fLeft;
nSpent := account.nSpent;
END_FUNCTION_BLOCK
""")

    def call(self, order, trial=(), **given):
        """Worst share, what is left, radii, values and rows, when it is done."""
        orders = [order, *(given.get(name, 0.0) for name in list(ORDERS)[1:])]
        row = np.r_[orders, trial, np.zeros(PLAN - len(trial))]
        for _ in range(100):
            busy, worst, left, spent, *arrays = self.block.call(row[None])[0]
            assert spent <= (1500 if order in (2, 3) else 150 * SWINGS)
            if not busy:
                radii, values, rows = np.split(np.array(arrays), [6, 6 + ROWS])
                return worst, left, radii, values, rows.reshape(ROWS, SLOTS)
        raise AssertionError("never done")


@pytest.fixture(scope="module")
def swings(spec):
    """Turns in a slot, cycles of a slot, fades, gains, bounds and that of the modes' sum."""
    draw = np.random.default_rng(5)
    phases, fades = draw.uniform(0.1, 1.5, SWINGS), draw.uniform(0.98, 1.0, SWINGS)
    (stated,) = re.findall(r"cBound : [^[]*\[[^]]*\] OF LREAL := \[([^]]*)\]", blocks_before_planner(spec))
    bounds = np.tile([float(v) for v in stated.split(",")], SWINGS // 2)
    (most,) = re.findall(r"cMost : LREAL := ([^;]*);", blocks_before_planner(spec))
    return phases, 10, fades, draw.uniform(0.5, 2.0, SWINGS), bounds, float(most)


@pytest.fixture
def account(spec, swings):
    phases, cycles, fades, gains, *_ = swings
    waves = [f(part * phases) for part in (1.0, 1.0 / cycles) for f in (np.cos, np.sin)]
    known = Account(spec, [*waves, fades, gains], cycles)
    known.call(11)
    return known


def test_the_account_sums_up_what_was_taken_and_what_is_planned(account, swings):
    phases, _, fades, gains, bounds, most = swings
    draw = np.random.default_rng(6)
    taken = draw.uniform(-1, 1, 300)
    account.call(5)
    for coefficient in taken:
        account.call(1, fTaken=coefficient)
    t = len(taken)
    units = np.exp(1j * np.outer(phases, np.arange(1, t + 61)))
    past = (units[:, :t] * fades[:, None] ** (t - np.arange(1, t + 1))) @ taken
    ahead = units[:, t:] / fades[:, None] ** np.arange(1, 61)
    # rows behind five coefficients of a trial
    trial = draw.uniform(-1.0, 1.0, 25)
    _, _, radii, values, rows = account.call(2, trial, nBefore=5, nSlots=20, nMet=2, nGap=1, fPart=0.7)
    shown, at = [0, 1, 2, 3, 8, 9], [0, 2, 5, 7, 9, 11]  # a row is left out behind the first two
    for swing, row in zip(shown, at, strict=True):
        assert np.allclose(rows[row, :20] + 1j * rows[row + 1, :20], ahead[swing, 5:25], rtol=0, atol=1e-11)
        known = past[swing] + ahead[swing, :5] @ trial[:5]
        assert values[row] + 1j * values[row + 1] == pytest.approx(-known / 2.0, abs=1e-11)
    levels = bounds / gains
    *_, alone, quiet = account.call(2, trial, nBefore=5, nSlots=20, nMet=2, nGap=1, fPart=0.7, bQuiet=1.0)
    assert np.array_equal(quiet, rows)
    for swing, row in zip(shown, at, strict=True):  # what the trial adds to what has swung
        own = ahead[swing, :5] @ trial[:5]
        assert alone[row] + 1j * alone[row + 1] == pytest.approx(-own / 2.0, abs=1e-11)
    assert np.allclose(radii[:4], 0.7 * np.cos(np.pi / 12) * levels[[2, 3, 8, 9]] / 2.0)
    # plans: weighed, another one that is weighed changes nothing, committed, and what is taken of it
    sums = past + ahead[:, :25] @ trial
    assert account.call(3, trial, nSlots=25)[0] == pytest.approx(_most(gains, sums) / most, rel=1e-10)
    account.call(4)
    account.call(3, 0.1 * trial, nSlots=25)
    account.call(6)
    for number in range(3):
        left = account.call(1, fTaken=trial[number])[1]
        assert left == pytest.approx(_most(gains, fades ** (number + 1) * sums), rel=1e-10)
    # a coefficient more before what is committed: all that is to come turns by a slot
    known = past * fades**3 + (units[:, t : t + 3] * fades[:, None] ** np.arange(2, -1, -1)) @ trial[:3]
    ahead = units[:, t + 3 :] / fades[:, None] ** np.arange(1, 58)
    more = known + ahead[:, :23] @ np.r_[0.4, trial[3:]]
    most = max(most, _most(gains, fades**3 * sums)) + 0.05 * most  # which swings may turn by until it begins
    account.call(7, fTaken=0.4)
    account.call(4)
    assert account.call(12)[0] == pytest.approx(_most(gains, more) / most, rel=1e-10)
    half = 0.5 * more + 0.5 * fades**3 * sums
    account.call(8, fPart=0.5)
    account.call(4)
    assert account.call(12)[0] == pytest.approx(_most(gains, half) / most, rel=1e-10)


@pytest.mark.parametrize(("speed", "within"), [(0.4, 0.03), (0.8, 0.05), (0.2, 0.05)])
def test_what_great_swings_add_is_that_of_a_pendulum(spec, speed, within):
    """Reversals in time with the swing, beside the nonlinear equation."""
    length, cycles = 3.0, 10
    rate = np.sqrt(9.81 / length)
    slot = 2.0 * np.pi / rate / 20.0
    rhythm = speed * np.sign(np.sin(np.pi * (np.arange(200) + 0.5) / 14.0))
    taken = np.r_[np.convolve(rhythm, np.ones(6) / 6.0), 0.0, 0.0]
    gain = slot * (np.sin(np.pi / 20.0) / (np.pi / 20.0)) ** 3
    waves = [np.full(SWINGS, f(part * rate * slot)) for part in (1.0, 1.0 / cycles) for f in (np.cos, np.sin)]
    gains = np.tile([gain, 1e-9], SWINGS // 2)
    account = Account(spec, [*waves, np.ones(SWINGS), gains], cycles, slot)
    account.call(11)
    account.call(5)
    for coefficient in taken:
        _, left, *_ = account.call(1, fTaken=coefficient)

    def apart(great):
        knots = np.r_[0.0, 0.0, taken, 0.0, 0.0]

        def slope(time, state):
            k = min(int(time / slot), len(taken) + 1)
            p = time / slot - k
            push = ((1.0 - p) * (knots[k + 1] - knots[k]) + p * (knots[k + 2] - knots[k + 1])) / slot
            back, share = (np.sin(state[0]), np.cos(state[0])) if great else (state[0], 1.0)
            return [state[1], -(9.81 * back + push * share) / length]

        end = (len(taken) + 1) * slot
        found = solve_ivp(slope, (0.0, end), [0.0, 0.0], rtol=1e-9, atol=1e-11, max_step=slot / 2.0).y[:, -1]
        return length * (found[0] + 1j * found[1] / rate)

    swings, linear = apart(True), apart(False)
    assert left == pytest.approx(abs(swings - linear), rel=within)  # all that was taken was committed


def _most(gains, sums):
    """Sway of both modes, each on the machine that is left with the most of it."""
    return (gains * np.abs(sums)).reshape(-1, 2).max(axis=0).sum()


def test_behind_a_ramp_values_tell_what_swings_about_the_steady_motion(account, swings):
    phases, _, fades, *_ = swings
    trial = np.random.default_rng(7).uniform(-1.0, 1.0, 12)
    account.call(5)
    account.call(1)
    _, _, _, values, rows = account.call(2, nSlots=12, nMet=2, nGap=1, fAfter=0.8, fPart=1.0)
    swing, row = 3, 7
    left = (rows[row, :12] + 1j * rows[row + 1, :12]) @ trial - 2.0 * (values[row] + 1j * values[row + 1])
    # kept for 4000 slots at 0.8: the swing is what differs from the steady motion
    many = np.r_[trial, np.full(4000, 0.8)]
    turn = np.exp(1j * phases[swing])
    state, states = 0.0, []
    for coefficient in many:  # in the frame that stands
        state = fades[swing] / turn * state + coefficient
        states.append(state)
    steady = 0.8 / (1.0 - fades[swing] / turn)
    swung = (states[30] - steady) * (turn / fades[swing]) ** 31 * turn  # turned back to the beginning
    assert left == pytest.approx(swung, rel=1e-6)


def test_a_decline_in_any_slot_keeps_what_the_motion_before_it_leaves(account, swings):
    """However long the steady speed is kept, rows and radii bound what both leave."""
    phases, _, fades, gains, bounds, most = swings
    draw = np.random.default_rng(8)
    trial = 4e-5 * draw.uniform(-1.0, 1.0, 6)
    account.call(5)
    account.call(1)
    _, _, radii, values, rows = account.call(
        2, trial, nBefore=6, nSlots=9, fAfter=6e-5, fPart=1.0, bAnySlot=1.0
    )
    assert np.all(radii > 0.0)
    decline = 6e-5 * draw.uniform(0.0, 1.0, 9)
    for item, swing in enumerate((0, 1, 2, 3, 8, 9)):
        turn = np.exp(1j * phases[swing]) / fades[swing]
        own = (rows[2 * item, :9] + 1j * rows[2 * item + 1, :9]) @ decline
        own -= 2.0 * (values[2 * item] + 1j * values[2 * item + 1])
        kept = bounds[swing] / gains[swing] - 2.0 * radii[item] / np.cos(
            np.pi / 12
        )  # what turns with no slot
        for slots in (0, 7, 40):
            whole = np.r_[trial, np.full(slots, 6e-5), decline]
            end = np.exp(1j * phases[swing]) * np.sum(whole * turn ** np.arange(1, len(whole) + 1))
            assert end == pytest.approx(
                kept_at(account, swing, trial, 6e-5, swings) + own * turn**slots, rel=1e-9
            )
        assert abs(kept_at(account, swing, trial, 6e-5, swings)) == pytest.approx(kept, rel=1e-9)
    # weighed are both moduli, on all swings
    worst = account.call(3, np.r_[trial, decline], nBefore=6, nSlots=15, fAfter=6e-5, bAnySlot=1.0)[0]
    turns = np.exp(1j * phases) / fades
    ramp = turns[:, None] ** np.arange(1, 7) @ trial + 6e-5 * turns**7 / (1.0 - turns)
    whole = turns[:, None] ** np.arange(1, 16) @ np.r_[trial, decline]
    both = np.abs(ramp) + np.abs(whole - ramp)
    assert worst == pytest.approx(_most(gains, both) / most, rel=1e-9)


def kept_at(account, swing, trial, speed, swings):
    """What swings about a steady speed behind a trial, from the values of its rows."""
    row = 2 * (0, 1, 2, 3, 8, 9).index(swing)
    _, _, _, values, rows = account.call(2, nSlots=len(trial), fAfter=speed, fPart=1.0)
    left = (rows[row, : len(trial)] + 1j * rows[row + 1, : len(trial)]) @ trial
    return left - 2.0 * (values[row] + 1j * values[row + 1])


def test_an_axis_that_stands_begins_in_any_cycle(account, swings):
    """The same sums as if slots had been shorter until then: a plan is weighed as swings are then."""
    phases, cycles, fades, gains, _, most = swings
    most *= 1.05  # quiet motions may add so much
    share = 1.0 / cycles
    first, plan = np.array([0.6, -0.2, 0.5]), np.array([0.3, 0.9, -0.4, 0.1])
    account.call(5)
    for coefficient in (*first, 0.0):
        account.call(1, fTaken=coefficient)
    account.call(10)
    account.call(3, plan, nSlots=4)
    account.call(4)
    for _ in range(7):
        account.call(9)
    worst = account.call(12)[0]
    units = np.exp(1j * np.outer(phases, np.r_[1.0, 2.0, 3.0, 4.0 + 7 * share + np.arange(4)]))
    past = (units[:, :3] * fades[:, None] ** np.r_[3.0, 2.0, 1.0]) @ first
    ends = (
        past * (1.0 - (1.0 - fades) * share) ** 7 + (units[:, 3:] / fades[:, None] ** np.arange(1, 5)) @ plan
    )
    assert worst == pytest.approx(_most(gains, ends) / most, rel=1e-6)
    account.call(13, nSlots=23)  # as many cycles at once, and back again
    later = account.call(12)[0]
    account.call(13, nSlots=-23)
    assert account.call(12)[0] == pytest.approx(worst, rel=1e-9)
    for _ in range(23):
        account.call(9)
    assert account.call(12)[0] == pytest.approx(later, rel=1e-9)
    account.call(11)
    alone = (units[:, 3:] / fades[:, None] ** np.arange(1, 5)) @ plan
    assert account.call(12)[0] == pytest.approx(_most(gains, alone) / most, rel=1e-6)
