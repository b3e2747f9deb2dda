"""Mutate the planner block's text in many ways, and see whether its proof fails: ``just mutants``.

A mutant changes one place of one part of the text, or one constant. It is killed where a history shows a
fault that the sound block does not show there, or leaves more sway than is allowed.

Left out are mutants of lines that no machine's block has, and those that `EQUIVALENT` names. Of one that
survives, it is printed whether any axis moves otherwise in any history, and how much later it rests on
average.
"""

from __future__ import annotations

import argparse
import os
import random
import re
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter

import attrs

sys.path.insert(0, str(Path(__file__).parent))
from planned_machines import GANTRY

from gen_profile.errors import GenProfileError
from gen_profile.planner import design
from gen_profile.proof.closed_loop import ClosedLoop
from gen_profile.proof.histories import Histories, History
from gen_profile.proof.judging import judge_run
from gen_profile.proof.numbering import Numbering
from gen_profile.proof.verdict import JudgedHistory, kind_of
from gen_profile.spec.model import Spec
from gen_profile.spec.reading import parse_spec, preset_spec
from gen_profile_exporters.planner import block

AT_ONCE = 8  # histories between looks at whether a mutant is killed
OPPOSITE = {"<": ">=", ">": "<=", "<=": ">", ">=": "<", "=": "<>", "<>": "="}
COMPARED = re.compile(r" (<=|>=|<>|<|>|=) ")
ASSIGNED = re.compile(r"( *(?:IF .* THEN )?)(\w+(?:\[[^]]*\])?) := (.*?);(.*)")
DECIDED = re.compile(r"( *(?:ELS)?IF) (.*) THEN(.*)")
NUMBER = re.compile(r"(?<![\w.])(\d+\.\d+(?:E[+-]?\d+)?)")
AXIS = re.compile(r"\[(n(?:Plan)?Axis)\]")
CONSTANT = re.compile(r"(?m)^ *(c\w+) : (ARRAY \[[^]]*\] OF )?(LREAL|DINT) := \[?([^;\]]*)\]?;")
ROUNDING, BEYOND = 1e-5, 1e6  # numbers that are as good half as great again: of rounding, and beyond all
UNKNOWN = {"interface"}  # parts that hold no statements
EQUIVALENT = {  # mutants, by part and the line that they make: why a block with it is as good
    "inputs: aLiveOnce[nIndex] := aLiveOnce[nIndex];": "of the first three values two are alike all the same",
    "inputs: IF NOT (ABS(aActual[cAxes - 1 - nAxis]) <= 1.0E+9)"
    " OR NOT (ABS(aActualVelocity[nAxis]) <= 1.0E+9) THEN": "both axes are asked",
    "programme: IF nKind = cBoundJerk THEN fSteepness := 0.0 - (1.0 / fCurve); END_IF;": "it is symmetric",
    "programme: fInverseA := 0.5 * (1.0E+30);": "any number will do that is great enough",
    "programme: fInverseB := 0.5 * (1.0E+30);": "any number will do that is great enough",
}


@attrs.frozen(kw_only=True)
class Mutant:
    """One change of the text.

    Attributes
    ----------
    way : str
        How it is changed: the kind of mutation.
    part : str
        Of the text, or the name of a constant.
    line : int
        From 0; the place of a number of a constant.
    now : str
        What stands there in place of what stood there.
    before : str
    """

    way: str
    part: str
    line: int
    now: str
    before: str

    def __str__(self) -> str:
        return f"{self.way:10} {self.part}:{self.line + 1}: {self.before.strip()}  ->  {self.now.strip()}"


def mutants(text: str) -> Iterator[Mutant]:
    """Give all that there are of a block with this text (of which only constants matter)."""
    for path in sorted(block.TEXT.rglob("*.st")):
        if path.stem not in UNKNOWN:
            for number, line in enumerate(_code(path.read_text("ascii"))):
                for way, now in _changed(line):
                    if f"{path.stem}: {now.strip()}" not in EQUIVALENT:
                        yield Mutant(way=way, part=path.stem, line=number, now=now, before=line)
    for name, _, kind, values in CONSTANT.findall(text):
        for place, value in enumerate(values.split(",")):
            if kind == "LREAL" and float(value):
                for factor in (0.5, 0.8, 1.25, 2.0):
                    now = repr(factor * float(value))
                    yield Mutant(way="constant", part=name, line=place, now=now, before=value)


