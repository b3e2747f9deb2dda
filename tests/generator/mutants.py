"""Mutate the planner block's text in many ways, and see whether its proof fails: ``just mutants``.

A mutant changes one place of one part of the text, or one constant. It is killed where a history shows a
fault that the sound block does not show there, or leaves more sway than is allowed. Drawn are mutants that
change the block of one of the machines at least; `--seed` draws others.

Others are slower: commands of one kind are carried out later than by the sound block on average. Either is
noticed. Some are as good: axes move otherwise, without a fault and as quickly. The rest change nothing in the
first quarter of a machine's histories, after which no more are tried. Blocks are compiled by ``cc -Og``, if
there is one.
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
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from hashlib import sha256
from itertools import chain, zip_longest
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter

import attrs
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from planned_machines import GANTRY, HOIST, histories_apart, numbering

from gen_profile.assurance.proof.closed_loop import ClosedLoop
from gen_profile.assurance.proof.histories import Histories, History
from gen_profile.assurance.proof.judging import judge_run
from gen_profile.assurance.proof.numbering import CORNERS, DRAWS, RHYTHMS, SEARCH
from gen_profile.assurance.proof.promptness import KINDS
from gen_profile.assurance.proof.verdict import JudgedHistory, kind_of
from gen_profile.planner import design, execution
from gen_profile.spec.model import Spec
from gen_profile.spec.reading import parse_spec, preset_spec
from gen_profile.support.errors import GenProfileError
from gen_profile_exporters.planner.blocks import texts, whole
from gen_profile_exporters.planner.constants import PlannerConstants
from gen_profile_exporters.playback.structured_text import literal
from gen_profile_fmu.building import compiler
from gen_profile_fmu.building.compiler import Compiler

SLOWER = 0.02  # slow periods, by which a mutant is later on average
CERTAIN = 0.1  # of them, by which a quarter of the histories will do
AT_ONCE = 8  # histories between looks at whether a mutant is killed
QUARTER = 4  # share of the histories after which a machine is left on which nothing is otherwise
NOTICED = ("killed", "slower")
OPPOSITE = {"<": ">=", ">": "<=", "<=": ">", ">=": "<", "=": "<>", "<>": "="}
COMPARED = re.compile(r" (<=|>=|<>|<|>|=) ")
ASSIGNED = re.compile(r"( *(?:IF .* THEN )?)(\w+(?:\[[^]]*\])?) := (.*?);(.*)")
DECIDED = re.compile(r"( *(?:ELS)?IF) (.*) THEN(.*)")
NUMBER = re.compile(r"(?<![\w.])(\d+\.\d+(?:E[+-]?\d+)?)")
AXIS = re.compile(r"\[(n(?:Plan)?Axis)\]")
CONSTANT = re.compile(r"(?m)^\s*(c\w+) : (ARRAY \[[^]]*\] OF )?LREAL := \[?([^;\]]*)\]?;")
FACTORS = (0.5, 0.8, 1.25, 2.0)
FIRST = 2  # numbers of an array: in later ones of a polynomial little is to be seen
ROUNDING, BEYOND = 1e-5, 1e6  # numbers that are as good half as great again: of rounding, and beyond all


@attrs.frozen(kw_only=True, order=True)
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
    for path in sorted(texts.FOLDER.glob("*.st")):
        for number, line in enumerate(_code(path.read_text("ascii"))):
            for way, now in _changed(line):
                yield Mutant(way=way, part=path.stem, line=number, now=now, before=line)
    for name, _, values in CONSTANT.findall(text):
        for place, value in enumerate(values.split(",")[:FIRST]):
            if float(value):
                for factor in FACTORS:
                    yield Mutant(way="constant", part=name, line=place, now=f"{factor} *", before="")


def _code(text: str) -> list[str]:
    """Blank comments out."""
    bare = re.sub(r"\(\*.*?\*\)", lambda found: re.sub(r"[^\n]", " ", found[0]), text, flags=re.DOTALL)
    return bare.split("\n")


def _changed(line: str) -> Iterator[tuple[str, str]]:
    if "nSpent" in line or "nOperations" in line or "nWork" in line:
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
        if name[0] in "fa" and "LREAL" not in value and value != "0.0":
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
    """A machine, histories, and what became of the sound block in each, once that is tried."""

    name: str
    spec: Spec
    constants: PlannerConstants
    text: str
    histories: Histories
    drawn: Sequence[History]
    groups: Sequence[str]
    shown: list[JudgedHistory] = attrs.field(factory=list)


def machine(name: str, spec: Spec, count: int) -> Machine:
    """Draw a machine's histories."""
    histories = Histories.of(spec)
    numbered = numbering(histories, count, seed=5)
    drawn = [(numbered.group(number), numbered.history(number)) for number in range(count)]
    random.Random(name).shuffle(drawn)
    drawn.sort(key=lambda one: one[0] != RHYTHMS)  # in these most is left by errors
    apart = [(SEARCH, history) for history in histories_apart(name, histories)]
    groups, drawn = zip(*apart, *drawn, strict=True)
    return Machine(
        name=name,
        spec=spec,
        constants=design.planner_constants(spec)[1],
        text=design.planner_block(spec).text,
        histories=histories,
        drawn=drawn,
        groups=groups,
    )


