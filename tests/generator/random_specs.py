"""Random specs of all machines, laboratory to quay, with whatever a spec may ask for; the same for a seed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from random import Random
from typing import Any

Table = dict[str, Any]
MISTYPED = 0.06  # share of specs with one number a thousand times too great or too small

# A machine's parameters, its start and target, the parameters that may be uncertain, and its slowest period.
Machine = tuple[Table, list[float], list[float], list[str], float]


def random_specs(seed: int) -> Iterator[Table]:
    """Draw specs without end, as nested plain values."""
    index = 0
    while True:
        yield random_spec(f"{seed}-{index}")
        index += 1


def random_spec(seed: str) -> Table:
    """Draw one spec; some ask for what cannot be."""
    random = Random(seed)
    plant, start, target, uncertain, period = random.choice(MACHINES)(random)
    ways = [b - a for a, b in zip(start, target, strict=True)]
    duration = float(f"{random.uniform(0.7, 4.0) * period:.3g}")
    tau = _rounded(random.uniform(0.005, 0.1) * period) if random.random() < 0.35 else None
    spec: Table = {
        "name": f"random {seed}",
        "plant": plant,
        "move": {"start": start, "target": target, "duration": duration},
        "robustness": _robustness(random, uncertain),
        "cost": _cost(random, tau),
        "limits": _limits(random, ways, duration),
        "check": {"residual_sway": _rounded(_spread(random, 0.003, 0.03) * max(map(abs, ways)))},
    }
    if tau is not None:
        spec["actuator"] = {"type": "first-order", "tau": tau}
    if random.random() < 0.15:
        spec["move"]["duration"] = "minimum"
    if random.random() < 0.15:
        spec["solver"] = {"method": random.choice(["direct", "indirect"])}
    if random.random() < MISTYPED:
        _mistype(random, spec)
    return spec


def _robustness(random: Random, names: list[str]) -> Table:
    chosen = random.sample(names, min(len(names), random.choice([0, 1, 1, 1, 2])))
    if not chosen:
        return {"method": "none"}
    uncertain = {name: _rounded(random.uniform(0.03, 0.3)) for name in chosen}
    method = random.choice(["none", "sensitivity", "sensitivity", "sensitivity", "range"])
    order = 2 if method == "sensitivity" and random.random() < 0.3 else 1
    return {"method": method, "uncertain": uncertain, "order": order}


def _cost(random: Random, tau: float | None) -> Table:
    efforts = ["jerk", "jerk", "snap"] + ["reference"] * (tau is not None)
    weight = random.choice([0.0, 0.0, _rounded(_spread(random, 0.5, 100.0))])
    return {"effort": random.choice(efforts), "sway_weight": weight}


def _limits(random: Random, ways: list[float], duration: float) -> Table:
    """Limit what a quintic of the longest move would take, more or less."""
    way = max(map(abs, ways))
    usual = {
        "velocity": 1.9 * way / duration,
        "acceleration": 5.8 * way / duration**2,
        "jerk": 60.0 * way / duration**3,
        "sway": 0.6 * way / duration**2,  # about that acceleration over g, on a rope of a metre
    }
    return {
        name: _rounded(value * _spread(random, 0.6, 4.0))
        for name, value in usual.items()
        if random.random() < 0.3
    }


def _mistype(random: Random, spec: Table) -> None:
    """Take one number's unit for another."""
    tables = [spec["move"], spec["limits"], spec["plant"], spec["check"]]
    table = random.choice([table for table in tables if table])
    key = random.choice(list(table))
    factor = random.choice([1000.0, 0.001])
    match table[key]:
        case float() as value:
            table[key] = value * factor
        case list() as values:
            table[key] = [value * factor for value in values]


def _spread(random: Random, low: float, high: float) -> float:
    """Draw evenly over the magnitudes."""
    return math.exp(random.uniform(math.log(low), math.log(high)))


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")


def _way(random: Random, length: float) -> float:
    return _rounded(random.choice([-1.0, 1.0]) * length)


def _pendulum(rope: float) -> float:
    return 2.0 * math.pi * math.sqrt(rope / 9.81)