def _code(text: str) -> list[str]:
    """Blank comments out."""
    bare = re.sub(r"\(\*.*?\*\)", lambda found: re.sub(r"[^\n]", " ", found[0]), text, flags=re.DOTALL)
    return bare.split("\n")


def _changed(line: str) -> Iterator[tuple[str, str]]:
    if "nCost" in line or "nWork" in line:
        return  # what a cycle may cost, which another test counts
    for found in COMPARED.finditer(line):
        yield "comparison", f"{line[: found.start(1)]}{OPPOSITE[found[1]]}{line[found.end(1) :]}"
    for now, then in ((" OR ", " AND "), (" AND ", " OR ")):
        if then in line:
            yield "logic", now.join(line.split(then, maxsplit=1))
    if found := DECIDED.fullmatch(line):
        for condition in ("TRUE", "FALSE"):
            yield "branch", f"{found[1]} {condition} THEN{found[3]}"
    if found := ASSIGNED.fullmatch(line):
        before, name, value, after = found.groups()
        yield "dropped", f"{before}{name} := {name};{after}"
        if name[0] in "fa" and name != "aShapeSlots" and "LREAL" not in value and value != "0.0":
            yield "sign", f"{before}{name} := 0.0 - ({value});{after}"
            yield "halved", f"{before}{name} := 0.5 * ({value});{after}"
    for sign, other in ((" + ", " - "), (" - ", " + ")):
        if sign in line and "FOR " not in line:
            yield "sign", other.join(line.split(sign, maxsplit=1))
    for found in NUMBER.finditer(line):
        if ROUNDING < float(found[1]) < BEYOND:
            yield "number", f"{line[: found.start()]}{1.5 * float(found[1])!r}{line[found.end() :]}"
    for found in AXIS.finditer(line):
        yield "axes", f"{line[: found.start()]}[cAxes - 1 - {found[1]}]{line[found.end() :]}"


@attrs.frozen(kw_only=True, eq=False)
class Machine:
    """A machine, histories, and what became of the sound block in each."""

    name: str
    spec: Spec
    constants: block.PlannerConstants
    text: str
    histories: Histories
    drawn: list[History]
    shown: list[JudgedHistory]