def sound(one: Machine) -> list[JudgedHistory]:
    """Look at what the sound block does."""
    return [found for _, found in judged(one.spec, one.text, one.histories, one.drawn, one.groups)]


def judged(
    spec: Spec, text: str, histories: Histories, drawn: Sequence[History], groups: Sequence[str] = ()
) -> Iterator[tuple[int, JudgedHistory]]:
    """Judge history by history."""
    with ClosedLoop(spec, text, histories) as loop:
        for first in range(0, len(drawn), AT_ONCE):
            part = drawn[first : first + AT_ONCE]
            with loop.runs(part) as runs:
                for number, (history, run) in enumerate(zip(part, runs, strict=True), start=first):
                    known = {
                        "cycle": loop.cycle,
                        "number": number,
                        "group": groups[number] if groups else DRAWS,
                    }
                    yield number, judge_run(spec, run, history, **known)


def kinds_of(spec: Spec, one: JudgedHistory) -> set[str]:
    """Name the kinds of its faults."""
    fraction = one.fraction(spec.check.residual_sway, 0.0)
    return {*map(kind_of, one.faults), *(["the load sways"] if fraction > 1.0 else [])}


@contextmanager
def _parts(mutant: Mutant) -> Iterator[None]:
    """Let the block be written of altered parts."""
    with tempfile.TemporaryDirectory() as folder:
        altered, sound = Path(folder) / "blocks", texts.FOLDER
        shutil.copytree(sound, altered)
        path = altered / f"{mutant.part}.st"
        lines = path.read_text("ascii").split("\n")
        lines[mutant.line] = mutant.now
        path.write_text("\n".join(lines), "ascii")
        texts.FOLDER = whole.FOLDER = altered
        try:
            yield
        finally:
            texts.FOLDER = whole.FOLDER = sound


def mutated(machine: Machine, mutant: Mutant) -> str:
    """Write a machine's block with a change."""
    if mutant.way == "constant":
        return altered(machine.text, mutant)
    with _parts(mutant):
        return whole.whole_block(machine.constants)


def altered(text: str, mutant: Mutant) -> str:
    """Change a constant of a block's text."""

    def changed(found: re.Match[str]) -> str:
        if found[1] != mutant.part:
            return found[0]
        values = found[3].split(",")
        if mutant.line < len(values):
            values[mutant.line] = literal(float(mutant.now.split()[0]) * float(values[mutant.line]))
        return found[0].replace(found[3], ",".join(values))

    return CONSTANT.sub(changed, text)


def changes(one: Machine, mutant: Mutant) -> bool:
    """Whether a mutant is in a machine's block."""
    alone = len(one.constants.axes) == 1 and mutant.way == "axes"
    return not alone and mutated(one, mutant) != one.text


def chosen(machines: list[Machine], count: int, seed: str) -> Iterator[Mutant]:
    """Choose mutants, each way as often."""
    by_way: dict[str, list[tuple[str, Mutant]]] = {}
    for mutant in {mutant for one in machines for mutant in mutants(one.text)}:
        rank = sha256(f"{seed} {mutant}".encode()).hexdigest()
        by_way.setdefault(mutant.way, []).append((rank, mutant))
    found = 0
    for turn in chain.from_iterable(zip_longest(*(sorted(by_way[way]) for way in sorted(by_way)))):
        if turn and any(changes(one, turn[1]) for one in machines):
            yield turn[1]
            found += 1
            if found == count:
                return