def _double_pendulum(random: Random) -> Machine:
    rope = _rounded(_spread(random, 0.3, 30.0))
    second = _rounded(rope * _spread(random, 0.05, 1.0))
    load = _rounded(_spread(random, 0.1, 2e4))
    plant = {"type": "double-pendulum-crane", "L1": rope, "L2": second, "m2": load}
    plant["m1"] = _rounded(load * _spread(random, 0.03, 1.0))
    way = _way(random, rope * _spread(random, 0.2, 2.5))
    return plant, [0.0], [way], ["L1", "L2", "m2"], _pendulum(rope + second)


def _single_pendulum(random: Random) -> Machine:
    rope = _rounded(_spread(random, 0.3, 40.0))
    plant = {"type": "single-pendulum-crane", "L0": rope, "m": _rounded(_spread(random, 0.1, 5e4))}
    hoist = random.choice([0.0, 0.0, _rounded(rope * random.uniform(-0.5, 1.0))])
    way = _way(random, rope * _spread(random, 0.2, 3.0))
    return plant, [0.0, 0.0], [way, hoist], ["L0"], _pendulum(rope + max(hoist, 0.0))


def _gantry(random: Random) -> Machine:
    rope = _rounded(_spread(random, 0.5, 40.0))
    plant = {"type": "gantry-crane", "L": rope, "m": _rounded(_spread(random, 1.0, 5e4))}
    across = random.choice([0.0, _way(random, rope * _spread(random, 0.2, 2.0))])
    way = _way(random, rope * _spread(random, 0.2, 3.0))
    return plant, [0.0, 0.0], [way, across], ["L"], _pendulum(rope)


def _tower(random: Random) -> Machine:
    rope = _rounded(_spread(random, 0.5, 40.0))
    radius = _rounded(rope * random.uniform(0.5, 3.0))
    plant = {"type": "tower-crane", "L": rope, "m": _rounded(_spread(random, 1.0, 2e4))}
    turn = _way(random, random.uniform(0.1, 2.0))
    reached = _rounded(radius * random.choice([1.0, random.uniform(0.5, 1.5)]))
    return plant, [0.0, radius], [turn, reached], ["L"], 2.0 * _pendulum(rope)


def _chain(random: Random) -> Machine:
    count = random.choice([1, 2, 3, 4])
    mass, stiffness = _spread(random, 0.1, 1e3), _spread(random, 10.0, 1e5)
    plant: Table = {"type": f"mass-spring-chain-{count}"}
    for number in range(1, count + 1):
        plant[f"m{number}"] = _rounded(mass * _spread(random, 0.3, 3.0))
        plant[f"k{number}"] = _rounded(stiffness * _spread(random, 0.3, 3.0))
        plant[f"c{number}"] = _rounded(random.choice([0.0, 0.02]) * math.sqrt(mass * stiffness))
    period = 2.0 * math.pi * math.sqrt(mass / stiffness) * (count + 1) / 2.0
    names = [f"m{count}", "k1"]
    return plant, [0.0], [_way(random, _spread(random, 0.05, 2.0))], names, period


def _joint(random: Random) -> Machine:
    inertia = _rounded(_spread(random, 1e-3, 100.0))
    frequency = _spread(random, 3.0, 60.0)
    plant = {"type": "flexible-joint", "J": inertia, "k": _rounded(inertia * frequency**2)}
    plant |= {"c": _rounded(random.choice([0.0, 0.02]) * inertia * frequency), "R": 0.5}
    return plant, [0.0], [_way(random, _spread(random, 0.2, 4.0))], ["J", "k"], 2.0 * math.pi / frequency


def _tank(random: Random) -> Machine:
    length = _rounded(_spread(random, 0.2, 5.0))
    plant = {"type": "slosh-tank", "a": length, "b": length, "h": _rounded(length * random.uniform(0.2, 1.0))}
    way = _way(random, length * _spread(random, 0.3, 5.0))
    return plant, [0.0], [way], ["h", "a"], 2.0 * math.pi / math.sqrt(math.pi * 9.81 / length)


MACHINES: tuple[Callable[[Random], Machine], ...] = (
    _double_pendulum,
    _single_pendulum,
    _gantry,
    _tower,
    _chain,
    _joint,
    _tank,
)
