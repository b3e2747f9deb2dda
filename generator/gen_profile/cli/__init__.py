"""The command line: arguments in, one function called, words and exit codes out."""

from gen_profile.cli import (
    can,
    commission,
    deployment,
    fmu,
    identify,
    log_swing,
    planner,
    report,
    robustness,
    streaming,
    sweep,
)
from gen_profile.cli.entry import main

__all__ = [
    "can",
    "commission",
    "deployment",
    "fmu",
    "identify",
    "log_swing",
    "main",
    "planner",
    "report",
    "robustness",
    "streaming",
    "sweep",
]
