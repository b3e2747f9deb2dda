"""The sections of a report, from the values that were found."""

import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import attrs
import tomli_w

from gen_profile.assurance.verification.verdict import Check
from gen_profile.delivery.designs.design import Design
from gen_profile.dynamics.evaluation.demands import axis_demands, demands
from gen_profile.dynamics.evaluation.motion_evaluation import MotionEvaluation
from gen_profile.dynamics.evaluation.phrases import bound, machine, mm, number, place_unit
from gen_profile.dynamics.problem.limits import LIMIT_TOLERANCE
from gen_profile.methods.solvers.solution import Solution
from gen_profile.motion.metrics import excursion, extremes
from gen_profile.presentation.charts.comparison import compared_styles, comparison_figure
from gen_profile.presentation.charts.curves import (
    hamiltonian_figure,
    motion_figure,
    select_machines,
    spectrum_figure,
    sway_figure,
)
from gen_profile.presentation.charts.figure import PLAIN
from gen_profile.presentation.charts.robustness import curves_figure, maps_figure
from gen_profile.presentation.charts.side_view import path_figure
from gen_profile.presentation.report.animation import animation
from gen_profile.presentation.report.content import (
    Block,
    Listing,
    Section,
    Share,
    Table,
    TableRow,
    Terms,
    Verdict,
)
from gen_profile.presentation.report.measured import Measured
from gen_profile.presentation.report.measured_section import measured_section
from gen_profile.spec.model import Spec
from gen_profile.studies.comparison.candidates import own_method
from gen_profile.studies.comparison.compare import Comparison
from gen_profile.studies.comparison.robustness import Robustness, error_grid, robustness_of

MOST_CURVES = 4  # parameters that have a curve each
MAPPED = 4  # methods that have a map each
MOST_LISTED = 40  # scenarios; the worst of them say enough
GROUPED = ("how many", "median (mm)", "99 % (mm)", "worst (mm)", "verdict")
_TABLES = tomllib.loads((Path(__file__).parents[2] / "lists" / "figures.toml").read_text("utf-8"))
# head → figure, and how many of the head's unit make one of the figure's
COMPARED: dict[str, tuple[str, float]] = _TABLES["report"]


def verdict(check: Check) -> Verdict:
    """Say first what a reader wants to know: may this be deployed."""
    if not check.passed:
        return Verdict(word="Failed.", passed=False, sentences=check.reasons())
    load, finding = check.worst
    tried = len(check.judged)
    return Verdict(
        word="Passed.",
        passed=True,
        sentences=(
            f"After the move the {load} sways by {mm(finding.residual[load])} at most "
            f"({machine(finding.scenario.name)}), and {mm(check.limit[load])} are allowed.",
            f"Co-simulated from the written file in {tried} scenario{'s' if tried > 1 else ''}; "
            f"integration error below {bound(check.error_bound)}, counted against the margin.",
            *(f"Warning: {sentence}" for sentence in check.warnings()),
        ),
    )


def facts(
    spec: Spec, evaluation: MotionEvaluation, figures: Mapping[str, float], check: Check
) -> list[tuple[str, str]]:
    """Name the few numbers that say what the motion is."""
    load, finding = check.worst
    margin, several = check.limit[load] - finding.residual[load] - check.error_bound, len(spec.axis) > 1
    command = evaluation.command
    return [
        ("Duration", f"{number(evaluation.motion.duration)} s"),
        *(
            (f"Peak {one.quantity}" + f", {one.axis.name}" * several, f"{number(one.asked)} {one.unit}")
            for one in demands(spec, command)
            if one.quantity != "jerk" or not several
        ),
        *(
            ("Excursion" + f", {axis.name}" * several, f"{number(excursion(command, column))} {axis.unit}")
            for column, axis in enumerate(spec.machine().actuated)
        ),
        ("Sway on the way, nominal", mm(figures["sway_transient_peak_m"])),
        (f"Residual sway of the {load}, worst", mm(finding.residual[load])),
        ("Margin left", mm(margin)),
        *_wind(check),
    ]


