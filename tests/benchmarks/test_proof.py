"""Cost of a planner block's proof, against the same cycles stepped by FMPy with the block called between."""

from time import process_time

import numpy as np

from gen_profile.assurance.proof.closed_loop import ClosedLoop
from gen_profile.assurance.proof.histories import Histories
from gen_profile.motion.profile import SampledProfile
from gen_profile.planner.design import planner_block
from gen_profile.spec.reading import preset_spec
from gen_profile_fmu.running.cosimulation import PlantCosimulation

HISTORIES = 20
MINUTE = 60_000  # cycles of 1 ms


def test_a_history(capsys):
    limits = ["velocity=1.0", "acceleration=0.3", "jerk=1.0", "travel=[0.0, 40.0]"]
    changes = [f"limits.{limit}" for limit in limits]
    spec = preset_spec("double-pendulum-crane", [*changes, "planner.live={L1=[3.0, 9.0]}"])
    text, histories = planner_block(spec).text, Histories.of(spec)
    drawn = [histories.history(choices) for choices in histories.drawn(HISTORIES, seed=0)]
    with ClosedLoop(spec, text, histories) as loop:
        began = process_time()
        cycles = sum(loop.run(history).cycles for history in drawn)
        ours = (process_time() - began) / cycles
        first = loop.run(drawn[0])
        traced = loop.run(drawn[0], rows=first.cycles).trace
        assert traced is not None
        place = np.append(drawn[0].places[0], traced[:, loop.outputs.index("fPosition")])
        with PlantCosimulation(spec.machine()) as fmu:
            began = process_time()
            setpoints = SampledProfile(cycle_time=loop.cycle, position=place[:, None])
            found = fmu.run(setpoints, drawn[0].parameters, max_step=loop.max_step, settle=0.0, by_fmpy=True)
            theirs = (process_time() - began) / first.cycles
    with capsys.disabled():
        print(
            f"\n{1e6 * ours:.3g} µs of processor a cycle, block and machine: {MINUTE * ours:.3g} s a minute; "
            f"FMPy takes {theirs / ours:.3g} times as long for the machine alone"
        )
    assert np.array_equal(found.sway[1:], traced[:, len(loop.outputs) :])
    assert theirs > 2.0 * ours
