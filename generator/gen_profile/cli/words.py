"""Outcomes in words and tables for people."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from io import StringIO
from pathlib import Path
from shutil import get_terminal_size
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from rich import box
from rich.console import Console, JustifyMethod
from rich.table import Table

from gen_profile.assurance.certificate.document import certificate_path
from gen_profile.dynamics.evaluation.phrases import MANIFEST_WORDS, UNPROMISED, companions, mm, named, number
from gen_profile.support.units import RATES

if TYPE_CHECKING:
    from gen_profile.assurance.certificate.document import Certificate
    from gen_profile.assurance.proof.check import BlockJudgement
    from gen_profile.assurance.proof.verdict import JudgedHistory, Proof
    from gen_profile.assurance.verification.check import Judgement
    from gen_profile.assurance.verification.origin import JudgedFile
    from gen_profile.assurance.verification.verdict import Check
    from gen_profile.delivery.designs.design import Design
    from gen_profile.delivery.designs.planner import Deployment
    from gen_profile.presentation.report.build import Report
    from gen_profile.presentation.report.planner import PlannerReport
    from gen_profile.spec.model import Spec
    from gen_profile.studies.comparison.compare import Comparison
    from gen_profile.studies.comparison.robustness import Robustness
    from gen_profile.studies.sweep.library import Library
    from gen_profile.studies.sweep.lookup import LookupResult
    from gen_profile.studies.sweep.run import Sweep


WORTH_TELLING = 1.001  # times the cost, from which on a motion is another one
VERY_FAR = 0.7  # rad, from which on others were found to cost less although two starts led to the same one
COSTLY_LAG = 2.0  # times the motion's acceleration from which a warning is due
COSTLY_OVERSHOOT = 0.1  # of the sway on the way, likewise

_TABLES = tomllib.loads((Path(__file__).parents[1] / "lists" / "figures.toml").read_text("utf-8"))
# head → unit, figure, how many of the unit make one of the figure's
COLUMNS: dict[str, tuple[str, str, float]] = _TABLES["terminal"]
WIDEST = 200  # characters of a table, wherever no terminal says how many it has
# what the names of a comparison are
METHODS = (
    "optimal-betaN: the optimal motion with cost.sway_weight = N; -orderN, -range: with another robustness.\n"
    "All others are input shapers, which --method NAME takes."
)

_Column = tuple[str, JustifyMethod, Sequence[str]]  # its head, where its cells stand, and they


def design(outcome: Design, certificates: Mapping[Path, Certificate] = MappingProxyType({})) -> str:
    """Tell what was designed, how it was judged, what is proved of each file, and where they lie."""
    solution, figures = outcome.plan.solution, outcome.figures
    solver = f"{outcome.spec.solver.method} shaper, fed with a {outcome.spec.solver.base} move"
    passage = outcome.plan.passage
    if passage is not None:
        solver = f"over stacks, {passage.programs} programs in {outcome.plan.solver_time:.2g} s"
    if solution is not None:
        status, seconds = solution.status.name.lower(), outcome.plan.solver_time
        solver = f"{status} in {solution.iterations} iterations, {seconds:.2g} s"
        for cost in solution.other_costs or ():
            times = cost / solution.raise_for_status().cost
            solver += f"; another start led to {times:.4g} times the cost" if times > WORTH_TELLING else ""
    nominal, worst = (mm(figures[f"sway_residual_{which}_m"]) for which in ("peak", "worst"))
    load = outcome.spec.machine().end_load_name
    rows = [
        ("move", _move(outcome.spec)),
        ("solver", solver),
        *([] if passage is None else [("duration", passage.gained(figures["duration_s"]))]),
        *_peaks(outcome),
        ("sway on the way", f"{load} {mm(figures['sway_transient_peak_m'])}"),
        *_passed(figures, load),
        ("residual sway", f"{load} {nominal} nominal, {worst} at worst"),
        *(
            []
            if outcome.check is None
            else (*_groups(outcome.check), *_wind(outcome.check), *_nearest(outcome.check))
        ),
        ("check", _verdict(outcome.check)),
        *(row for path, proof in certificates.items() for row in (("file", path.name), *_proved(proof))),
        *_cost_of_lag(figures, outcome.spec.cost.effort),
    ]
    if assumed := _assumed(outcome.spec):
        rows.append(("defaults used", assumed))
    if solution is not None and solution.redundant:
        names = ", ".join(solution.redundant)
        rows.append(("left out", f"sensitivity to {names}: {solution.redundancy}"))
    rows += [("wrote", str(outcome.folder / artefact.path)) for artefact in outcome.artefacts]
    rows += [row for path, certificate in certificates.items() for row in _written(path, certificate)]
    return block(outcome.spec.name, rows)


def judgement(judged: Judgement, certificate: Certificate | None = None) -> str:
    """Tell how an artefact was judged, and what is proved of it."""
    check = judged.check
    findings = [
        (finding.scenario.name, _by_load(finding.residual))
        for finding in check.findings
        if finding.scenario.group == "machines" or len(check.findings) == 1
    ]
    rows = [
        ("move", _move(judged.spec)),
        *([("variant", judged.variant)] if judged.variant else []),
        *_provenance(judged),
        *findings,
        *_groups(check),
        *_wind(check),
        *_nearest(check),
        ("check", _verdict(check)),
        *([] if certificate is None else (*_proved(certificate), *_written(judged.path, certificate))),
    ]
    return block(str(judged.path), rows)


def _provenance(judged: JudgedFile) -> Iterator[tuple[str, str]]:
    yield "manifest", MANIFEST_WORDS[judged.manifest]
    if judged.companions:
        yield "exported with it", companions(judged.companions)


def _passed(figures: Mapping[str, float], load: str) -> Iterator[tuple[str, str]]:
    """Tell how far the load passes its target, where that is limited."""
    if "load_overshoot_peak_m" in figures:
        nominal, worst = (max(figures[f"load_overshoot_{which}_m"], 0.0) for which in ("peak", "worst"))
        yield "past the target", f"{load} {mm(nominal)} nominal, {mm(worst)} at worst"


def certificate(path: Path, document: Certificate) -> str:
    """Tell what a certificate proves."""
    return block(str(path), list(_proved(document)))


def _written(path: Path, certificate: Certificate) -> list[tuple[str, str]]:
    return [("wrote", str(certificate_path(path)))] if certificate.proved else []


def _proved(certificate: Certificate) -> Iterator[tuple[str, str]]:
    """Say what is proved, and of which machines."""
    machines = ", ".join(
        f"{name} from {low:.6g} to {high:.6g}" for name, (low, high) in certificate.ranges.items()
    )
    fraction = "" if certificate.fraction == 1.0 else f"{100.0 * certificate.fraction:.3g} % of "
    yield "machines", f"{fraction}all with {machines}" if machines else "the nominal one"
    bounds = _by_load(certificate.bounds)
    said = [f"{bounds}, from {certificate.arrival:.4g} s on"] if bounds else []
    if (way := certificate.on_the_way) is not None and way.bound is not None:
        said.append(f"{way.limit.load} {mm(way.bound)} at any time")
    if (kept := certificate.clearance) is not None and kept.nearer is not None:
        said.append(f"{mm(kept.nearer)} nearer than path.clearance at any time")
    most = f"at most {'; '.join(said)}" if said else "no bound"
    yield "proved" if certificate.proved else "not proved", most
    for axis, kinds in (certificate.asked or {}).items():
        bounds = ", ".join(f"{claim['bound']:.4g} {claim['unit']}" for claim in kinds.values())
        yield "setpoints", f"ask {axis} for at most {bounds}"


def deployment(outcome: Deployment) -> str:
    """Tell what planner block was written, and how it was judged."""
    count = outcome.block.modes
    rows = [("machine", f"{outcome.spec.plant.type}, {count} {'mode' if count == 1 else 'modes'}")]
    if outcome.margins is not None:
        later, times = outcome.margins.delay, outcome.margins.gain
        rows.append(("sensor margins", f"{later:.2g} s later than stated, {times:.2g} times too much"))
    rows += [("proof", "skipped")] if outcome.proof is None else _proof(outcome.proof)
    rows += [("wrote", f"{outcome.folder / file.path}, {file.bytes} bytes") for file in outcome.files]
    return block(outcome.spec.name, rows)


def block_judgement(judged: BlockJudgement) -> str:
    """Tell how a planner block was judged, or what became of one history."""
    rows = [*_provenance(judged)]
    if judged.history is None:
        return block(str(judged.path), [*rows, *_proof(judged.check)])
    worst = judged.check.worst
    commands = (
        f"{command.time:.3g} s {command.command}" + "".join(f" {value:.4g}" for value in command.values)
        for command in worst.history.commands
    )
    rows += [
        ("history", f"{worst.number}, {worst.group}, from {worst.history.start_words}"),
        ("given", worst.history.reported(judged.spec.machine().units)),
        ("commands", "; ".join(commands)),
        ("residual sway", _remains(worst)),
        ("sway on the way", _by_load(worst.on_the_way)),
        ("history kept", "passed" if judged.check.passed else "FAILED"),
    ]
    return block(str(judged.path), rows)


def _proof(proof: Proof) -> list[tuple[str, str]]:
    document, verdict = proof.to_dict(), "passed" if proof.passed else "FAILED"

    groups = []
    for group in document["groups"]:
        most = (f"{100.0 * float(q):g} % ≤ {100.0 * s:.3g} %" for q, s in group["quantiles"].items())
        shares = f"worst {100.0 * group['worst_share']:.3g} % of the limit, {', '.join(most)}"
        groups.append((f"{group['group']}, {group['histories']}", shares))
    limits = ", ".join(
        f"{axis.name} {name} {100.0 * document['limits'][axis.prefix + name]:.4g} %".lstrip()
        for axis in proof.worst.history.axes.values()
        for name in RATES
    )
    return [
        *groups,
        ("limits", limits),
        ("worst history", f"{proof.worst.number}: residual sway {_remains(proof.worst)}"),
        ("safe", "no" if proof.unsafe() else "in every history"),
        ("prompt", proof.lateness.words()),
        ("tight", proof.tightness()),
        ("how sure", proof.sureness()),
        (proof.kind, f"{verdict} on {proof.carried_by}: {100.0 * document['share']:.3g} % of the limit"),
    ]


def _remains(judged: JudgedHistory) -> str:
    return _by_load(judged.residual) + ("" if judged.promise else UNPROMISED)


def _groups(check: Check) -> list[tuple[str, str]]:
    """Sum up each group of scenarios where there is more than the machines'."""
    groups = check.to_dict()["groups"]
    return [(f"{group['group']}, {group['rows']}", _group(group)) for group in groups if len(groups) > 1]


