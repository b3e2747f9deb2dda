"""`python -m gen_profile_recheck ARTEFACT CERTIFICATE SPEC`: SPEC is the manifest, or the spec in it, as JSON."""

from __future__ import annotations

import sys
from pathlib import Path

from gen_profile_recheck.check import TRUST, check
from gen_profile_recheck.enclosure import NotProvedError


def main(arguments: list[str]) -> int:
    """Say whether a certificate is proved, and why not; 0 where it is, 4 where not, 2 for wrong arguments."""
    if len(arguments) != 3:
        print(__doc__, file=sys.stderr)
        return 2
    try:
        artefact, certificate, spec = (Path(one).read_bytes() for one in arguments)
        print(check(artefact, spec, certificate))
    except OSError as error:
        print(f"Cannot read {error.filename}: {error.strerror}.", file=sys.stderr)
        return 2
    except NotProvedError as error:
        print(f"Not proved: {error}.")
        return 4
    print(TRUST)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
