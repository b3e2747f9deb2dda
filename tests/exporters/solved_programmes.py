"""The block of linear programmes called from Python, and random programmes for it and for SciPy's HiGHS."""

import attrs
import numpy as np
from scipy.optimize import linprog

from gen_profile.planner.execution import BlockInstance
from gen_profile_exporters.planner.blocks.texts import linear_programme

SLOTS, ROWS = 48, 13
FOUND, NONE, UNFINISHED = 1, 2, 3
SIDES = 2.0 * np.pi * np.arange(12) / 12
NUMBERS = {
    "nOperations": "DINT", "nSlots": "DINT", "nEqual": "DINT", "nPairs": "DINT", "nMost": "DINT",
    "bPlaces": "BOOL", "bPriced": "BOOL", "fSpeedBefore": "LREAL", "fChangeBefore": "LREAL",
    "fSpeedAfter": "LREAL", "fMostChange": "LREAL", "fMostCurve": "LREAL",
}  # fmt: skip
ARRAYS = {
    "aLow": SLOTS, "aHigh": SLOTS, "aSlow": SLOTS, "aFast": SLOTS, "aCost": SLOTS,
    "aRow": ROWS * SLOTS, "aValue": ROWS, "aRadius": ROWS // 2,
}  # fmt: skip


def text():
    """The block within one that is given its arrays as inputs."""
    inputs = "\n".join(f"{name} : {type_};" for name, type_ in NUMBERS.items())
    given = "\n".join(f"g{name} : ARRAY [0..{size - 1}] OF LREAL;" for name, size in ARRAYS.items())
    own = "\n".join(f"{name} : ARRAY [0..{size - 1}] OF LREAL;" for name, size in ARRAYS.items())
    copies = "\n".join(
        f"FOR i := 0 TO {size - 1} DO {name}[i] := g{name}[i]; END_FOR;" for name, size in ARRAYS.items()
    )
    handed = ", ".join(f"{name} := {name}" for name in ("bStart", *NUMBERS, *ARRAYS, "aPlace"))
    return f"""{linear_programme("Programme", slots=SLOTS, rows=ROWS)}
FUNCTION_BLOCK Called
VAR_INPUT bStart : BOOL;
{inputs}
{given}
END_VAR
VAR_OUTPUT
nResult : DINT; nIterations : DINT; nSpent : DINT; aPlace : ARRAY [0..{SLOTS - 1}] OF LREAL;
END_VAR
VAR programme : Programme; i : DINT;
{own}
END_VAR
IF bStart THEN
{copies}
END_IF;
programme({handed});
nResult := programme.nResult;
nIterations := programme.nIterations;
nSpent := programme.nSpent;
END_FUNCTION_BLOCK
"""


@attrs.frozen(eq=False, kw_only=True)
class Problem:
    """A programme as the block's heading has it; rows of speeds, equal ones first."""

    slots: int
    before: float
    change: float
    after: float
    most: tuple[float, float]
    speeds: tuple[np.ndarray, np.ndarray]
    places: tuple[np.ndarray, np.ndarray] | None
    rows: np.ndarray
    values: np.ndarray
    radii: np.ndarray
    costs: np.ndarray | None = None

    @property
    def equal(self):
        return len(self.rows) - 2 * len(self.radii)

    def inequalities(self):
        """Matrix and bound of all that the speeds keep, written from the definitions."""
        n = self.slots
        wide = np.vstack([np.zeros((2, n)), np.eye(n), np.zeros((2, n))])
        known = np.r_[self.before - self.change, self.before, np.zeros(n), self.after, self.after]
        changes, curves = np.diff(wide, axis=0), np.diff(wide, axis=0, n=2)
        rows, most = [], []
        for matrix, held, limit in (
            (changes[1:-1], np.diff(known)[1:-1], self.most[0]),
            (curves, np.diff(known, n=2), self.most[1]),
        ):
            rows += [matrix, -matrix]
            most += [limit - held, limit + held]
        if self.places is not None:
            sums = np.tri(n)
            rows += [sums, -sums]
            most += [self.places[1], -self.places[0]]
        for pair, radius in enumerate(self.radii):
            at = self.equal + 2 * pair
            u, w = self.rows[at : at + 2] - 0.0, self.values[at : at + 2]
            rows.append(np.outer(np.cos(SIDES), u[0]) + np.outer(np.sin(SIDES), u[1]))
            most.append(radius + np.cos(SIDES) * w[0] + np.sin(SIDES) * w[1])
        return np.vstack(rows), np.concatenate(most)

    def by_highs(self, costs=None, slack=0.0):
        """Speeds that HiGHS finds, or None; bounds wider by `slack` (negative: narrower)."""
        matrix, most = self.inequalities()
        due = self.rows[: self.equal], self.values[: self.equal]
        ends = np.column_stack([self.speeds[0] - slack, self.speeds[1] + slack])
        costs = np.zeros(self.slots) if costs is None else costs
        found = linprog(costs, matrix, most + slack, *due, ends, "highs")
        return found.x if found.status == 0 else None

    def shortfall(self, speeds):
        """By how much speeds miss anything."""
        matrix, most = self.inequalities()
        return max(
            np.max(matrix @ speeds - most),
            np.max(speeds - self.speeds[1]),
            np.max(self.speeds[0] - speeds),
            np.max(np.abs(self.rows[: self.equal] @ speeds - self.values[: self.equal])),
        )


