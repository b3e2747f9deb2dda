"""Machines that planner blocks are proved for, histories beside the drawn ones, and a double pendulum."""

from math import inf, sin

import attrs
import numpy as np

from gen_profile.assurance.proof.habits import Change
from gen_profile.assurance.proof.histories import Histories, History
from gen_profile.assurance.proof.numbering import Numbering
from gen_profile.planner.commands import Command
from gen_profile.planner.stated import LEAST_RATE

G = 9.81
CYCLE = 0.004
BAY = f"""
name = "bay 3"
plant = {{ type = "double-pendulum-crane", m1 = 350.0, m2 = 2000.0, L1 = 6.0, L2 = 1.5 }}
move = {{ distance = 8.0, duration = 14.0 }}
limits = {{ velocity = 1.0, acceleration = 0.3, jerk = 1.0, travel = [0.0, 40.0] }}
planner = {{ live = {{ L1 = [3.0, 9.0], m2 = [0.0, 2000.0] }} }}
robustness = {{ uncertain = {{ L1 = 0.05 }} }}
check = {{ residual_sway = 0.05 }}
export = {{ cycle_time = {CYCLE} }}
"""


PAPER = """
name = "paper"
plant = { type = "double-pendulum-crane", m1 = 0.192, m2 = 0.203, L1 = 0.47, L2 = 0.391 }
move = { distance = 0.3, duration = 3.0 }
limits = { velocity = 0.3, acceleration = 0.7, jerk = 20.0, travel = [0.0, 2.0] }
planner = { live = { L1 = [0.3, 0.6] } }
robustness = { uncertain = { L1 = 0.03 } }
check = { residual_sway = 0.003 }
export = { cycle_time = 0.001 }
"""
HOIST = """
name = "hoist"
plant = { type = "single-pendulum-crane" }
move = { distance = [1.0, 0.0], duration = 8.0 }
limits = { velocity = 0.5, acceleration = 0.3, jerk = 2.0, travel = [0.0, 6.0] }
planner = { live = { hoist = [0.0, 2.0] } }
robustness = { uncertain = {} }
check = { residual_sway = 0.01 }
export = { cycle_time = 0.004 }
"""
GANTRY = """
name = "gantry"
plant = { type = "gantry-crane", m = 1000.0, L = 5.0 }
move = { distance = [8.0, 3.0], duration = 14.0 }
planner = { live = { L = [3.0, 9.0] } }
robustness = { uncertain = { L = 0.02 } }
check = { residual_sway = 0.05 }
export = { cycle_time = 0.001 }
[limits.axis]
x = { velocity = 1.0, acceleration = 0.3, jerk = 1.0, travel = [0.0, 40.0] }
y = { velocity = 0.5, acceleration = 0.4, jerk = 1.0, travel = [0.0, 12.0] }
"""
FORMER = {  # of each of `mutants.MACHINES`: how many histories are drawn, seed, number
    "zones": [
        (300, 34, 9),  # error 8, as an axis came out of a blocked interval and went on
        (400, 1, 51),  # a stick followed 9 s too late: the first pulse after its plan was lost
        (400, 5, 58),  # a stick that exceeded a slow interval by 0.115 m/s
        (400, 12, 233),  # a pulse beyond the ends that were stated meanwhile, by 0.5 mm
        (400, 12, 237),  # error 8, where a plan began beside a blocked interval
        (400, 7, 167),  # 19 mm beyond the stated ends of a stop
        (300, 12, 23),  # judged by the rope of its beginning, while it planned for another one
        (200, 2, 183),  # no fault: an axis comes out of a blocked interval
        (200, 2, 134),  # a stop 0.1 s late, sought along the motion of an axis that turns round
        (300, 144, 153),  # no fault: another rope was given in the first cycle, so the first one never was
        (200, 4, 4),  # no fault: judged by the time that it was in a slow interval, too
        (
            1000,
            7001,
            490,
        ),  # no fault: a slow interval's limit holds three slots before it, where the target was
        (100, 1, 81),  # 0.6 m beyond the stated ends, of an axis whose stick was at 0 beside another's
    ],
    "slow": [
        (100, 3, 45),  # 25 s against its stick, as pulses alone turned it round
        (300, 8, 58),  # 15 cm beyond the stated ends, as a pulse was weighed where the override became 0
        (300, 5, 39),  # fTimeToGo half of what it took pulses to turn round
        (225, 5, 64),  # a rope that came with a command, as that of before was being taken over: 7 mm left
        (225, 5, 125),  # 2.6 s late, as from rest a plan for the target before led away from the new one
        (200, 0, 104),  # a velocity that rippled without end, as cut pulses were taken for whole ones
        (225, 8, 4),  # 3.3 s late, as the first target counted as a change of mind
        (1000, 7001, 381),  # a rope that came with a second command, as that of before was known: 8 mm left
        (400, 13, 106),  # it stood as long as its rope changed, as that was taken over again and again
        (400, 12, 20),  # stop ends 10⁹ m away in a cycle without bEnable, in which a pulse had been weighed
        (400, 2, 35),  # a stick 3.4 s late, as what was taken away of a motion that speeds up was nothing
        (400, 13, 12),  # moved by a tap that was given before the machine was known
        (300, 31, 97),  # fTimeToGo 8 s too short where an axis turned round, as that of the stop was stated
        (1000, 7001, 373),  # fTimeToGo 15 s too short for a slot, as a stop had ended the way by pulses
        (300, 143, 44),  # fTimeToGo 8 s too short in a stop's last two slots, before the axis turned round
        (300, 31, 203),  # 0.6 s late, as it rested on the way: pulses that led back counted as a stop's plan
    ],
    "wide": [
        (400, 10, 87),  # 4 s against a stick of two axes, one of which was too fast for a plan
        (300, 43, 144),  # a stop 4 s late, as each search began with too few slots
        (300, 83, 197),  # a stop 4 s late, as searches that came too late went on as if they had not
        (300, 80, 155),  # never ready again: disabled while a plan was sought with what was just taken over
    ],
    "bridge": [
        (600, 1032155232, 160),  # 14 s backwards, as the rest of a plan that was removed in part was a stop
        (600, 1032155232, 22),  # 234 s to a target, as what is left broke each rise of the pulses off
        (100, 1, 56),  # 0.2 m beyond the stated ends, of an axis whose stick was at 0 beside another's
    ],
    "damped": [
        (300, 5, 16),  # never ready again: a kernel sought as a plan that was dropped while it was unfolded
        (300, 5, 97),  # 11 s late at a target
    ],
    "hoisted": [
        (300, 5, 172),  # 15 mm beyond them
        (300, 5, 192),  # at a fifth of full speed, as calming broke the pulses' rise off
        (150, 1, 43),  # a plan by the rope of 60 s ago, as a stick had held the axis at its end
        (150, 1, 93),  # a stop 6 s late: plans to a stick's velocity left no time to learn of the rope
        (200, 1, 80),  # a target 0.5 s late, as nothing made up for slots that calmed
        (200, 2, 81),  # a stick 0.6 s late, as a pulse was cut before the axis stood
        (225, 3, 9),  # a stop 4.8 s late, as its stated ends left too little room for calming
        (100, 4, 57),  # 2.7 s late, as what half of a long plan leaves was calmed
        (300, 140, 204),  # a setpoint that jumped by 3 mm, as a kernel in work was dropped for a stick
    ],
    "gyro": [
        (192, 5, 20),  # no fault: fSwayUncertainty was judged without the sensor's delay and offset
        (192, 5, 94),  # no fault: likewise, as it was first used
        (300, 150, 27),  # no fault: fSensorScale was judged by motions before the offset was known
    ],
    "followed": [
        (128, 5, 20),  # a setpoint that jumped by 0.22 m, as one axis was weighed before calming, one after
        (300, 150, 119),  # no fault: what swung as a moving axis was taken over was calmed once it had braked
    ],
    "measured": [
        (2000, 1003, 112),  # an override that was not obeyed for 20 s, as the load was damped on the way
        (2000, 1007, 1110),  # no fault: fSensorScale was judged in the cycle of bReset
        (2000, 1002, 725),  # damped 4.5 s late, as the last 5 mm took the axis 6 s
    ],
}


