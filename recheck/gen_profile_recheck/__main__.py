"""Prove again what a certificate says.

    python -m gen_profile_recheck ARTEFACT CERTIFICATE SPEC

SPEC is the manifest beside the artefact, or the spec in it, as JSON. The exit code is 0 where everything is
proved, 4 where it is not, 2 where a file cannot be read, and 130 after Ctrl-C.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

MISSING = "The re-checker needs python-flint: pip install 'gen-profile[recheck]' or pip install python-flint."


def main(arguments: list[str]) -> int:
    """Say whether a certificate is proved, and why not; give the exit code."""
    asked = arguments in (["--help"], ["-h"])
    if asked or len(arguments) != 3:
        print(__doc__, file=sys.stdout if asked else sys.stderr)
        return 0 if asked else 2
    try:
        from gen_profile_recheck.check import TRUST, check  # noqa: PLC0415
        from gen_profile_recheck.reading import NotProvedError  # noqa: PLC0415
    except ImportError:
        print(MISSING, file=sys.stderr)
        return 2
    try:
        artefact, certificate, spec = (Path(one).read_bytes() for one in arguments)
        print(check(artefact, spec, certificate, _report, os.cpu_count() or 1))
    except OSError as error:
        print(f"Cannot read {error.filename}: {error.strerror}.", file=sys.stderr)
        return 2
    except NotProvedError as error:
        print(f"Not proved: {error}.")
        return 4
    except KeyboardInterrupt:
        print("Interrupted: nothing is said of the certificate.", file=sys.stderr)
        return 130
    print(TRUST)
    return 0


def _report(done: int, boxes: int) -> None:
    print(f"proving it again, box {done} of {boxes}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
