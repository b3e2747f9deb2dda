"""Machines as independent judges of damping by a sensor; nothing is shared with the block.

A gantry: a mass on a rod, by Newton's law in Cartesian coordinates. A bay crane: two masses on two rods, in
absolute angles, by Lagrange's equations of the places x − L1 sin a and x − L1 sin a − L2 sin b. An arm on a
torsion spring. Liquid in a tank, by two of its modes.
"""

from math import cos, pi, sin, tanh

import numpy as np

G = 9.81


class MeasuredMachine:
    """Swings under the setpoints of a block, and shows a sensor."""

    def __init__(self, block, state, *, cycle):
        """`state`: the coordinates, then their rates."""
        self.block, self.cycle, self.state = block, cycle, [*state]
        self.gust, self.velocity = 0.0, 0.0
        self.inputs = dict(block.inputs)
        self.shown = [self.shows()] * 2000
        self.rows = {name: [] for name in (*block.outputs, *self.sways())}

    def step(self, measured, valid=True, age=None):
        """Call the block once, and let the machine follow for a cycle."""
        self.inputs |= {"fSensor": measured, "bSensorValid": float(valid)}
        if age is not None:
            self.inputs["fSensorAge"] = age
        self.block.inputs |= self.inputs
        outputs = self.block.step()
        push = (outputs["fVelocity"] - self.velocity) / self.cycle + self.gust
        self.velocity, h, x = outputs["fVelocity"], self.cycle, self.state
        k1 = self._rates(x, push)
        k2 = self._rates([v + 0.5 * h * k for v, k in zip(x, k1, strict=True)], push)
        k3 = self._rates([v + 0.5 * h * k for v, k in zip(x, k2, strict=True)], push)
        k4 = self._rates([v + h * k for v, k in zip(x, k3, strict=True)], push)
        self.state = [
            v + h * (p + 2 * q + 2 * r + w) / 6 for v, p, q, r, w in zip(x, k1, k2, k3, k4, strict=True)
        ]
        self.shown.append(self.shows())
        for name, value in (outputs | self.sways()).items():
            self.rows[name].append(value)
        return outputs

    def run(self, seconds, *, noise=0.0, offset=0.0, delay=0.1, random=None, sensor=None, **inputs):
        """Let time pass. `sensor`: cycle and true value → what the sensor says, or None for no news."""
        self.inputs |= inputs
        back = 1 + round(delay / self.cycle)
        for number in range(round(seconds / self.cycle)):
            value = self.shown[-back] + offset
            value += noise * random.standard_normal() if random is not None else 0.0
            said = value if sensor is None else sensor(number, value)
            self.step(said if said is not None else 0.0, valid=said is not None)
        return {name: np.array(values) for name, values in self.rows.items()}


class MeasuredCrane(MeasuredMachine):
    """Hook and load; measured is the upper rope's angle."""

    def __init__(self, block, rope, *, swing=(0.0, 0.0), hook=350.0, load=2000.0, lower=1.5, cycle=0.004):
        """`swing`: m of the load and phase in rad, of the slow mode alone."""
        self.l1, self.l2, self.mu = rope, lower, load / hook
        size, phase = swing
        shape, frequency = self._slow_mode()
        start = [*(size * cos(phase) * shape), *(-size * sin(phase) * frequency * shape)]
        super().__init__(block, start, cycle=cycle)

    def shows(self):
        return self.state[0]

    def sways(self):
        hook = self.l1 * sin(self.state[0])
        return {"hook": hook, "sway": hook + self.l2 * sin(self.state[1])}

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


class MeasuredJoint(MeasuredMachine):
    """An arm behind a torsion spring; measured is by how much it trails the hub, by an encoder at the arm."""

    def __init__(self, block, *, swing=(0.0, 0.0), inertia=0.0035, stiffness=1.3, damping=0.004, cycle=0.001):
        """`swing`: m of the tip, and its phase in rad."""
        self.square, self.damped, self.reach = stiffness / inertia, damping / inertia, 0.3
        size, phase = swing[0] / self.reach, swing[1]
        super().__init__(block, [size * cos(phase), -size * sin(phase) * self.square**0.5], cycle=cycle)

    def shows(self):
        return self.state[0]

    def sways(self):
        return {"sway": self.reach * self.state[0]}

    def _rates(self, state, push):
        angle, rate = state
        return rate, push - self.square * angle - self.damped * rate