def tried_on(mutant: Mutant, one: Machine) -> tuple[str, str, float, int, int]:
    """Tell what becomes of one, how, how much later, in how many histories otherwise, and of how many."""
    found_all, otherwise = list[JudgedHistory](), 0
    try:
        for number, found in judged(one.spec, mutated(one, mutant), one.histories, one.drawn, one.groups):
            sound = one.shown[number]
            if number == len(one.drawn) // QUARTER and (not otherwise or later(found_all, one)[0] > CERTAIN):
                break
            found_all.append(found)
            if new := kinds_of(one.spec, found) - kinds_of(one.spec, sound):
                return "killed", f"{one.name} {number}: {'; '.join(sorted(new))}", 0.0, 1, number
            otherwise += found.on_the_way != sound.on_the_way or found.residual != sound.residual
    except GenProfileError as error:
        return "killed", f"{one.name}: no block: {str(error)[:80]}", 0.0, 1, 0
    slowest, kind = later(found_all, one)
    how = f"{one.name}: {kind} later on average by {slowest:.2g} slow periods"
    what = "slower" if slowest > SLOWER else "as good" if otherwise else "unchanged"
    return what, how, slowest, otherwise, len(found_all)


def killed(mutant: Mutant, machines: list[Machine]) -> tuple[str, str]:
    """Tell what becomes of one on the first machine that notices it, or on all."""
    found = []
    for one in machines:
        if changes(one, mutant):
            what, how, *_ = result = tried_on(mutant, one)
            if what in NOTICED:
                return what, how
            found.append(result)
    _, how, _, _, _ = max(found, key=lambda result: result[2])
    otherwise, count = (sum(result[place] for result in found) for place in (3, 4))
    if not otherwise:
        return "unchanged", f"in {count} histories"
    return "as good", f"{how}; otherwise in {otherwise} of {count} histories"


def later(found: Sequence[JudgedHistory], one: Machine) -> tuple[float, str]:
    """Tell by how many slow periods these are later than with the sound block, on average, and in what."""
    late, before = means(found), means(one.shown[: len(found)])
    return max((late[kind] - before[kind], kind) for kind in late)


def means(histories: Sequence[JudgedHistory]) -> dict[str, float]:
    """Average in slow periods how late commands of each kind are carried out."""
    commands = [command for one in histories if one.group in (CORNERS, DRAWS) for command in one.obeyed]
    late = {
        kind: [(one.takes - one.alone) / one.period for one in commands if one.kind == kind] for kind in KINDS
    }
    return {kind: float(np.mean(values or [0.0])) for kind, values in late.items()}


CYCLE = "export.cycle_time=0.01"
MACHINES: Mapping[str, Spec] = {  # between them, they have every part of the text
    "zones": parse_spec(
        GANTRY, [CYCLE, "planner.zones=true", "planner.events=true", "check.residual_sway=0.02"]
    ),
    "hoisted": preset_spec(
        "bay-crane",
        [
            *(CYCLE, "planner.events=true", "planner.live_rate={L1=0.2}"),
            *("check.uncertain={L1=0.01}", "check.residual_sway=0.02"),
        ],
    ),
    "followed": parse_spec(
        GANTRY, [CYCLE, "planner.live_rate={L=0.1}", "check.uncertain={L=0.01}", "check.residual_sway=0.02"]
    ),
    "tight": preset_spec("bay-crane", [CYCLE, "check.residual_sway=0.025"]),
    "slow": parse_spec(
        HOIST,
        [
            *(CYCLE, "planner.live={hoist=[0.0, 4.0]}", "robustness.uncertain={L0=0.02}"),
            *("limits.velocity=2.0", "limits.acceleration=0.2", "limits.travel=[0.0, 60.0]"),
        ],
    ),
    "wide": parse_spec(
        GANTRY,
        [
            *(CYCLE, "planner.zones=true", "planner.sway_share=0.0"),
            "limits.axis.x={velocity=1.5, acceleration=0.12, jerk=1.0, travel=[0.0, 40.0]}",
            "limits.axis.y={velocity=1.0, acceleration=0.1, jerk=1.0, travel=[0.0, 20.0]}",
        ],
    ),
    "bridge": parse_spec(  # its drives take longer to full speed than pulses last, and errors count
        GANTRY,
        [
            *("export.cycle_time=0.02", "planner.live={L=[3.0, 12.0]}", "robustness.uncertain={L=0.04}"),
            "limits.axis.x={velocity=2.0, acceleration=0.15, jerk=0.2, travel=[0.0, 150.0]}",
            "limits.axis.y={velocity=0.63, acceleration=0.12, jerk=0.2, travel=[0.0, 25.0]}",
        ],
    ),
    "gyro": preset_spec(  # gusts and errors are small, so that a wrong estimate shows
        "gantry-crane",
        [
            *(CYCLE, "planner.live={L=[3.0, 9.0]}", "robustness.uncertain={L=0.005}"),
            "limits={velocity=1.0, acceleration=0.4, jerk=2.0, travel=[0.0, 20.0]}",
            'planner.sensor={quantity="rate", of=["theta_x", "theta_y"], noise=0.002, offset=0.02}',
            "planner.sensor.delay=[0.05, 0.15]",
            "planner.disturbance={swing={payload-x=0.5, payload-y=0.5}, settle=15.0}",
            "planner.disturbance.gust={acceleration=0.02, longest=5.0}",
        ],
    ),
    "damped": preset_spec("bay-crane", [CYCLE, "plant.c1=200.0"]),
    "measured": preset_spec(
        "bay-crane",
        [
            *(CYCLE, "planner.live={L1=[3.0, 9.0], m2=[500.0, 2000.0]}"),
            'planner.sensor={quantity="angle", of="theta1", noise=0.002, offset=0.005, delay=[0.05, 0.15]}',
            "planner.disturbance={swing={payload=0.5}, gust={acceleration=0.1, longest=5.0}, settle=12.0}",
        ],
    ),
}


