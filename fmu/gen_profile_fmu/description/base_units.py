"""SI units by their base units, as FMI wants them."""

import tomllib
from pathlib import Path

_TEXT = Path(__file__).with_name("base_units.toml").read_text("utf-8")
BASE_UNITS: dict[str, dict[str, int]] = tomllib.loads(_TEXT)