class MeasuredTank(MeasuredMachine):
    """Two modes of a liquid as pendulums; measured is how high it stands at the wall, as by a level probe."""

    def __init__(self, block, *, swing=(0.0, 0.0), length=0.5, fill=0.25, cycle=0.002):
        """`swing`: m of the first mode at the wall, and its phase in rad."""
        waves = [odd * pi / length for odd in (1, 3)]
        self.lengths = [1.0 / (wave * tanh(wave * fill)) for wave in waves]
        self.rises = [4.0 * length / (odd * pi) ** 2 for odd in (1, 3)]
        size, frequency = swing[0] / self.rises[0], (G / self.lengths[0]) ** 0.5
        start = [size * cos(swing[1]), 0.0, -size * frequency * sin(swing[1]), 0.0]
        super().__init__(block, start, cycle=cycle)

    def shows(self):
        return sum(rise * sin(angle) for rise, angle in zip(self.rises, self.state, strict=False))

    def sways(self):
        return {"sway": self.shows()}

    def _rates(self, state, push):
        angles, rates = state[:2], state[2:]
        loss = [2.0 * 0.0012 * (G / length) ** 0.5 for length in self.lengths]
        return (
            *rates,
            *(
                (push * cos(angle) - G * sin(angle)) / length - lost * rate
                for angle, rate, length, lost in zip(angles, rates, self.lengths, loss, strict=True)
            ),
        )


class MeasuredGantry:
    """A load on a rod below a trolley that moves in x and y; measured are the two angles of its joint."""

    def __init__(self, block, length, *, swing, cycle):
        """`swing`: m in x and y, from which it is let go."""
        self.block, self.length, self.cycle = block, length, cycle
        below = -((length**2 - swing[0] ** 2 - swing[1] ** 2) ** 0.5)
        self.place, self.speed = np.array([-swing[0], -swing[1], below]), np.zeros(3)
        self.velocity, self.gust = np.zeros(2), np.zeros(2)
        self.inputs, self.rows = dict(block.inputs), []

    def shows(self):
        x, y, z = -self.place
        return {"x": np.arctan2(x, z), "y": np.arcsin(y / self.length)}

    def run(self, seconds, sensor=lambda axis, value: value, **inputs):
        """Let time pass; `sensor`: axis and true value → what is said."""
        self.inputs |= inputs
        for _ in range(round(seconds / self.cycle)):
            for axis, value in self.shows().items():
                self.inputs |= {f"fSensor_{axis}": sensor(axis, value), f"bSensorValid_{axis}": 1.0}
            self.block.inputs |= self.inputs
            outputs = self.block.step()
            velocity = np.array([outputs["fVelocity_x"], outputs["fVelocity_y"]])
            push = np.array([*(self.velocity - velocity) / self.cycle - self.gust, -G])
            self.velocity, steps = velocity, 4
            for _ in range(steps):  # Störmer-Verlet, back on the sphere and its tangent each time
                h = self.cycle / steps
                self.speed = self.speed + h * (push + self._pull(push) * self.place)
                self.place = self.place + h * self.speed
                self.place *= self.length / np.linalg.norm(self.place)
                self.speed -= self.place * (self.speed @ self.place) / self.length**2
            self.rows.append(outputs | {"sway_x": -self.place[0], "sway_y": -self.place[1]})
        return {name: np.array([row[name] for row in self.rows]) for name in self.rows[0]}

    def _pull(self, push):
        """Of the rod, by the load's mass and the rod's vector."""
        return -(self.speed @ self.speed + push @ self.place) / self.length**2
