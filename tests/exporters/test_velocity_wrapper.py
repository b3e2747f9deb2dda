"""The playback block on frequency converters: velocity setpoints, under watch.

Converters lag and slip, and axes are where their velocities led them; the wrapper knows what is measured.
"""

import numpy as np
import pytest
from motions import quintic, target
from st_interpreter import FunctionBlock

from gen_profile.motion.profile import sample
from gen_profile_exporters.block_source import parse_function_block
from gen_profile_exporters.motion_libraries import VELOCITY
from gen_profile_exporters.playback.axis_wrapper import axis_wrapper
from gen_profile_exporters.playback.structured_text import block_text
from gen_profile_exporters.vendors import siemens_scl

CYCLE, LAG, SLIP = 0.02, 0.05, 0.03
ONE, TWO = quintic((0.1, 0.4)), quintic((0.1, 0.4), (1.2, 0.95))


class Converters:
    """Axes behind converters, played to."""

    def __init__(self, move):
        names = ("bridge", "trolley")[: move.axes]
        block = parse_function_block(block_text(move, target(*names, cycle_time=CYCLE)))
        self.wrapper = FunctionBlock(axis_wrapper(block, move.axes, VELOCITY).text(), (block.text(),))
        self.ends = [f"{n}" for n in range(1, move.axes + 1)] if move.axes > 1 else [""]
        self.place = [float(at) for at in move.start]
        self.speed = [0.0] * move.axes
        self.given = {"fCycleTime": CYCLE}
        for end in self.ends:
            self.given |= {f"fGain{end}": 2.0, f"fCorrection{end}": 0.1, f"fFollowingLimit{end}": 0.05}
            self.given |= {f"bRunning{end}": True}
        self.asked, self.places = [], []
        for _ in range(60):  # of the table's checksum
            self.cycle(bExecute=False)

    def cycle(self, **inputs):
        measured = {f"fActPosition{end}": at for end, at in zip(self.ends, self.place, strict=True)}
        outputs = self.wrapper.call(**self.given | measured | inputs)
        self.asked.append([outputs[f"fspeed{end}"] for end in self.ends])
        for axis, wanted in enumerate(self.asked[-1]):
            self.speed[axis] += ((1.0 - SLIP) * wanted - self.speed[axis]) * CYCLE / LAG
            self.place[axis] += CYCLE * self.speed[axis]
        self.places.append(list(self.place))
        return outputs

    def until(self, done, most=400, **inputs):
        for _ in range(most):
            if done(outputs := self.cycle(**inputs)):
                return outputs
        raise AssertionError(outputs)


@pytest.mark.parametrize("move", [ONE, TWO], ids=["one", "two"])
def test_axes_go_the_motion_s_way_and_stay(move):
    bench = Converters(move)
    begun = len(bench.asked)
    bench.until(lambda row: row["bdone"], bExecute=True)
    for _ in range(100):
        outputs = bench.cycle(bExecute=True)
    assert outputs["bdone"] and not outputs["berror"]
    np.testing.assert_allclose(bench.place, move.target, rtol=0, atol=1e-3)
    led = sample(move, CYCLE)
    first = begun + int(np.argmax(np.abs(np.array(bench.asked[begun:])).max(axis=1) > 0.0)) - 1
    way = np.array(bench.places[first : first + len(led.position)])
    behind = np.abs(led.velocity).max(axis=0) * (
        LAG + CYCLE
    )  # and what the slip adds, which the gain returns
    assert (np.abs(way - led.position).max(axis=0) < 1.5 * behind).all()


@pytest.mark.parametrize(
    ("mishap", "error"),
    [({"bDriveError": True}, 20), ({"bRunning": False}, 21), ({"fActPosition": 9.0}, 25)],
)
@pytest.mark.parametrize("move", [ONE, TWO], ids=["one", "two"])
def test_a_mishap_ends_the_motion(move, mishap, error):
    bench = Converters(move)
    for _ in range(25):
        assert not bench.cycle(bExecute=True)["berror"]
    assert all(abs(speed) > 0.05 for speed in bench.asked[-1])
    wrong = {f"{key}{bench.ends[-1]}": value for key, value in mishap.items()}
    outputs = bench.until(lambda row: not row["bbusy"], bExecute=True, **wrong)
    assert (outputs["berror"], outputs["nerrorid"]) == (True, error)
    assert bench.asked[-1] == [0.0] * move.axes
    kept = bench.asked[-40:] if error == 25 else [row[:-1] for row in bench.asked[-40:]]
    if kept[0]:  # what is still guided brakes on the path; what failed is let go
        steps = np.abs(np.diff(kept, axis=0)).max() / CYCLE
        assert steps < 3.0 * np.abs(sample(move, CYCLE).acceleration).max()
    assert bench.cycle(bExecute=True)["berror"]  # until another edge
    assert not bench.cycle(bExecute=False)["berror"]


@pytest.mark.parametrize("name", ["fGain", "fCorrection", "fFollowingLimit"])
def test_nothing_moves_without_a_position_control(name):
    bench = Converters(ONE)
    outputs = bench.until(lambda row: row["berror"], bExecute=True, **{name: 0.0})
    assert outputs["nerrorid"] == 22
    assert np.abs(bench.asked).max() == 0.0


def test_tia_portal_gets_it_in_a_file_of_its_own():
    files = {
        file.filename: file.content.decode() for file in siemens_scl.encode(ONE, target(cycle_time=CYCLE))
    }
    assert [*files] == ["bay-3.scl", "bay-3_velocity.scl", "bay-3_cam.scl"]
    assert 'FUNCTION_BLOCK "FB_bay_3_Velocity"' in files["bay-3_velocity.scl"]
    assert "S7_Optimized_Access := 'TRUE'" in files["bay-3_velocity.scl"]
    assert not {"MC_", "TO_"} & {word[:3] for word in files["bay-3_velocity.scl"].split()}


def test_a_block_and_its_wrapper_share_no_inputs_by_chance():
    block = parse_function_block(block_text(TWO, target("x", "y", cycle_time=CYCLE)))
    names = [v.name.lower() for v in axis_wrapper(block, 2, VELOCITY).variables]
    assert len({*names}) == len(names)
