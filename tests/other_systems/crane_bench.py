"""A planner block with a sensor in others' benchmark of crane controllers: ``just crane-bench --samples 16``.

cranebench's planar crane, its wind, its uncertain machines and its scoring are untouched; its five baselines
run beside the block. The block is one of a single pendulum, in an own subclass of its ``Controller``: an
acceleration loop is the drive, and the swing's angle, which has no noise there, is the sensor. It knows the
rope, but neither load nor drag, which the design varies by a fifth and more.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator

import numpy as np
from cranebench.controllers import BASELINES, Controller
from cranebench.reference import Manoeuvre
from cranebench.runner import Campaign, run_single
from cranebench.uncertainty import lhs_design

from gen_profile.planner.design import planner_block
from gen_profile.planner.execution import BlockInstance
from gen_profile.spec.reading import preset_spec

SPEC = (
    "plant.g=9.80665",
    "planner.live={hoist=[5.5, 12.5]}",
    "move={start=[0.0, 9.0], target=[20.0, 9.0], duration=20.0}",
    'robustness={method="none", uncertain={}}',
    "limits={axis={cart={velocity=2.0, acceleration=0.6, jerk=1.2, travel=[-5.0, 25.0]}}}",
    "export.cycle_time=0.01",
    "check.residual_sway=0.0003",
    'planner.sensor={quantity="angle", of="phi", noise=0.000003, offset=0.02}',
    "planner.disturbance={swing={payload=0.5}, gust={acceleration=0.15, longest=5.0}, settle=20.0}",
)
CYCLE = 0.01  # s, of its controllers
DISTANCE, ENDS, TAIL = 20.0, 40.0, 5.0  # m, s, and s at the end that it scores
BEGINS = 0.3  # s: the block measures its motions first
CART, LOAD, DRAG, GRAVITY = 1500.0, 4000.0, 250.0, 9.80665  # kg, kg, N s/m, m/s²: nominal
LOOP, INTEGRAL = 3.0, 8.0  # rad/s and 1/s³ of the drive
HOIST = (4.0e4, 6.0e4)  # N/m and N s/m, as of its baselines
WINDS = {"none": "calm", "kaimal": "wind"}


class PlannerBlock(Controller):
    """The block, and a drive that follows its acceleration."""

    name = "block"

    def __init__(self) -> None:
        self._text = planner_block(preset_spec("single-pendulum-crane", SPEC)).text

    def reset(self, plant, manoeuvre) -> None:
        """Begin anew, on a machine whose parameters are not looked at."""
        super().reset(plant, manoeuvre)
        self.block = BlockInstance(self._text)
        self.inputs = {**self.block.inputs, "bEnable": 1.0, "bSensorValid": 1.0, "fTarget": DISTANCE}
        self.lag, self.velocity, self.issued = 0.0, 0.0, dict[str, float]()

    def __call__(self, t, x):
        """Give the forces of cart and hoist in N."""
        place, rope, angle, speed, rope_rate, angle_rate = x
        self.inputs |= {
            "fhoist": rope - 3.0,
            "fSensor": -angle,
            "bExecute": float(t >= BEGINS),
        }
        row = self.block.call(np.array([list(self.inputs.values())]))[0]
        self.issued = dict(zip(self.block.outputs, row.tolist(), strict=True))
        acceleration = (self.issued["fVelocity"] - self.velocity) / CYCLE
        self.velocity = self.issued["fVelocity"]
        apart, slower = self.issued["fPosition"] - place, self.velocity - speed
        self.lag += CYCLE * apart
        asked = acceleration + 2.0 * LOOP * slower + LOOP**2 * apart + INTEGRAL * self.lag
        pull = LOAD * (GRAVITY * np.cos(angle) + rope * angle_rate**2) * np.sin(angle)
        hoist = HOIST[0] * (self.x0[1] - rope) - HOIST[1] * rope_rate - LOAD * GRAVITY
        return np.array([CART * asked + DRAG * speed - pull, hoist])


def figures(
    controller: Controller, samples: int, winds: Iterable[str] = WINDS
) -> Iterator[tuple[str, list[float]]]:
    """Score a controller in some of `WINDS`.

    Yields
    ------
    wind : str
        For each sample.
    row : list of float
        Its residual swing in degrees, the standard deviation of the swing about its mean in the same time,
        and the cart's mean error in m.
    """
    design = lhs_design(n=500)
    for wind in winds:
        campaign = Campaign(wind=wind, manoeuvre=Manoeuvre(distance=DISTANCE, t_total=ENDS))
        for factors, seed in zip(design.as_dicts()[:samples], design.wind_seeds, strict=False):
            metrics, (times, states, _) = run_single(controller, campaign, factors, int(seed))
            swing = np.degrees(states[times >= ENDS - TAIL, 2])
            yield wind, [metrics["residual_swing"], float(swing.std()), metrics["final_pos_err"]]


def main() -> None:
    """Print the table of the documentation."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=4, help="machines and winds, of 500")
    samples = parser.parse_args().samples
    print("| | calm: residual ° | wind: residual ° | wind: std about the mean ° | wind: cart's error |")
    print("|---|---|---|---|---|")
    for name, make in {**BASELINES, "block": PlannerBlock}.items():
        rows = [*figures(make(), samples)]
        calm, wind = (np.mean([row for of, row in rows if of == known], axis=0) for known in WINDS)
        print(
            f"| {name} | {calm[0]:.4f} | {wind[0]:.3f} | {wind[1]:.3f} | {1e3 * wind[2]:.0f} mm |", flush=True
        )


if __name__ == "__main__":
    main()
