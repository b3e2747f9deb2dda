"""Run random programs translated to C and by the tests' interpreter: ``just interpreters --count 100000``."""

from __future__ import annotations

import argparse
import ctypes
import struct
import subprocess
import sys
import tempfile
from collections import Counter
from contextlib import suppress
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from exporters.st_interpreter import FunctionBlock, StError
from exporters.st_programs import FAULT, INPUTS, SHOWN, block, draw
from lark.exceptions import LarkError

from gen_profile.support.errors import ExportError
from gen_profile_exporters.st_to_c import translate

BATCH = 500  # programs in a C file
TOGETHER = 15  # in a function block
CYCLES = 3
REFUSED = "refused"
DOUBLES = ctypes.POINTER(ctypes.c_double)
# of each program
HELPERS = ("sound", "unsound", "within", "turn", "nonzero", "whole", "rounded", "root")
NAMES = (*"cwe", *HELPERS, *(f"whole_{name}" for name in ("sum", "difference", "product")))


def runner(translation):
    """C that plays a program's cycles; it returns how many ended without a fault."""
    name = translation.name
    taken = "".join(f"fb.{name} = *in++; " for name in ("which", *INPUTS))
    shown = "".join(
        f"*out++ = fb.{name}{element}; "
        for name, length in SHOWN.items()
        for element in ([f"[{k}]" for k in range(length)] if length else [""])
    )
    body = translation.source.replace(f'#include "{name}.h"', translation.header)
    return "\n".join(
        [
            *(f"#define {function} {function}_{name}" for function in NAMES),
            body,
            f"static int run_{name}(const double *in, double *out) {{ {name} fb; {name}_init(&fb);",
            f"for (int cycle = 0; cycle < {CYCLES}; ++cycle) {{ {taken}{name}_step(&fb);",
            f"if (fb.fault_) return cycle; {shown}}} return {CYCLES}; }}",
            *(f"#undef {macro}" for macro in NAMES),
        ]
    )


def compiled(translations, folder):
    """A function from a place among these programs and their inputs to what they show, cycle by cycle."""
    programs = ", ".join(f"run_{translation.name}" for translation in translations)
    text = "\n".join(
        [
            "#define CHECKED",
            *map(runner, translations),
            f"static int (*const PROGRAMS[])(const double *, double *) = {{{programs}}};",
            "int run(int program, const double *in, double *out) { return PROGRAMS[program](in, out); }",
        ]
    )
    Path(folder, "programs.c").write_text(text)
    options = ["-std=c99", "-w", "-ffp-contract=off", "-shared", "-fPIC", "-o", "programs.so"]
    rounding = "-frounding-math"  # without it GCC 12 takes 0.0 - fabs(0.0) for -0.0
    subprocess.run(["gcc", *options, rounding, "programs.c", "-lm"], cwd=folder, check=True)
    library = ctypes.CDLL(str(Path(folder, "programs.so")))
    width = sum(max(1, length) for length in SHOWN.values())

    def run(place, rows):
        given = [float(value) for row in rows for value in row.values()]
        issued = (ctypes.c_double * (CYCLES * width))()
        cycles = library.run(place, (ctypes.c_double * len(given))(*given), issued)
        values = [tuple(issued[width * k : width * (k + 1)]) for k in range(cycles)]
        return values + [FAULT] * (cycles < CYCLES)

    return run


def interpreted(text, rows):
    """What the interpreter shows of a program, cycle by cycle."""
    found = []
    try:
        block = FunctionBlock(text)
    except (StError, LarkError):
        return REFUSED
    try:
        for row in rows:
            block.call(**row)
            parts = (block[name] for name in SHOWN)
            found.append(
                tuple(float(v) for part in parts for v in (part if isinstance(part, list) else [part]))
            )
    except StError:
        found.append(FAULT)
    return found


def bits(found):
    """Values as they are compared: to the last bit, whatever a number that is none is made of."""
    if not isinstance(found, tuple):
        return found
    return b"".join(b"none" if value != value else struct.pack("d", value) for value in found)


def blocks(programs):
    """Write programs in few texts, which are read faster, and each that may be refused in one of its own."""
    sound = [program for program in programs if not program.spoiled]
    groups = [sound[first : first + TOGETHER] for first in range(0, len(sound), TOGETHER)]
    for number, group in enumerate([*groups, *([program] for program in programs if program.spoiled)]):
        name = f"P{number}"
        yield name, block(name, ["\n".join(program.lines) for program in group]), group


def differences(programs):
    """Compare programs; gives how each one ended, and what differs in words."""
    ends, words = Counter(), []
    translations, written = {}, [*blocks(programs)]
    for name, text, _ in written:
        with suppress(ExportError):
            translations[name] = translate(text)
    with tempfile.TemporaryDirectory() as folder:
        run = compiled([*translations.values()], folder)
        for name, text, group in written:
            for number, program in enumerate(group):
                rows = [{"which": number} | row for row in program.rows]
                in_c = run([*translations].index(name), rows) if name in translations else REFUSED
                due = interpreted(text, rows)
                ends[due if due == REFUSED else FAULT if due[-1] == FAULT else "value"] += 1
                listing = "\n".join([*map(str, rows), *program.lines])
                if [*map(bits, in_c)] != [*map(bits, due)]:
                    words.append(f"{program.seed}: C {in_c}, interpreter {due}\n{listing}")
                if program.result and bits(due[0]) != bits(program.result):
                    words.append(f"{program.seed}: both {due[0]}, expected {program.result}\n{listing}")
    return ends, words


def main():
    """Compare as many programs as asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", default="programs")
    arguments = parser.parse_args()
    ends, found = Counter(), []
    last = arguments.first + arguments.count
    for first in range(arguments.first, last, BATCH):
        batch = range(first, min(last, first + BATCH))
        ended, words = differences([draw(f"{arguments.seed}-{k}", CYCLES) for k in batch])
        ends += ended
        found += words
        print(*words, f"{batch.stop - arguments.first} compared", sep="\n", flush=True)
    print(f"{arguments.count} programs: {dict(ends)}; {len(found)} differ")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
