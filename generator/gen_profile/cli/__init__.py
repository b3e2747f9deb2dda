"""The command line: arguments in, one function called, words and exit codes out."""

import sys

from gen_profile.support.interrupts import interrupts_collected

__all__ = ["main"]


def main() -> None:
    """Load the command line and run it; the entry point.

    Loading takes a third of a second, in which Ctrl-C would end in a traceback.
    """
    try:
        with interrupts_collected():
            from gen_profile.cli.entry import run
        run()
    except KeyboardInterrupt:
        from gen_profile.cli.entry import refuse_interrupted

        sys.exit(refuse_interrupted())