def numbering(histories: Histories, count: int, seed: int) -> Numbering:
    """Draw histories: those of the search, too, as nothing is known to climb from."""
    drawn = Numbering.of(histories, count, seed)
    return attrs.evolve(drawn, parents=((),) * len(drawn.rounds))


def histories_apart(name: str, histories: Histories) -> list[History]:
    """Give those that a machine of `mutants.MACHINES` once failed, and others that are seldom drawn."""
    former = [
        numbering(histories, count, seed).history(number) for count, seed, number in FORMER.get(name, ())
    ]
    corner = numbering(histories, 8, 1).history(0)
    return [*former, *(attrs.evolve(corner, **parts) for parts in SELDOM.get(name, ()))]


def _positions(*places, time=0.0):
    return Command(time=time, command="position", values=places)


def _by_hand(begin, lasts, fastest, *, cycle=0.01, every=0.1):
    """Disable, and move the first axis at the velocities that it states; it stands as it is enabled."""
    speeds = [fastest * sin(np.pi * k * every / lasts) for k in range(round(lasts / every))]
    moves = (
        Change(
            time=begin + k * every,
            lasts=every,
            inputs={"fActPosition_x": speed * cycle, "fActVelocity_x": speed},
        )
        for k, speed in enumerate(speeds)
    )
    return (Change(time=begin, lasts=lasts + every, inputs={"bEnable": 0.0}), *moves)