def _group(group: Mapping[str, Any]) -> str:
    verdict = "passed" if group["passed"] else "FAILED"
    aside = "" if group["counts"] else " (counts with --strict)"
    worst = group["worst"]
    shares = ", ".join(f"{100.0 * float(q):g} % ≤ {mm(sway)}" for q, sway in group["quantiles_m"].items())
    peak = f"worst {worst['load']} {mm(worst['residual_peak_m'])} (row {worst['row']})"
    return f"{verdict}{aside}: {peak}; end load {shares}"


def _wind(check: Check) -> list[tuple[str, str]]:
    """Tell how far the wind holds the loads aside, where the spec states one."""
    if check.wind is None:
        return []
    held = f"holds aside {_by_load(check.wind.loads)} ({check.wind.machine}); not judged"
    return [(f"wind, {check.wind.force:g} N", held)]


def _nearest(check: Check) -> list[tuple[str, str]]:
    """Tell where a load comes nearest to what stands there, on which machine."""
    near = check.nearest
    return [] if near is None else [("clearance", f"{near.nearness(check.path)} ({near.scenario.name})")]


def comparison(compared: Comparison) -> str:
    """Lay the methods out side by side, below the recommendation."""
    rows = compared.rows
    columns: list[_Column] = [("method\n", "left", [row.method for row in rows])]
    for head, (unit, key, factor) in COLUMNS.items():
        cells = [number(factor * row.figures[key]) for row in rows]
        columns.append((f"{head}\n{unit.replace('m/', f'{compared.unit}/')}", "right", cells))
    kept, front = [row.safe for row in rows], [row.method in compared.efficient for row in rows]
    for head, marks in (("limit\nkept", kept), ("Pareto\nfront", front)):
        columns.append((head, "center", ["●" if mark else "" for mark in marks]))
    title, width = f"{compared.spec.name}: {_move(compared.spec)}", get_terminal_size((WIDEST, 0)).columns
    tables = _fitting(columns, width)
    return "\n".join([title, "", *compared.advice(), *tables, METHODS, *compared.missing()])


