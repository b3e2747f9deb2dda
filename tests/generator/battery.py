"""Plan random specs, each in a process of its own, and tell how that ended: ``just battery --count 500``."""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

import attrs

sys.path.insert(0, str(Path(__file__).parent))
from random_specs import random_spec

from gen_profile.methods.solvers.plan import plan
from gen_profile.spec.reading import overridden, spec_from_dict
from gen_profile.support.errors import GenProfileError, NoMotion, SpecError

KILLED_AFTER = 60  # s of processor


@attrs.frozen
class Outcome:
    """How a spec ended: a kind, in words, the processor's time in s, and what was suggested."""

    kind: str
    words: str
    seconds: float
    suggestions: list[dict[str, Any]]


def planned(document: dict[str, Any]) -> tuple[str, str, list[dict[str, Any]]]:
    """Plan a spec here."""
    try:
        spec = spec_from_dict(document)
    except SpecError as error:
        return "spec fault", str(error), []
    try:
        found = plan(spec)
    except GenProfileError as error:
        suggested = error.suggestions if isinstance(error, NoMotion) else ()
        return type(error).__name__, str(error), [dict(one.values) for one in suggested]
    except Exception as error:
        return "CRASHED", repr(error), []
    solution = found.solution
    return "solved", "" if solution is None else f"{solution.method}, {solution.iterations} iterations", []


def outcome(document: dict[str, Any]) -> Outcome:
    """Plan a spec in a process of its own."""
    with tempfile.TemporaryFile() as answer:
        child = os.fork()
        if child == 0:
            resource.setrlimit(resource.RLIMIT_CPU, (KILLED_AFTER, KILLED_AFTER))
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            os.write(answer.fileno(), json.dumps(planned(document)).encode())
            os._exit(0)
        _, _, usage = os.wait4(child, 0)
        answer.seek(0)
        kind, words, suggestions = json.loads(answer.read() or '["KILLED", "", []]')
    return Outcome(kind, words, usage.ru_utime + usage.ru_stime, suggestions)


def main() -> None:
    """Run the battery."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", default="battery")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--only", type=int, help="print and plan this one here")
    parser.add_argument("--set", action="append", default=[], dest="overrides")
    arguments = parser.parse_args()
    if arguments.only is not None:
        document = overridden(random_spec(f"{arguments.seed}-{arguments.only}"), arguments.overrides)
        print(document, flush=True)
        print(*planned(document), sep="\n")
        return
    kinds, tried, slow = Counter[str](), Counter[str](), []
    for index in range(arguments.first, arguments.first + arguments.count):
        document = overridden(random_spec(f"{arguments.seed}-{index}"), arguments.overrides)
        found = outcome(document)
        kinds[found.kind] += 1
        slow.append((found.seconds, index, found.kind))
        print(f"{index}: {found.seconds:.1f} s, {found.kind}: {found.words!r}", flush=True)
        for edits in found.suggestions:
            changes = [f"{place}={json.dumps(value)}" for place, value in edits.items()]
            cured = outcome(overridden(document, changes))
            works = "worked" if cured.kind == "solved" else "FAILED"
            tried[works] += 1
            print(f"    {works}: {changes}, {cured.seconds:.1f} s, {cured.words!r}", flush=True)
    print(f"outcomes: {dict(kinds)}; cures: {dict(tried)}")
    print(
        "slowest:",
        *(f"{seconds:.1f} s: {kind} ({index})" for seconds, index, kind in sorted(slow)[-10:]),
        sep="\n  ",
    )


if __name__ == "__main__":
    main()