def sections(
    outcome: Design, check: Check, comparison: Comparison | None, measured: Measured | None
) -> Iterator[Section]:
    """Put the report in the order in which an engineer asks."""
    spec, evaluation, shown = outcome.spec, outcome.plan.evaluation, select_machines(outcome.plan.evaluation)
    if measured is not None:
        yield measured_section(spec, evaluation, measured)
    words = "All machines follow the same setpoints. Dashed: where the loads would be if nothing swung."
    played = animation(spec, evaluation, shown, check.arrival)
    yield Section(title="The machine plays the move", words=[words], blocks=[played])
    if outcome.plan.passage is not None and check.nearest is not None:
        near, gained = check.nearest, outcome.plan.passage.gained(evaluation.motion.duration)
        kept = f"The clearance on {machine(near.scenario.name)}: {near.nearness(spec.path)}."
        over = path_figure(spec, evaluation)
        yield Section(title="Over the stacks", words=[f"{gained}.", kept], blocks=[over])
    limits = _limits(spec, evaluation, outcome.figures, check)
    yield Section(title="Limits and margins", blocks=[limits])
    figures = [motion_figure(spec, evaluation), spectrum_figure(spec, evaluation)]
    yield Section(title="The motion", blocks=figures)
    sways = sway_figure(spec, evaluation, shown, check.arrival)
    yield Section(title="The loads", blocks=[sways, *_scenarios(check)])
    robust = _robustness(spec, evaluation, comparison)
    if robust is not None:
        yield robust
    if comparison is not None:
        yield _methods(comparison)
    yield _evidence(outcome)
    yield _files(outcome)


def _wind(check: Check) -> list[tuple[str, str]]:
    if check.wind is None:
        return []
    held = f"held aside by a wind of {check.wind.force:g} N"
    return [(f"The {load}, {held}", mm(aside)) for load, aside in check.wind.loads.items()]


def _limits(spec: Spec, evaluation: MotionEvaluation, figures: Mapping[str, float], check: Check) -> Table:
    """Hold every limit of the spec against what the motion takes of it."""
    rows = [*_axis_limits(spec, evaluation)]
    if spec.limits.sway is not None:
        rows.append(_limit("sway on the way", figures["sway_transient_peak_m"], spec.limits.sway, "mm", 1e3))
    if check.overshoot_limit is not None:
        passed = max(finding.overshoot or 0.0 for finding in check.judged) + check.error_bound
        words = "how far the load passes its target, error included"
        rows.append(_limit(words, max(passed, 0.0), check.overshoot_limit, "mm", 1e3))
    for load, limit in check.limit.items():
        worst = max(finding.residual[load] for finding in check.judged) + check.error_bound
        rows.append(_limit(f"residual sway of the {load}, error included", worst, limit, "mm", 1e3))
    return Table(head=("", "takes", "allowed", "margin", "share"), rows=rows)


def _axis_limits(spec: Spec, evaluation: MotionEvaluation) -> Iterator[TableRow]:
    for column, axis in enumerate(spec.machine().actuated):
        for one in axis_demands(spec, evaluation.command, column):
            name = f"{one.quantity} of {axis.name}"
            if one.allowed is None:
                yield TableRow(cells=(name, f"{number(one.asked)} {one.unit}", "no limit stated", "", ""))
            else:
                yield _limit(name, one.asked, one.allowed, one.unit, rounding=LIMIT_TOLERANCE)
        unit, factor = place_unit(spec, column)
        least, most = (factor * end for end in extremes(evaluation.command, 0, column))
        taken, travel = f"{number(least)} to {number(most)} {unit}", spec.limits.of(column).travel
        if travel is None:
            yield TableRow(cells=(f"travel of {axis.name}", taken, "no limit stated", "", ""))
        else:
            low, high = (factor * end for end in travel)
            margin = f"{number(min(least - low, high - most))} {unit}"
            allowed = f"{number(low)} to {number(high)} {unit}"
            yield TableRow(cells=(f"travel of {axis.name}", taken, allowed, margin, ""))


def _limit(
    name: str, taken: float, allowed: float, unit: str, factor: float = 1.0, *, rounding: float = 0.0
) -> TableRow:
    texts = (f"{number(factor * value)} {unit}" for value in (taken, allowed, allowed - taken))
    mark = "failed" if (1.0 - rounding) * taken > allowed else ""
    return TableRow(cells=(name, *texts, Share(taken / allowed)), mark=mark)