def robustness(curves: Robustness) -> str:
    """Tell how much sway each method leaves at worst, and how far off the machine may be."""
    table = Table(box=box.SIMPLE_HEAD)
    names = ", ".join(curves.errors)
    heads = ["method\n", f"worst over {names}\nmm", "machines within\nlimits"]
    if len(curves.errors) == 1:
        heads.append("all limits kept\nfrom … to")
    for index, head in enumerate(heads):
        table.add_column(head, justify="right" if index else "left")
    for method in curves.residual:
        kept = 100.0 * float((curves.fraction(method) <= 1.0).mean())
        ends = curves.insensitivity(method)
        span = "" if ends is None else f"{100.0 * ends[0]:+.1f} … {100.0 * ends[1]:+.1f} %"
        cells = (method, number(1e3 * curves.end_load(method).max()), f"{kept:.0f} %", span)
        table.add_row(*cells[: len(heads)])
    ranges = {name: (100.0 * off[0], 100.0 * off[-1]) for name, off in curves.errors.items()}
    tried = ", ".join(f"{name} {low:+.3g} … {high:+.3g} %" for name, (low, high) in ranges.items())
    title = f"{curves.spec.name}: {_move(curves.spec)}; tried {tried}"
    left_out = [f"{method}: {reason}" for method, reason in curves.left_out.items()]
    return "\n".join([title, _text(table), *left_out])


