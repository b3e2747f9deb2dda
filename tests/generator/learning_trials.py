"""Cranes that are not as their specs say, and what three logged runs tell of them.

The crane is the FMU; its rope is off by up to 20 %, its load unknown, its drive lags by 30 ms. The phone on
the hook has noise, an offset, and a clock of its own that is not even; it lies askew or the other way round.
Printed are the sway that remains run by run, and whether the crane is in the ranges that are stated.
"""

import sys

import numpy as np

import gen_profile as gp
from gen_profile.assurance.verification.cosimulation import cosimulate
from gen_profile.dynamics.evaluation.scenarios import Scenario
from gen_profile.studies.identification.learning import learn
from gen_profile.studies.identification.measurements import SwingLog

CRANE = gp.preset_spec(
    "bay-crane",
    plant={"L1": 7.2, "m2": 1200.0},
    move={"duration": 12.0},
    robustness={"uncertain": {"L1": 0.22, "m2": 0.7}},
    limits={"velocity": 1.5, "acceleration": 0.6},
    check={"residual_sway": 0.1},
)
LAG, NOISE, OFFSET = 0.03, 1.5e-3, 0.01  # s; rad/s of each sample, and of the zero
CYCLE, EVERY = 0.004, 0.01  # s, of the controller and of the phone


def drawn_crane(random):
    """A rope up to 20 % shorter or longer than the spec's, and any load."""
    return {
        "L1": CRANE.plant.parameters["L1"] * random.uniform(0.8, 1.2),
        "m2": random.uniform(400.0, 2000.0),
    }


def run(setpoints, true, lag=LAG):
    """What the crane does with setpoints."""
    driven = gp.evolve_spec(CRANE, actuator={"type": "first-order", "tau": lag}) if lag else CRANE
    crane = Scenario(name="true", parameters={**CRANE.plant.parameters, **true})
    (response,) = cosimulate(driven, setpoints, [crane], output_step=CYCLE, by_fmpy=False)
    return response


def left(setpoints, response):
    """Sway of the load that remains, in m."""
    return float(np.abs(response.sway[response.times > setpoints.times[-1] + 10.0 * LAG, -1]).max())


def phone(response, random, noise=NOISE):
    """What a phone on the hook logs of a run, begun some seconds before."""
    before = random.uniform(1.0, 5.0)
    times = np.arange(0.0, before + response.times[-1] - 0.1, EVERY)
    times = np.sort(times + random.normal(0.0, 0.05 * EVERY, times.size))
    gain = random.choice([-1.0, 1.0]) * random.uniform(0.93, 1.0)
    rates = gain * np.interp(times - before, response.times, response.dq_u[:, 0], left=0.0)
    shown = rates + random.normal(0.0, OFFSET) + random.normal(0.0, noise, times.size)
    return SwingLog(times=times - times[0], values=shown, quantity="rate", load="hook")


def trial(seed, runs=3):
    """Design, run, learn, and so on: the sway left by each design, and whether each range holds the crane."""
    random = np.random.default_rng(seed)
    true, spec, remained, held = drawn_crane(random), CRANE, [], []
    for _ in range(runs):
        setpoints = gp.sample(gp.plan(spec).command, CYCLE)
        response = run(setpoints, true)
        remained.append(left(setpoints, response))
        spec = learn(spec, setpoints, [phone(response, random)]).spec
        held.append(all(low <= true[name] <= high for name, (low, high) in spec.checked_ranges().items()))
    setpoints = gp.sample(gp.plan(spec).command, CYCLE)
    return [*remained, left(setpoints, run(setpoints, true))], held


def main(trials, first=0):
    """Print what becomes of so many cranes, from a seed on."""
    held, ratios, worse = 0, [], 0.0
    for seed in range(first, first + trials):
        try:
            remained, inside = trial(seed)
        except gp.GenProfileError as error:
            print(f"{seed}: {error}", flush=True)
            continue
        held += all(inside)
        ratios.append(remained[-1] / remained[0])
        worse = max(worse, *np.diff(remained))
        print(seed, *(f"{1e3 * one:.3g} mm" for one in remained), inside, flush=True)
    print(
        f"{held} of {trials} in all ranges; sway after three runs {np.median(ratios):.2%} of the first in "
        f"half of them, {max(ratios):.2%} at most; worse than the run before by {1e3 * worse:.2g} mm at most"
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:] or [200]))