def quick_compiler() -> Compiler:
    """Find a compiler that optimises little, as most blocks run for seconds."""
    if not shutil.which("cc"):
        return compiler.find_compiler()
    os.environ[compiler.ENVIRONMENT_VARIABLE] = "cc"
    try:
        found = compiler.find_compiler()
    finally:
        del os.environ[compiler.ENVIRONMENT_VARIABLE]
    command = tuple("-Og" if part == "-O2" else part for part in found.command)
    return attrs.evolve(found, command=command, identity=f"{found.identity} -Og")


_shared: list[Machine] = []  # of a worker, which has them from its parent


def sound_at(place: int) -> list[JudgedHistory]:
    """Look at what the sound block does on one of the machines."""
    return sound(_shared[place])


def tried(numbered: tuple[int, Mutant]) -> tuple[int, Mutant, str, str, float]:
    """Try one, and time it."""
    began = perf_counter()
    return *numbered, *killed(numbered[1], _shared), perf_counter() - began


def main() -> None:
    """Run them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100, help="mutants")
    parser.add_argument("--seed", default="mutants")
    parser.add_argument("--histories", type=int, default=192, help="of each machine")
    parser.add_argument("--machines", nargs="*", choices=MACHINES, help="just these")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", type=int, nargs="*", help="just those of these numbers")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as cache:
        os.environ["GEN_PROFILE_CACHE"] = cache  # compiled mutants are of no use later
        quick = quick_compiler()
        execution.find_compiler = lambda: quick
        _shared.extend(
            machine(name, MACHINES[name], arguments.histories) for name in arguments.machines or MACHINES
        )
        with get_context("fork").Pool(arguments.workers) as pool:
            shown = pool.map(sound_at, range(len(_shared)), chunksize=1)
        for one, found in zip(_shared, shown, strict=True):
            one.shown.extend(found)
            faults = Counter(kind for history in one.shown for kind in kinds_of(one.spec, history))
            print(f"{one.name}, sound: {dict(faults)}", flush=True)
        report(arguments)


def report(arguments: argparse.Namespace) -> None:
    """Try mutants side by side, and print what became of each, and of all."""
    tally, survivors, ways = Counter[str](), list[str](), Counter[str]()
    those = list(enumerate(chosen(_shared, arguments.count, arguments.seed)))
    drawn = [one for one in those if arguments.only is None or one[0] in arguments.only]
    with get_context("fork").Pool(arguments.workers) as pool:
        for number, mutant, what, how, took in pool.imap_unordered(tried, drawn):
            tally[what] += 1
            if what == "killed":
                ways[how.partition(": ")[2].partition(";")[0]] += 1
            elif what not in NOTICED:
                survivors.append(f"{what}: {number}: {mutant} ({how})")
            print(f"{number}: {mutant}\n    {what}: {how} ({took:.1f} s)", flush=True)
    noticed = sum(tally[what] for what in NOTICED)
    print(f"by judge: {dict(ways.most_common())}")
    print("not noticed:", *sorted(survivors), sep="\n  ")
    print(
        f"{noticed} of {len(drawn)} are noticed: {tally['killed']} killed, {tally['slower']} slower; "
        f"{tally['as good']} are as good, {tally['unchanged']} change nothing."
    )


if __name__ == "__main__":
    main()
