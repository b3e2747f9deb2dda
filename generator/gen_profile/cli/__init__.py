"""The command line: arguments in, one function called, words and exit codes out."""

from gen_profile.cli import can, deploy, fmu, identify, planner, report, robustness, streaming, sweep
from gen_profile.cli.entry import main

__all__ = [
    "can",
    "deploy",
    "fmu",
    "identify",
    "main",
    "planner",
    "report",
    "robustness",
    "streaming",
    "sweep",
]