def machine(name: str, spec: Spec, count: int) -> Machine:
    """Look at what the sound block does."""
    captured = list[block.PlannerConstants]()
    text_of, design.block_text = (
        design.block_text,
        lambda constants: captured.append(constants) or text_of(constants),
    )
    try:
        text = design.planner_block(spec).text
    finally:
        design.block_text = text_of
    histories = Histories.of(spec)
    numbering = Numbering.of(histories, count + count // 3, seed=5)
    drawn = [numbering.history(number) for number in range(len(numbering.drawn))]
    random.Random(name).shuffle(drawn)
    drawn = drawn[:count]
    judgements = [one for _, one in judged(spec, text, histories, drawn)]
    return Machine(
        name=name,
        spec=spec,
        constants=captured[0],
        text=text,
        histories=histories,
        drawn=drawn,
        shown=judgements,
    )


def judged(
    spec: Spec, text: str, histories: Histories, drawn: list[History]
) -> Iterator[tuple[int, JudgedHistory]]:
    """Judge history by history."""
    with ClosedLoop(spec, text, histories, workers=os.cpu_count() or 1) as loop:
        for first in range(0, len(drawn), AT_ONCE):
            part = drawn[first : first + AT_ONCE]
            with loop.runs(part) as runs:
                for number, (history, (run, faults)) in enumerate(zip(part, runs, strict=True), start=first):
                    known = {"cycle": loop.cycle, "number": number, "group": "draws"}
                    yield number, judge_run(spec, run, history, faults, **known)


def kinds_of(spec: Spec, one: JudgedHistory) -> set[str]:
    """Name the kinds of its faults."""
    fraction = one.fraction(spec.check.residual_sway, 0.0)
    return {*map(kind_of, one.faults), *(["the load sways"] if fraction > 1.0 else [])}


@contextmanager
def _parts(mutant: Mutant) -> Iterator[None]:
    """Let the block be written of altered parts."""
    with tempfile.TemporaryDirectory() as folder:
        altered = Path(folder) / "text"
        shutil.copytree(block.TEXT, altered)
        path, sound = next(altered.rglob(f"{mutant.part}.st")), block.TEXT
        lines = path.read_text("ascii").split("\n")
        lines[mutant.line] = mutant.now
        path.write_text("\n".join(lines), "ascii")
        block.TEXT = altered
        block._part.cache_clear()
        block._parts.cache_clear()
        try:
            yield
        finally:
            block.TEXT = sound
            block._part.cache_clear()
            block._parts.cache_clear()


def mutated(machine: Machine, mutant: Mutant) -> str:
    """Write a machine's block with a change."""
    if mutant.way == "constant":
        return altered(machine.text, mutant)
    with _parts(mutant):
        return block.block_text(machine.constants)


def altered(text: str, mutant: Mutant) -> str:
    """Change a constant of a block's text."""

    def changed(found: re.Match[str]) -> str:
        if found[1] != mutant.part:
            return found[0]
        values = found[4].split(",")
        if mutant.line < len(values):
            values[mutant.line] = mutant.now
        return found[0].replace(found[4], ",".join(values))

    return CONSTANT.sub(changed, text)


def chosen(machines: list[Machine], count: int, seed: str) -> list[Mutant]:
    """Choose some that are in a machine's block, each way as often, and all parts."""
    by_way: dict[str, list[Mutant]] = {}
    for mutant in mutants(machines[0].text):
        by_way.setdefault(mutant.way, []).append(mutant)
    rng = random.Random(seed)
    for those in by_way.values():
        rng.shuffle(those)
    found, ways = list[Mutant](), list(by_way)
    while len(found) < count and any(by_way.values()):
        way = ways[len(found) % len(ways)]
        if by_way[way]:
            mutant = by_way[way].pop()
            if any(mutated(one, mutant) != one.text for one in machines):
                found.append(mutant)
        else:
            ways.remove(way)
    return found


def killed(mutant: Mutant, machines: list[Machine]) -> tuple[str | None, str]:
    """Say by which judge, on which machine and in which history it is killed; or what it does otherwise."""
    later, otherwise = [], 0
    for one in machines:
        text = mutated(one, mutant)
        if text == one.text:
            continue
        try:
            for number, found in judged(one.spec, text, one.histories, one.drawn):
                sound = one.shown[number]
                if new := kinds_of(one.spec, found) - kinds_of(one.spec, sound):
                    return f"{one.name} {number}: {'; '.join(sorted(new))}", ""
                otherwise += found.on_the_way != sound.on_the_way or found.residual != sound.residual
                later.append((found.rests_after or 0.0) - (sound.rests_after or 0.0))
        except GenProfileError as error:
            return f"{one.name}: no block: {str(error)[:80]}", ""
    return (
        None,
        f"otherwise in {otherwise} of {len(later)} histories, later by {sum(later) / len(later):.3g} s",
    )


MACHINES: Mapping[str, Spec] = {
    "bay-crane": preset_spec("bay-crane", ["plant.c1=2000.0", "limits.travel=[-2.0, 41.0]"]),  # damped
    "zones": preset_spec("bay-crane", ["planner.zones=true", "check.uncertain={L1=0.02}"]),
    "gantry": parse_spec(
        GANTRY,
        [
            "planner.live_rate={L=0.1}",
            "export.cycle_time=0.004",
            "limits.axis.x.travel=[-3.0, 37.0]",
            "limits.axis.y.travel=[-1.0, 12.0]",
            "limits.axis.y.jerk=1.6",
        ],
    ),
}


def main() -> None:
    """Run them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", default="mutants")
    parser.add_argument("--histories", type=int, default=96)
    parser.add_argument("--only", type=int, help="just the one of this number")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as cache:
        os.environ["GEN_PROFILE_CACHE"] = cache  # compiled mutants are of no use later
        machines = [machine(name, spec, arguments.histories) for name, spec in MACHINES.items()]
        for one in machines:
            print(
                f"{one.name}, sound: {dict(Counter(k for h in one.shown for k in kinds_of(one.spec, h)))}",
                flush=True,
            )
        those = list(enumerate(chosen(machines, arguments.count, arguments.seed)))
        tally, survivors, ways = Counter[str](), list[str](), Counter[str]()
        for number, mutant in those if arguments.only is None else [those[arguments.only]]:
            began = perf_counter()
            by, but = killed(mutant, machines)
            tally["survived" if by is None else "killed"] += 1
            if by is None:
                survivors.append(f"{number}: {mutant} ({but})")
            else:
                ways[by.partition(": ")[2].partition(";")[0]] += 1
            print(
                f"{number}: {mutant}\n    {by or f'SURVIVED, {but}'} ({perf_counter() - began:.1f} s)",
                flush=True,
            )
        print(f"{dict(tally)}; by judge: {dict(ways.most_common())}")
        print("survivors:", *survivors, sep="\n  ")


if __name__ == "__main__":
    main()