def sweep(done: Sweep) -> str:
    """Tell how many cases ended how, with an example of each failure."""
    rows = [("varied", ", ".join(f"{axis.key} ({len(axis.values)})" for axis in done.store.grid.axes))]
    for status, count in done.statuses.items():
        example = f"; {done.reasons[status]}" if status in done.reasons else ""
        rows.append((status, f"{count} of {len(done.store.grid)}{example}"))
    if done.kept:
        rows.append(("kept", f"{done.kept} that had been finished before"))
    return block(done.store.name, [*rows, ("wrote", str(done.table))])


def found_profile(nearest: LookupResult) -> str:
    """Tell which profile is nearest, and what it costs to use it."""
    expected, designed = nearest.sway
    costs = [f"{key} {value:+g}" for key, value in nearest.costs.items() if value]
    costs.append(f"worst residual sway {mm(expected)}, {mm(designed)} where it was designed for")
    rows = [
        ("asked for", ", ".join(named(nearest.asked))),
        ("nearest", f"{', '.join(named(nearest.used))} (case {nearest.row['case']})"),
        ("costs", "; ".join(costs)),
        ("check", _verdict(nearest.judgement.check)),
        *(("passed over", f"case {case}: {reason}") for case, reason in nearest.passed_over.items()),
        *(("file", str(nearest.judgement.path.parent / one["path"])) for one in nearest.row["artefacts"]),
    ]
    return block(nearest.judgement.spec.name, rows)


def library(written: Library) -> str:
    """Tell what is in a library."""
    count = len(written.profiles)
    size = f"{count} profile{'s'[: count > 1]}, {written.bytes / 1000:.4g} kB of text"
    rows = [
        ("block", f"{written.block}, {size}"),
        *zip(["wrote", *[""] * len(written.files)], map(str, written.files), strict=False),
        ("", f"{written.index} tells which is which"),
    ]
    return block(written.path.stem, rows)


def report(made: Report, path: Path) -> str:
    """Tell how the design was judged, and where the page lies."""
    rows = [("move", _move(made.design.spec)), ("check", _verdict(made.check))]
    rows += [("measured", sentence) for sentence in made.observed()]
    rows.append(("wrote", str(path)))
    return block(made.design.spec.name, rows)


def planner_report(made: PlannerReport, path: Path) -> str:
    """Tell how the planner block was judged, and where the page lies."""
    judged = made.judgement
    rows = [*_provenance(judged), *_proof(judged.check), ("wrote", str(path))]
    return block(str(judged.path), rows)


def _cost_of_lag(figures: Mapping[str, float], effort: str) -> list[tuple[str, str]]:
    """Warn where leading the drive's lag asks much more of it than the motion itself."""
    if "command_overshoot_m" not in figures:
        return []
    times = figures["command_acceleration_max_m_per_s2"] / figures["acceleration_max_m_per_s2"]
    over = figures["command_overshoot_m"]
    if times < COSTLY_LAG and over < COSTLY_OVERSHOOT * figures["sway_transient_peak_m"]:
        return []
    text = f"leading it takes {times:.1f} times the motion's acceleration and overshoots by {mm(over)}"
    gentler = "" if effort == "snap" else ', or cost.effort = "snap",'
    return [("drive lag", f"{text}; a longer move{gentler} takes less")]