def _scenarios(check: Check) -> Iterator[Table]:
    """Sum up the groups of scenarios, where there are several, and list the worst scenarios."""
    groups = check.to_dict()["groups"]
    if len(groups) > 1:
        yield Table(head=("scenarios", "", *GROUPED), rows=[_group(group) for group in groups], words=2)
    loads = list(check.limit)
    worst_first = sorted(check.findings, key=check.fraction_after, reverse=True)
    rows = []
    for finding in worst_first[:MOST_LISTED]:
        sways = (number(1e3 * finding.residual[load]) for load in loads)
        mark = "" if check.keeps_limit(finding) else "failed"
        share = Share(check.fraction_after(finding))
        cells: list[str | Share] = [machine(finding.scenario.name), *sways, share, mark or "passed"]
        rows.append(TableRow(cells=cells, mark=mark))
    what = "scenario" if len(rows) == len(worst_first) else f"the worst of {len(worst_first)} scenarios"
    head = (what, *(f"{load} (mm)" for load in loads), "share of the limit", "verdict")
    yield Table(head=head, rows=rows)


def _group(group: Mapping[str, Any]) -> TableRow:
    sways = (group["quantiles_m"]["0.5"], group["quantiles_m"]["0.99"], group["worst"]["residual_peak_m"])
    mark, uncounted = "" if group["passed"] else "failed", "" if group["counts"] else ", not counted"
    cells = [group["group"], group["what"], str(group["rows"]), *(number(1e3 * sway) for sway in sways)]
    return TableRow(cells=[*cells, f"{mark or 'passed'}{uncounted}"], mark=mark)


def _robustness(spec: Spec, evaluation: MotionEvaluation, comparison: Comparison | None) -> Section | None:
    """Draw residual sway over the error of every uncertain parameter, and over two of them together.

    None where the spec states none. Where there are many, those are drawn with which the design sways most.
    """
    own, names = own_method(spec), list(spec.robustness.uncertain)
    if not names:
        return None
    motions, styles = {own: evaluation.motion}, {own: PLAIN}
    if comparison is not None:
        motions = {row.method: row.evaluation.motion for row in comparison.rows} | motions
        styles |= compared_styles(comparison)
    curves = {name: robustness_of(spec, motions, error_grid(spec, (name,))) for name in names}
    telling = sorted(names, key=lambda name: float(curves[name].fraction(own).max()), reverse=True)
    drawn = {name: one for name, one in curves.items() if name in telling[:MOST_CURVES]}
    figure = curves_figure(drawn, styles)
    if len(names) > MOST_CURVES:
        more = f" Of {len(names)} uncertain parameters those {MOST_CURVES} with which it sways most."
        figure = attrs.evolve(figure, caption=figure.caption + more)
    figures = [figure]
    if len(names) > 1:
        shown = [own, *(method for method in motions if styles[method].shown and method != own)][:MAPPED]
        both = {method: motions[method] for method in shown}
        pair = [name for name in names if name in telling[:2]]
        figures.append(maps_figure(robustness_of(spec, both, error_grid(spec, pair))))
    words = " ".join(_reach(name, one, own) for name, one in curves.items())
    return Section(title="Robustness", words=[words], blocks=figures)


def _reach(name: str, curve: Robustness, own: str) -> str:
    """Say between which errors every load keeps its limit."""
    reach = curve.insensitivity(own)
    if reach is None:
        return f"On the machine as specified a load exceeds its limit, whatever {name}."
    low, high = (f"{100.0 * end:+.3g}\N{NO-BREAK SPACE}%".replace("-", "−") for end in reach)
    (errors,) = curve.errors.values()
    if reach == (errors[0], errors[-1]):
        return f"Every load keeps its limit over all errors of {name} tried, {low} to {high}."
    return f"Every load keeps its limit while the error of {name} is between {low} and {high}."


