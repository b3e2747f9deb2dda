"""SI units by their base units, as FMI wants them."""

# exponents of the SI base units; FMI also counts the radian as one
BASE_UNITS: dict[str, dict[str, int]] = {
    "1": {},
    "kg": {"kg": 1},
    "kg/m^3": {"kg": 1, "m": -3},
    "kg m^2": {"kg": 1, "m": 2},
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "m/s^2": {"m": 1, "s": -2},
    "m/s^3": {"m": 1, "s": -3},
    "s": {"s": 1},
    "1/s": {"s": -1},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "rad/s^2": {"rad": 1, "s": -2},
    "rad/s^3": {"rad": 1, "s": -3},
    "Pa s": {"kg": 1, "m": -1, "s": -1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "N m": {"kg": 1, "m": 2, "s": -2},
    "N/m": {"kg": 1, "s": -2},
    "N s/m": {"kg": 1, "s": -1},
    "N m/rad": {"kg": 1, "m": 2, "s": -2, "rad": -1},
    "N m s/rad": {"kg": 1, "m": 2, "s": -1, "rad": -1},
}