def _move(spec: Spec) -> str:
    axes = zip(spec.machine().actuated, spec.move.distance, strict=True)
    distances = ", ".join(f"{axis.name} {distance:g} {axis.unit}" for axis, distance in axes)
    duration = "the shortest time" if spec.move.shortest else f"{spec.move.duration:g} s"
    ranges = (f"{name} ±{100 * fraction:g} %" for name, fraction in spec.robustness.uncertain.items())
    return ", ".join([spec.plant.type, f"{distances} in {duration}", *ranges])


def alone(outcome: Design) -> Iterator[str]:
    """Warn of a motion that was found from one start only, where others may cost less."""
    solution = outcome.plan.solution
    if solution is None or solution.optimum is None or solution.other_costs is None:
        return
    same = all(other < WORTH_TELLING * solution.optimum.cost for other in solution.other_costs)
    if not solution.other_costs or (same and solution.optimum.angle > VERY_FAR):
        which = "both starts led to this one" if solution.other_costs else "one start led to one"
        yield (
            f"The load swings so far that there may be several optimal motions, and {which}; "
            "another may cost less. Allow more time (move.duration) if this one asks for too much."
        )


def abrupt(outcome: Design) -> Iterator[str]:
    """Warn of the jerk of a shortest motion where no limit holds it: a finer mesh has a greater one."""
    from gen_profile.dynamics.evaluation.demands import demands

    for one in demands(outcome.spec, outcome.plan.evaluation.command):
        if one.quantity == "jerk" and one.allowed is None and one.asked > 0.0:
            yield (
                f"The shortest motion asks {one.axis.name} for {number(one.asked)} {one.unit}, as no limit "
                "of its jerk is stated; state limits.jerk if that is too much for drive or structure."
            )


def _assumed(spec: Spec) -> str:
    """List the values that the spec left to the type of its machine, with their sizes."""
    values, units = spec.plant.parameters, spec.machine().units
    return ", ".join(f"plant.{name} = {values[name]:g} {units[name]}" for name in spec.plant.defaults)


def _peaks(outcome: Design) -> list[tuple[str, str]]:
    from gen_profile.dynamics.evaluation.demands import axis_demands
    from gen_profile.motion.metrics import excursion

    spec, command = outcome.spec, outcome.plan.evaluation.command
    kind = "peak motion" if outcome.spec.actuator.tau is None else "peak command"
    rows = []
    for column, axis in enumerate(spec.machine().actuated):
        peaks = ", ".join(f"{number(one.asked)} {one.unit}" for one in axis_demands(spec, command, column))
        way = f"over {number(excursion(command, column))}"
        if column in spec.held():
            way = f"held at {spec.move.start[column]:g}"
        title = f"{kind}, {axis.name}" if len(spec.axis) > 1 else kind
        rows.append((title, f"{peaks}; {way} {axis.unit}"))
    return rows


def _by_load(sways: Mapping[str, float]) -> str:
    return ", ".join(f"{load} {mm(sway)}" for load, sway in sways.items())


def _verdict(check: Check | None) -> str:
    if check is None:
        return "not asked for: UNVERIFIED"
    load, finding = check.worst
    return (
        f"{'passed' if check.passed else 'FAILED'}: {load} {mm(finding.residual[load])} at worst "
        f"({finding.scenario.name}), {mm(check.limit[load])} allowed, "
        f"integration error below {mm(check.error_bound)}"
    )


def block(title: str, rows: Sequence[tuple[str, str]]) -> str:
    """Lay rows of a name and a text out below a title."""
    table = Table.grid(padding=(0, 2))
    for row in rows:
        table.add_row("", *row)
    return f"{title}\n{_text(table)}"


def _fitting(columns: Sequence[_Column], width: int) -> Iterator[str]:
    """Lay columns out side by side, in several tables that all have the first one where they are too wide."""
    first, *left = columns
    while left:
        for count in range(len(left), 0, -1):
            text = _columns([first, *left[:count]])
            if max(map(len, text.splitlines())) <= width:
                break
        yield text
        left = left[count:]


def _columns(columns: Sequence[_Column]) -> str:
    table = Table(box=box.SIMPLE_HEAD)
    for head, justify, _ in columns:
        table.add_column(head, justify=justify)
    for row in zip(*(cells for _, _, cells in columns), strict=True):
        table.add_row(*row)
    return _text(table)


def _text(table: Table) -> str:
    buffer = StringIO()
    Console(file=buffer, width=WIDEST).print(table, markup=False, highlight=False)
    return "\n".join(line.rstrip() for line in buffer.getvalue().rstrip().splitlines())
