"""A double pendulum on a rope that changes: two points in a plane, held by two tensions."""

from math import hypot, sqrt

G = 9.81


class SwingingCrane:
    """Hook and load, in m against the axis; a rope's length, speed and acceleration are given."""

    def __init__(self, rope, *, hook=350.0, load=2000.0, sling=1.5):
        self.hook, self.load, self.sling = hook, load, sling
        self.state = [0.0, -rope, 0.0, -rope - sling, 0.0, 0.0, 0.0, 0.0]

    @property
    def sway(self):
        return self.state[2]

    def _rates(self, state, push, rope, speed, change):
        x1, y1, x2, y2, u1, v1, u2, v2 = state
        nx, ny, kx, ky = x1 / rope, y1 / rope, (x2 - x1) / self.sling, (y2 - y1) / self.sling
        along = nx * kx + ny * ky
        upper, across = -1.0 / self.hook, along / self.hook
        lower = -(1.0 / self.hook + 1.0 / self.load)
        first = change + (speed * speed - u1 * u1 - v1 * v1) / rope + nx * push + ny * G
        second = -((u2 - u1) ** 2 + (v2 - v1) ** 2) / self.sling
        det = upper * lower - across * across
        t1, t2 = (first * lower - across * second) / det, (upper * second - across * first) / det
        return (
            *(u1, v1, u2, v2),
            -push - t1 * nx / self.hook + t2 * kx / self.hook,
            -G - t1 * ny / self.hook + t2 * ky / self.hook,
            -push - t2 * kx / self.load,
            -G - t2 * ky / self.load,
        )

    def advance(self, before, behind, ropes, time):
        """Runge and Kutta's fourth-order step: accelerations at both ends; ropes there and amid."""
        s, amid = self.state, (before + behind) / 2.0
        pushes = (before, amid, amid, behind)
        slopes, shares = [], (0.0, 0.5, 0.5, 1.0)
        for push, share, rope in zip(pushes, shares, (ropes[0], ropes[1], ropes[1], ropes[2]), strict=True):
            at = [x + share * time * k for x, k in zip(s, slopes[-1], strict=True)] if slopes else s
            slopes.append(self._rates(at, push, *rope))
        s = [x + time / 6.0 * (a + 2.0 * b + 2.0 * c + d) for x, a, b, c, d in zip(s, *slopes, strict=True)]
        for i, (ox, oy), length in ((0, (0.0, 0.0), ropes[2][0]), (2, (s[0], s[1]), self.sling)):
            short = length / hypot(s[i] - ox, s[i + 1] - oy)  # what rounding adds to the lengths
            s[i], s[i + 1] = ox + (s[i] - ox) * short, oy + (s[i + 1] - oy) * short
        self.state = s


class Hoist:
    """A rope that goes a way at a speed from a time on, with ramps: length, speed, acceleration."""

    def __init__(self, rope, *legs, ramp=0.4):
        self.rope, self.legs, self.ramp = rope, legs, ramp

    def __call__(self, time, error=0.0):
        length, speed, change = self.rope, 0.0, 0.0
        for begin, rate, way in self.legs:
            sign, fast = (1.0 if rate > 0 else -1.0), min(abs(rate), sqrt(way * self.ramp))
            up = fast / self.ramp
            t, whole = time - begin, way / fast + up
            if t <= 0.0:
                continue
            if t >= whole:
                length += sign * way
            elif t < up:
                length += sign * self.ramp * t * t / 2
                speed, change = sign * self.ramp * t, sign * self.ramp
            elif t < whole - up:
                length, speed = length + sign * fast * (t - up / 2), sign * fast
            else:
                left = whole - t
                length += sign * (way - self.ramp * left * left / 2)
                speed, change = sign * self.ramp * left, -sign * self.ramp
        return (1.0 + error) * length, (1.0 + error) * speed, (1.0 + error) * change