def _methods(comparison: Comparison) -> Section:
    spec = comparison.spec
    own = own_method(spec)
    head = ("method", *(head.format(comparison.unit) for head in COMPARED), "keeps the limit", "Pareto front")
    rows = []
    for row in comparison.rows:
        figures = (number(factor * row.figures[key]) for key, factor in COMPARED.values())
        answers = ("yes" if row.safe else "no", "yes" if row.method in comparison.efficient else "")
        mark = "own" if row.method == own else ""
        rows.append(TableRow(cells=(row.method, *figures, *answers), mark=mark))
    blocks: list[Block] = [Table(head=head, rows=rows)]
    if comparison.rows:
        figure = comparison_figure(comparison)
        more = " Click on a method's name to show or hide its curves."
        blocks.append(attrs.evolve(figure, caption=figure.caption + more))
    return Section(
        title="Beside other methods",
        words=(
            "The same move by optimal motions and input shapers on the same machines; this design's is bold.",
            *comparison.advice(),
            *comparison.missing(),
        ),
        blocks=blocks,
    )


def _evidence(outcome: Design) -> Section:
    solution, passage = outcome.plan.solution, outcome.plan.passage
    if passage is not None:
        words = (
            "The hoist's motion is known in closed form, and the trolley's was found by "
            f"{passage.programs} convex programs in {outcome.plan.solver_time:.2g} s; machines all over the "
            "ranges were followed afterwards."
        )
        return Section(title="Solver evidence", words=(words,), blocks=[])
    if solution is None:
        base, method = outcome.spec.solver.base, outcome.spec.solver.method
        words = f"The motion is a {base} move through the shaper {method}; nothing was optimised."
        return Section(title="Solver evidence", words=(words,), blocks=[])
    optimum = solution.raise_for_status()
    blocks: list[Block] = [Terms(rows=[*_solver(solution)])]
    if optimum.hamiltonian is not None:
        blocks.append(hamiltonian_figure(optimum.knots, optimum.hamiltonian))
    return Section(title="Solver evidence", blocks=blocks)


def _solver(solution: Solution) -> Iterator[tuple[str, str]]:
    optimum = solution.raise_for_status()
    yield "Method", f"{solution.method}: {solution.status.value[0].lower()}{solution.status.value[1:]}"
    yield "Iterations", f"{solution.iterations} on {len(optimum.knots) - 1} intervals"
    yield "Last step", f"{solution.residual:.1e}, relative"
    yield "Cost", f"{optimum.cost:.6g} with β = {optimum.sway_weight:.4g} and γ = {optimum.sway_scale:.4g}/m"
    if optimum.defect is not None:
        yield "Defect", f"{optimum.defect:.1e}: what the canonical equations miss between nodes, relative"
    if optimum.hamiltonian_variation is not None:
        yield "Hamiltonian", f"constant to {optimum.hamiltonian_variation:.1e} of its size"
    if solution.redundant:
        names = ", ".join(solution.redundant)
        yield "Left out", f"sensitivities to {names}: {solution.redundancy}"
    if solution.worst_case_bound is not None:
        least = mm(solution.worst_case_bound)
        yield "Lower bound", f"no motion brings the worst machine below {least}, for small angles"


def _files(outcome: Design) -> Section:
    spec = outcome.spec
    rows = [TableRow(cells=(a.format, a.path, str(a.bytes), a.sha256)) for a in outcome.artefacts]
    table = Table(head=("format", "file", "bytes", "SHA-256"), rows=rows, words=2, code=True)
    hashes = {"Spec": spec.sha256(), "Motion": outcome.plan.evaluation.command.payload_hash()}
    if spec.plant.file is not None:
        hashes[f"Machine {spec.plant.file.name}"] = spec.plant.file.sha256
    if spec.check.foreign is not None:
        hashes[f"Judge {spec.check.foreign.name}"] = spec.check.foreign.sha256
    words = "gen-profile writes these very bytes for this spec in these formats"
    words += "." if outcome.passed else ", where it may keep what failed its check: this did."
    digests = Terms(rows=[(f"{name}, SHA-256", digest) for name, digest in hashes.items()])
    whole = Listing(title="The whole spec", text=tomli_w.dumps(spec.to_dict()))
    return Section(title="Files", words=[words], blocks=[table, digests, whole])
