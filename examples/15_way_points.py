"""Way points in plan view that are passed without stopping: a chain of motions, each handed on at speed.

Each motion but the last ends at speed with the load hanging still (`move.final_velocity`). The next one
begins at that speed: seen by an observer who moves along with it, it begins at rest, and a crane on straight
rails cannot tell the difference. So it is planned as that observer sees it, and his way is added afterwards.

python examples/15_way_points.py
"""

import sys
from itertools import pairwise

import numpy as np

import gen_profile as gp

SPEC = """
name = "around"
plant = { type = "gantry-crane", m = 2000.0, L = 5.0 }
move = { target = [24.0, 10.0], duration = 30.0 }
limits = { velocity = 2.5, acceleration = 0.5 }
robustness = { uncertain = { L = 0.1 } }
check = { residual_sway = 0.02 }
export = { cycle_time = 0.01 }
"""
# bridge and trolley in m, velocity in m/s, and the time in s that the way to there takes
WAY = [((14.0, 0.0), (1.0, 0.2), 11.0), ((20.0, 5.0), (0.6, 1.0), 6.5), ((24.0, 10.0), (0.0, 0.0), 8.5)]


def leg(begin, end, time):
    """Plan from a place at a velocity to another one, as polynomials of both axes."""
    (place, speed), (target, final) = np.array(begin), np.array(end)
    move = {"target": list(target - place - speed * time), "final_velocity": list(final - speed)}
    own = {"velocity": None, "acceleration": 0.5}  # limits of velocity are for those who stand
    motion = gp.plan(gp.evolve_spec(gp.parse_spec(SPEC), move={**move, "duration": time}, limits=own)).motion
    coefficients = motion.coefficients.copy()
    coefficients[:, 0] += place + speed * motion.knots[:-1, None]
    coefficients[:, 1] += speed
    return motion.knots, coefficients


def chained(way):
    """Join the motions to a single one, which rests at its end."""
    knots, coefficients, begin = [np.zeros(1)], [], ((0.0, 0.0), (0.0, 0.0))
    for target, velocity, time in way:
        own, rows = leg(begin, (target, velocity), time)
        knots.append(knots[-1][-1] + own[1:])
        coefficients.append(rows)
        begin = (target, velocity)
    order = max(rows.shape[1] for rows in coefficients)
    even = [np.pad(rows, ((0, 0), (0, order - rows.shape[1]), (0, 0))) for rows in coefficients]
    return gp.Profile(
        knots=np.concatenate(knots), coefficients=np.concatenate(even), target=way[-1][0], method="chain"
    )


def stopping(ends):
    """Tell how long the quickest motions take that stop at every way point, in s."""
    moves = [
        gp.parse_spec(SPEC, move={"start": a, "target": b, "duration": "minimum"}) for a, b in pairwise(ends)
    ]
    return sum(gp.plan(spec).motion.duration for spec in moves)


spec, motion = gp.parse_spec(SPEC), chained(WAY)
times = np.linspace(0.0, motion.duration, 5001)
for order, limit in ((1, spec.limits.velocity), (2, spec.limits.acceleration)):
    if np.abs(motion.derivative(times, order)).max() > 1.000001 * limit:
        sys.exit(f"The chain breaks a limit of {limit}: give its motions more time.")

places = [(0.0, 0.0), *(target for target, *_ in WAY)]
print(f"{motion.duration:.2f} s; {stopping(places):.2f} s with a stop at each way point")
ropes = np.linspace(0.9, 1.1, 21) * spec.plant.parameters["L"]
setpoints = gp.sample(motion, cycle_time=spec.export.cycle_time)
sway = np.linalg.norm(gp.residual_sways(spec, setpoints, {"L": ropes}), axis=1)
print(f"residual sway: {1e3 * sway.max():.1f} mm with ropes of 4.5 to 5.5 m, {1e3 * sway[10]:.2f} mm nominal")
if sway.max() > max(spec.check.residual_sway.values()):
    sys.exit("More than the spec allows.")
