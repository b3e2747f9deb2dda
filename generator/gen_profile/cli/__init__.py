"""The command line: arguments in, a workflow called, words and exit codes out."""

from gen_profile.cli import fmu, identify, report, robustness, stream, sweep
from gen_profile.cli.entry import main

__all__ = ["fmu", "identify", "main", "report", "robustness", "stream", "sweep"]
