"""A bay crane as an independent judge of damping by a sensor: two masses on two rods, in absolute angles.

Lagrange's equations of the places x − L1 sin a and x − L1 sin a − L2 sin b; nothing is shared with the block.
"""

from math import cos, sin

import numpy as np

G = 9.81


class MeasuredCrane:
    """Swings under the setpoints of a block, and shows a sensor."""

    def __init__(self, block, rope, *, swing=(0.0, 0.0), hook=350.0, load=2000.0, lower=1.5, cycle=0.004):
        """`swing`: m of the load and phase in rad, of the slow mode alone."""
        self.block, self.cycle = block, cycle
        self.l1, self.l2, self.mu = rope, lower, load / hook
        size, phase = swing
        shape, frequency = self._slow_mode()
        self.state = [*(size * cos(phase) * shape), *(-size * sin(phase) * frequency * shape)]
        self.angles, self.gust = [self.state[0]] * 2000, 0.0
        self.rates = [self.state[2]] * 2000
        self.velocity = 0.0
        self.inputs = dict(block.inputs)
        self.rows = {name: [] for name in (*block.outputs, "sway", "hook")}

    def _slow_mode(self):
        mass = np.array([[(1 + self.mu) * self.l1, self.mu * self.l2], [self.l1, self.l2]])
        weight = np.diag([(1 + self.mu) * G, G])
        squares, shapes = np.linalg.eig(np.linalg.solve(mass, weight))
        slow = int(np.argmin(squares))
        shape = shapes[:, slow] / (np.array([self.l1, self.l2]) @ shapes[:, slow])
        return shape, float(np.sqrt(squares[slow]))

    def _rates(self, state, push):
        a, b, da, db = state
        c, s = cos(a - b), sin(a - b)
        l1, l2, mu = self.l1, self.l2, self.mu
        # (1+mu) l1 a'' + mu l2 c b'' = first;  l1 c a'' + l2 b'' = second
        first = (1 + mu) * (push * cos(a) - G * sin(a)) - mu * l2 * s * db * db
        second = push * cos(b) - G * sin(b) + l1 * s * da * da
        det = (1 + mu) * l1 * l2 - mu * l2 * c * l1 * c
        return (
            da,
            db,
            (first * l2 - mu * l2 * c * second) / det,
            ((1 + mu) * l1 * second - l1 * c * first) / det,
        )

    def step(self, measured, valid=True, age=None):
        """Call the block once, and let the crane follow for a cycle."""
        self.inputs |= {"fSensor": measured, "bSensorValid": float(valid)}
        if age is not None:
            self.inputs["fSensorAge"] = age
        self.block.inputs |= self.inputs
        outputs = {name: float(values[0]) for name, values in self.block.play_on(1).items()}
        push = (outputs["fVelocity"] - self.velocity) / self.cycle + self.gust
        self.velocity, h, x = outputs["fVelocity"], self.cycle, self.state
        k1 = self._rates(x, push)
        k2 = self._rates([v + 0.5 * h * k for v, k in zip(x, k1, strict=True)], push)
        k3 = self._rates([v + 0.5 * h * k for v, k in zip(x, k2, strict=True)], push)
        k4 = self._rates([v + h * k for v, k in zip(x, k3, strict=True)], push)
        self.state = [
            v + h * (p + 2 * q + 2 * r + w) / 6 for v, p, q, r, w in zip(x, k1, k2, k3, k4, strict=True)
        ]
        self.angles.append(self.state[0])
        self.rates.append(self.state[2])
        hook = self.l1 * sin(self.state[0])
        for name, value in (outputs | {"hook": hook, "sway": hook + self.l2 * sin(self.state[1])}).items():
            self.rows[name].append(value)
        return outputs

    def run(
        self, seconds, *, noise=0.0, offset=0.0, delay=0.1, rate=False, random=None, sensor=None, **inputs
    ):
        """Let time pass. `sensor`: cycle and true value → what the sensor says, or None for no news."""
        self.inputs |= inputs
        back = 1 + round(delay / self.cycle)
        for number in range(round(seconds / self.cycle)):
            value = (self.rates if rate else self.angles)[-back] + offset
            value += noise * random.standard_normal() if random is not None else 0.0
            said = value if sensor is None else sensor(number, value)
            self.step(said if said is not None else 0.0, valid=said is not None)
        return {name: np.array(values) for name, values in self.rows.items()}
