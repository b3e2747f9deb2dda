"""The command line: arguments in, one function called, words and exit codes out."""

from gen_profile.cli import (
    can,
    commissioning,
    deployment,
    fmu,
    planner,
    report,
    robustness,
    streaming,
    studio,
    sweep,
)
from gen_profile.cli.entry import main

__all__ = [
    "can",
    "commissioning",
    "deployment",
    "fmu",
    "main",
    "planner",
    "report",
    "robustness",
    "streaming",
    "studio",
    "sweep",
]
