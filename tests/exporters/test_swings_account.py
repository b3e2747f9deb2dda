"""Blocks that tell how a machine swings and what motions leave swinging, beside integrals by NumPy."""

import numpy as np
import pytest

from gen_profile.planner.design import planner_constants
from gen_profile.planner.execution import BlockInstance
from gen_profile.planner.machine import frequencies, left_by_errors, live_modes
from gen_profile.spec.reading import preset_spec
from gen_profile_exporters.planner.blocks.texts import Sizes, planner

SLOTS = 64  # of the longest programme
SIZES = Sizes(watched=(-1.0, -0.5, 0.5, 1.0), shown=(-1.0, 1.0))
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
    arrays = ("aTurnRe", "aTurnIm", "aFade", "aGain")
    own = "\n".join(f"{name} : ARRAY [0..{SWINGS - 1}] OF LREAL;" for name in arrays)
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
        issued = block.call(np.array([[rope, load, start] for start in [1.0] + SWINGS * [0.0]]))
        assert issued[-2, 0] == 1.0 and issued[-1, 0] == 0.0
        return int(issued[-1, 1]), *issued[-1, 2:].reshape(4, SWINGS)

    return given


@pytest.mark.parametrize(("rope", "load"), [(3.0, 0.0), (6.3, 1200.0), (9.0, 2000.0)])
def test_modes_are_those_of_the_linearised_machine(spec, modes, rope, load):
    fitted, live = live_modes(spec), spec.planner.live
    point = [(2.0 * v - sum(live[n])) / (live[n][1] - live[n][0]) for n, v in (("L1", rope), ("m2", load))]
    rates = np.sort(frequencies(fitted.interpolant(point)[:2]))
    decays = fitted.interpolant(point)[2:4]
    errors, sways = np.split(fitted.others(point), [2])
    assert np.all(fitted.others(point) > 0.999 * left_by_errors(spec, point))
    cycles, real, imaginary, fade, gain = modes(rope, load)
    slot = cycles * spec.export.cycle_time
    assert abs(slot * rates[0] * 20 / (2 * np.pi) - 1.0) < 0.03
    for machine, share in enumerate((0.0, *SIZES.watched)):
        omega = rates * (1.0 + share * errors)
        at = slice(2 * machine, 2 * machine + 2)
        assert np.allclose(real[at] + 1j * imaginary[at], np.exp(1j * omega * slot), rtol=0, atol=1e-9)
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


ORDERS = {"nOrder": "DINT", "fTaken": "LREAL", "nSlots": "DINT", "nMet": "DINT", "nGap": "DINT"}


@pytest.fixture(scope="module")
def account(spec):
    """An account of ten swings whose turns, fades and gains are given, called with an order and a plan."""
    arrays = {
        "aTurnRe": SWINGS,
        "aTurnIm": SWINGS,
        "aFade": SWINGS,
        "aGain": SWINGS,
        "aBound": SWINGS,
        "aPlan": SLOTS,
    }
    rows = 13 * SLOTS
    given = "\n".join(f"g{name} : ARRAY [0..{size - 1}] OF LREAL;" for name, size in arrays.items())
    own = "\n".join(f"{name} : ARRAY [0..{size - 1}] OF LREAL;" for name, size in arrays.items())
    copies = "\n".join(
        f"FOR i := 0 TO {size - 1} DO {name}[i] := g{name}[i]; END_FOR;" for name, size in arrays.items()
    )
    orders = "\n".join(f"{name} : {type_};" for name, type_ in ORDERS.items())
    handed = ", ".join(f"{name} := {name}" for name in (*ORDERS, *arrays, "aShown", "aRow", "aValue"))
    return BlockInstance(f"""{blocks_before_planner(spec)}
FUNCTION_BLOCK Called
VAR_INPUT {orders} {given} END_VAR
VAR_OUTPUT
    bBusy : BOOL; fWorst : LREAL; nSpent : DINT; aLevel : ARRAY [0..{SWINGS - 1}] OF LREAL;
    aValue : ARRAY [0..12] OF LREAL; aRow : ARRAY [0..{rows - 1}] OF LREAL;
END_VAR
VAR account : bay_crane_account; i : DINT; {own} aShown : ARRAY [0..5] OF DINT := [0, 1, 2, 3, 8, 9]; END_VAR
{copies}
account(nOperations := 700, fUnit := 2.0, {handed});
bBusy := account.bBusy;
fWorst := account.fWorst;
nSpent := account.nSpent;
FOR i := 0 TO {SWINGS - 1} DO aLevel[i] := account.aLevel[i]; END_FOR;
END_FUNCTION_BLOCK
""")


def test_the_account_sums_up_what_was_taken_and_what_is_planned(account):
    draw = np.random.default_rng(5)
    phases, fades = draw.uniform(0.1, 1.5, SWINGS), draw.uniform(0.98, 1.0, SWINGS)
    gains, bounds = draw.uniform(0.5, 2.0, SWINGS), draw.uniform(0.1, 0.3, SWINGS)
    machine = np.concatenate([np.cos(phases), np.sin(phases), fades, gains, bounds])

    def call(order, taken=0.0, slots=0, plan=()):
        places = np.r_[np.cumsum(plan), np.zeros(SLOTS - len(plan))]
        row = np.r_[order, taken, slots, 2, 1, machine, places]
        for _ in range(100):
            found = account.call(row[None])[0]
            assert found[2] <= 700
            if not found[0]:
                return found
        raise AssertionError("never done")

    taken = draw.uniform(-1, 1, 300)
    call(5)
    for coefficient in taken:
        call(1, taken=coefficient)
    t = len(taken)
    units = np.exp(1j * np.outer(phases, np.arange(1, t + 21)))
    ages = t - np.arange(1, t + 1)
    past = (units[:, :t] * fades[:, None] ** ages) @ taken
    found = call(2, slots=20)
    rows, values = found[3 + SWINGS + 13 :].reshape(13, SLOTS)[:, :20], found[3 + SWINGS : 3 + SWINGS + 13]
    shown, at = [0, 1, 2, 3, 8, 9], [0, 2, 5, 7, 9, 11]  # a row is left out behind the first two
    ahead = units[:, t:] / fades[:, None] ** np.arange(1, 21)
    for swing, row in zip(shown, at, strict=True):
        assert np.allclose(rows[row] + 1j * rows[row + 1], ahead[swing], rtol=0, atol=1e-11)
        assert values[row] + 1j * values[row + 1] == pytest.approx(-past[swing] / 2.0, abs=1e-11)
    assert np.allclose(found[3 : 3 + SWINGS], bounds / gains / 2.0)
    plan = draw.uniform(-0.5, 0.5, 20)
    ends = np.abs(past + ahead @ (2.0 * plan))
    worst = call(3, slots=20, plan=plan)[1]
    assert worst == pytest.approx(np.max(ends * gains / bounds), rel=1e-11)
    call(4)
    call(3, slots=20, plan=0.1 * plan)  # another one that is weighed changes nothing
    call(6)
    assert np.allclose(call(2, slots=20)[3 : 3 + SWINGS], np.maximum(ends, bounds / gains) / 2.0)
    call(1, taken=2.0 * plan[0])  # what is committed stays as it is, but that it fades
    assert np.allclose(call(2, slots=20)[3 : 3 + SWINGS], np.maximum(fades * ends, bounds / gains) / 2.0)
    assert call(3, slots=19, plan=plan[1:])[1] == pytest.approx(
        np.max(fades * ends / np.maximum(fades * ends, bounds / gains)), rel=1e-10
    )
