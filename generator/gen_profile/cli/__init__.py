"""The command line: arguments in, one function called, words and exit codes out."""

from gen_profile.cli import (  # noqa: F401  # each adds its commands
    can,
    commissioning,
    deployment,
    fmu,
    planner,
    report,
    streaming,
    studio,
    sweep,
)
from gen_profile.cli.entry import main

__all__ = ["main"]