SELDOM = {
    "followed": [  # one axis is moved by hand as it says, which the promise outlasts; a stick waits at 0
        {
            "places": (20.0, 6.0),
            "hoisting": {},
            "commands": (
                _positions(20.0, 6.0),
                Command(time=16.0, command="velocity", values=(0.0, 0.0)),
                _positions(22.0, 7.0, time=60.0),
            ),
            "changes": _by_hand(2.0, 12.0, 0.1),
        }
    ],
    "tight": [  # the load is another by little more than what counts
        {
            "commands": (_positions(8.0), _positions(20.0, time=30.0)),
            "changes": (Change(time=5.0, lasts=inf, inputs={"fm2": (1.0 - 1.5 * LEAST_RATE) * 2000.0}),),
        }
    ],
}


def swing(time, acceleration, m1, m2, L1, L2, **_):
    """Sway of two point masses below a cart, by absolute angles and their Lagrangian equations.

    By Runge-Kutta steps over two cycles each, and so known in every second one. L1 is a number, or the rope's
    length at these times.
    """
    rope = np.broadcast_to(L1, time.shape)
    rate = np.gradient(rope, time)
    driven = np.transpose([acceleration, rope, rate, np.gradient(rate, time)]).tolist()

    def slope(state, inputs):
        (a, b, da, db), (push, L, dL, ddL) = state, inputs
        heavy, coupling, coriolis = (m1 + m2) * L, np.cos(a - b), 2.0 * dL * da
        first = (m1 + m2) * (push * np.cos(a) - G * np.sin(a) - coriolis) - m2 * L2 * db**2 * np.sin(a - b)
        second = push * np.cos(b) - G * np.sin(b) + (L * da**2 - ddL) * np.sin(a - b) - coriolis * coupling
        ratio = m2 * coupling
        dda = (first - ratio * second) / (heavy - ratio * L * coupling)
        return np.array([da, db, dda, (second - L * coupling * dda) / L2])

    states, step = [np.zeros(4)], 2.0 * (time[1] - time[0])
    for begin, middle, end in zip(driven[:-2:2], driven[1:-1:2], driven[2::2], strict=True):
        state = states[-1]
        k1 = slope(state, begin)
        k2 = slope(state + 0.5 * step * k1, middle)
        k3 = slope(state + 0.5 * step * k2, middle)
        k4 = slope(state + step * k3, end)
        states.append(state + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4))
    found = np.transpose(states)
    hook = rope[: 2 * len(states) : 2] * np.sin(found[0])
    return np.abs([hook, hook + L2 * np.sin(found[1])])