class Programmes:
    """An instance of the block."""

    def __init__(self):
        self.block = BlockInstance(text())
        self.names = list(self.block.inputs)
        self.calls = 0

    def row(self, problem, *, operations, iterations):
        n = problem.slots
        filled = lambda values, fill: np.r_[values, np.full(SLOTS - n, fill)]  # noqa: E731
        rows = np.zeros((ROWS, SLOTS))
        rows[: len(problem.rows), :n] = problem.rows
        low, high = problem.places or (np.zeros(n), np.zeros(n))
        arrays = {
            "aLow": filled(low, 0.0), "aHigh": filled(high, 0.0), "aSlow": filled(problem.speeds[0], 0.0),
            "aFast": filled(problem.speeds[1], 0.0), "aRow": rows.ravel(),
            "aCost": filled(np.zeros(n) if problem.costs is None else problem.costs, 0.0),
            "aValue": np.r_[problem.values, np.zeros(ROWS - len(problem.values))],
            "aRadius": np.r_[problem.radii, np.zeros(ROWS // 2 - len(problem.radii))],
        }  # fmt: skip
        numbers = [
            1, operations, n, problem.equal, len(problem.radii), iterations, problem.places is not None,
            problem.costs is not None, problem.before, problem.change, problem.after, *problem.most,
        ]  # fmt: skip
        return np.concatenate([numbers, *(arrays[name] for name in ARRAYS)])

    def solve(self, problem, *, operations=60_000, iterations=30):
        """Result, speeds, and iterations; how many calls that took is kept."""
        row = self.row(problem, operations=operations, iterations=iterations)
        self.calls, self.spent = 0, []
        while self.calls < 10_000:
            issued = self.block.call(row[None])[0]
            self.calls += 1
            self.spent.append(issued[2])
            row[0] = 0
            if issued[0]:
                return int(issued[0]), np.diff(issued[3 : 3 + problem.slots], prepend=0.0), int(issued[1])
        raise AssertionError("no result")


def crane_problem(draw):
    """A crane's way to a target, a stop or a speed, from amid a motion; in full speeds and slots."""
    slots = int(draw.integers(6, SLOTS + 1))
    step = draw.uniform(0.05, 0.5)
    curve = step * draw.uniform(0.3, 2.0)
    executed = int(draw.integers(0, 60))
    past = np.zeros(0)
    speed = change = 0.0
    goal = draw.uniform(-1, 1)
    for _ in range(executed):  # some motion that keeps the limits
        if draw.random() < 0.08:
            goal = draw.uniform(-1, 1)
        reach = np.sign(goal - speed) * min(step, np.sqrt(2 * curve * abs(goal - speed)) / 1.5)
        change += np.clip(reach - change, -curve, curve)
        change = float(np.clip(change, -step, step))
        if abs(speed + change) > 1:
            change = np.clip(np.sign(speed) - speed, -step, step)
        speed += change
        past = np.append(past, speed)
    if len(past) < 2:
        past = np.r_[0.0, 0.0, past]
    slow = 2 * np.pi / draw.uniform(14, 30)
    phases = np.array([slow, slow * draw.uniform(2.0, 6.0)])[: int(draw.integers(1, 3))]
    ahead, behind = np.arange(slots), np.arange(len(past)) - len(past)
    after = 0.0 if draw.random() < 0.7 else draw.uniform(-1, 1)
    rows, values = [], []
    for phase in phases:
        wave = np.exp(1j * phase * ahead)
        known = np.sum(past * np.exp(1j * phase * behind))
        known += after * np.exp(1j * phase * slots) / (1 - np.exp(1j * phase))
        rows += [wave.real, wave.imag]
        values += [-known.real, -known.imag]
    if draw.random() < 0.5:
        rows.append(np.ones(slots))
        values.append(draw.uniform(-1.1, 1.1) * slots * draw.choice([0.1, 0.5, 1.0]))
    radii = []
    error = draw.choice([0.02, 0.05])
    for phase in phases:
        for side in (-1, 1)[: int(draw.integers(0, 3))]:
            other = phase * (1 + side * error)
            wave = np.exp(1j * other * ahead)
            known = np.sum(past * np.exp(1j * other * behind))
            known += after * np.exp(1j * other * slots) / (1 - np.exp(1j * other))
            rows += [wave.real, wave.imag]
            values += [-known.real, -known.imag]
            radii.append(draw.uniform(0.02, 1.0))
    places = None
    if draw.random() < 0.5:
        low, high = -draw.uniform(0.0, 20.0), draw.uniform(0.0, 20.0)
        places = np.full(slots, low), np.full(slots, high)
    fast = np.ones(slots)
    if draw.random() < 0.2:
        fast[int(draw.integers(0, slots)) :] = max(abs(after), draw.uniform(0.1, 1.0)) + 1e-3
    return Problem(
        slots=slots, before=past[-1], change=past[-1] - past[-2], after=after, most=(step, curve),
        speeds=(-fast, fast), places=places, rows=np.array(rows), values=np.array(values),
        radii=np.array(radii),
        costs=draw.choice([-1.0, 1.0]) * 1.2 ** (ahead / 4.0) if draw.random() < 0.25 else None,
    )  # fmt: skip
