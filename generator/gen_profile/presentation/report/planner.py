"""The proof of a planner block as a page: the worst history in full, and where it sways most."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from shlex import quote
from typing import Any

import attrs
import tomli_w

from gen_profile.assurance.proof.check import BlockJudgement, check_block
from gen_profile.assurance.proof.closed_loop import Trace, trace
from gen_profile.assurance.proof.histories import Histories, History
from gen_profile.assurance.proof.verdict import LISTED, JudgedHistory, Proof
from gen_profile.dynamics.evaluation.phrases import MANIFEST_WORDS, UNPROMISED, companions, mm, number
from gen_profile.presentation.charts.proof import (
    damping_figures,
    history_figure,
    lateness_figure,
    map_figure,
    worst_damped,
)
from gen_profile.presentation.report.content import (
    Listing,
    Page,
    Section,
    Share,
    Table,
    TableRow,
    Terms,
    Verdict,
    machine_data,
)
from gen_profile.presentation.report.page import render, require_pages
from gen_profile.spec.model import Spec
from gen_profile.support.artefacts.manifest import sha256
from gen_profile.support.artefacts.reading import read_artefact
from gen_profile.support.progress import Progress, no_progress
from gen_profile.support.units import RATES


@attrs.frozen(kw_only=True, eq=False)
class PlannerReport:
    """A page, and the proof that it tells of."""

    judgement: BlockJudgement
    content: bytes

    def faults(self) -> tuple[str, ...]:
        """Say why the proof failed; a sentence each."""
        return self.judgement.check.reasons()

    def to_dict(self, path: Path) -> dict[str, Any]:
        """Nest plain values for JSON."""
        page = {"path": str(path), "sha256": sha256(self.content), "bytes": len(self.content)}
        return {**self.judgement.to_dict(), "report": page}


def planner_report(
    path: Path, *, fields: Sequence[tuple[str, str]] = (), progress: Progress = no_progress
) -> PlannerReport:
    """Prove a written planner block again, and put what was found on one page.

    Parameters
    ----------
    path : Path
        The block, with its manifest beside it.
    fields : sequence of (str, str)
        As of `gen_profile.presentation.report.build.report`.
    progress : callable
        Told what is being done.

    Raises
    ------
    GenProfileError
        As `gen_profile.assurance.proof.check.check_block`; or a library is not installed.
    """
    require_pages()
    judgement = check_block(path, progress=progress)
    spec, worst = judgement.spec, judgement.check.worst
    histories, damped = Histories.of(spec), worst_damped(judgement.check)
    followed = trace(spec, judgement.text, histories, worst.history, progress)
    gusty = trace(spec, judgement.text, histories, damped.history, progress) if damped else None
    progress("writing the report")
    page = _page(judgement, followed, gusty).with_fields(fields)
    return PlannerReport(judgement=judgement, content=render(page))


def _page(judgement: BlockJudgement, followed: Trace, gusty: Trace | None) -> Page:
    spec, proof = judgement.spec, judgement.check
    units = spec.machine().units
    ranges = spec.planner.live.items()
    live = ", ".join(f"{name} {low:g} to {high:g} {units[name]}" for name, (low, high) in ranges)
    return Page(
        title=spec.name,
        subtitle=f"{spec.machine().summary}: planner block; live parameters: {live or 'none'}",
        machine=machine_data(spec),
        verdicts=[_verdict(proof, judgement.path)],
        facts=_facts(proof),
        sections=[*_sections(judgement, followed, gusty)],
    )


def _verdict(proof: Proof, path: Path) -> Verdict:
    """Say first whether the block may be deployed, and how to see the worst history again."""
    command = f"gen-profile check {quote(path.name)} --history {proof.worst.number}"
    again = f"{command} runs the worst history again."
    if not proof.passed:
        return Verdict(word="Failed.", passed=False, sentences=[*proof.reasons(), again])
    load = _worst_load(proof, proof.worst)
    found = (
        f"After the last command the {load} sways by {mm(proof.worst.residual[load])} at most (history "
        f"{proof.worst.number} of {proof.count}, drawn with the seed {proof.seed}), and "
        f"{mm(proof.limit[load])} are allowed."
    )
    return Verdict(
        word="Passed.",
        passed=True,
        sentences=[
            *_trial(proof),
            found if proof.worst.promise else "No residual sway is judged.",
            "Every history kept velocity, acceleration, jerk and travel in every cycle, and came to rest.",
            *_left_swinging(proof),
            again,
            *(f"Warning: {sentence}" for sentence in proof.warnings()),
        ],
    )


def _trial(proof: Proof) -> Iterator[str]:
    """Say that too few histories were tried for a proof."""
    if proof.kind == "trial":
        yield f"This is a trial, no proof: {proof.carried_by}."


def _left_swinging(proof: Proof) -> Iterator[str]:
    """Say in how many histories nothing is promised, so that no sway counts."""
    if count := sum(not one.promise for one in proof.judged):
        yield (
            f"In {count} of {len(proof.judged)} the block promises nothing at the end, as after a quick "
            "stop: the sway that is left then is not judged."
        )


def _facts(proof: Proof) -> list[tuple[str, str]]:
    worst = proof.worst
    load = _worst_load(proof, worst)
    swaying = max(one.on_the_way[load] for one in proof.judged)
    resting = max(one.rests_after or 0.0 for one in proof.judged)
    return [
        ("Histories", f"{len(proof.judged)}"),
        (f"Residual sway of the {load}, worst", _residual(worst, load)),
        ("Share of its limit", Share(proof.fraction(worst)).percent if worst.promise else "not judged"),
        ("Sway on the way, worst", mm(swaying)),
        ("Standstill after the last command", f"{number(resting)} s at most"),
    ]


def _sections(judgement: BlockJudgement, followed: Trace, gusty: Trace | None) -> Iterator[Section]:
    """Put the page in the order in which an engineer asks."""
    spec, proof = judgement.spec, judgement.check
    worst = proof.worst
    started = f"{len(worst.history.commands)} commands from {worst.history.start_words} on"
    words = f"History {worst.number}: {started}{_given(spec, worst.history)}."
    commands = Listing(title="Its commands", text=_commands(worst.history))
    figure = history_figure(spec, proof, followed)
    yield Section(title="The worst history", words=[words], blocks=[figure, commands])
    if gusty is not None and (damped := worst_damped(proof)) is not None:
        words = (
            f"History {damped.number}, of those with a sound sensor and gusts the one after which most "
            f"remains{_given(spec, damped.history)}."
        )
        figures = damping_figures(spec, proof, gusty)
        yield Section(title="Damping by the sensor", words=[words], blocks=figures)
    if len(proof.judged) > 1:
        yield Section(title="Where it sways most", blocks=[map_figure(spec, proof), _ranking(spec, proof)])
    if proof.lateness.latest is not None:
        yield Section(
            title="How soon commands are obeyed",
            words=[f"{proof.lateness.words()}.", f"{proof.tightness()}."],
            blocks=[lateness_figure(proof), _lateness(proof)],
        )
    yield Section(title="Limits and margins", blocks=[_limits(spec, proof)])
    yield Section(title="How it was proved", blocks=[_groups(proof), Terms(rows=[*_proved(proof)])])
    files = [
        (f"{judgement.path.name}, SHA-256", sha256(read_artefact(judgement.path))),
        ("Manifest", MANIFEST_WORDS[judgement.manifest]),
        ("Exported with it", companions(judgement.companions) or "nothing"),
        ("Spec, SHA-256", spec.sha256()),
    ]
    whole = Listing(title="The whole spec", text=tomli_w.dumps(spec.to_dict()))
    yield Section(title="Files", blocks=[Terms(rows=files), whole])


def _given(spec: Spec, history: History) -> str:
    """Continue a sentence by what the block is given in a history."""
    given = history.reported(spec.machine().units)
    return f"; the block is given {given}" if given else ""


def _worst_load(proof: Proof, judged: JudgedHistory) -> str:
    """Name the load that takes up the greatest share of its limit in a history."""
    return max(proof.limit, key=lambda load: judged.residual[load] / proof.limit[load])


def _residual(judged: JudgedHistory, load: str) -> str:
    """Say by how much a load sways in the end, and whether that was to be."""
    return mm(judged.residual[load]) + ("" if judged.promise else UNPROMISED)


def _commands(history: History) -> str:
    """Write a history's commands as the table that `planner play` reads."""
    rows = [["time_s", "command", *(axis.of("value") for axis in history.axes.values())]]
    for one in history.commands:
        values = [f"{value:.6g}" for value in one.values] or [""] * len(history.axes)
        rows.append([f"{one.time:.6g}", one.command, *values])
    return "\n".join(map(",".join, rows))


def _ranking(spec: Spec, proof: Proof) -> Table:
    ranked = sorted(proof.judged, key=proof.fraction, reverse=True)[:LISTED]
    live, units = list(ranked[0].history.live), spec.machine().units

    def row(one: JudgedHistory) -> TableRow:
        values = [number(one.history.live[name]) for name in live]
        load = _worst_load(proof, one)
        fraction = Share(proof.fraction(one)) if one.promise else "not judged"
        cells = [f"{one.number}", one.group, *values, f"{load} {_residual(one, load)}", fraction]
        return TableRow(cells=cells, mark="failed" if proof.fraction(one) > 1.0 else "")

    live_columns = (f"{name} ({units[name]})" for name in live)
    head = ("history", "group", *live_columns, "residual sway", "share of its limit")
    return Table(head=head, rows=[row(one) for one in ranked], words=2)


def _limits(spec: Spec, proof: Proof) -> Table:
    """Hold every limit against what all histories together take of it."""
    rows = []
    for column, axis in proof.worst.history.axes.items():
        own = spec.limits.of(column)
        for name, per in RATES.items():
            fraction = max(one.limits[f"{axis.prefix}{name}"] for one in proof.judged)
            limit, unit = getattr(own, name), f"{axis.unit}{per}"
            title = f"{name} of {axis.name}" if axis.name else name
            cells = (title, f"{number(fraction * limit)} {unit}", f"{number(limit)} {unit}", Share(fraction))
            rows.append(TableRow(cells=cells, mark="passed" if fraction <= 1.0 + 1e-9 else "failed"))
    for load, limit in proof.limit.items():
        promised = [one.residual[load] for one in proof.judged if one.promise]
        if not promised:
            continue
        worst = max(promised) + proof.error_bound
        cells = (f"residual sway of the {load}, error included", mm(worst), mm(limit), Share(worst / limit))
        rows.append(TableRow(cells=cells, mark="passed" if worst <= limit else "failed"))
    return Table(head=("", "takes", "allowed", "share"), rows=rows)


def _lateness(proof: Proof) -> Table:
    """List the kinds of commands, and of each the latest beside what is possible."""
    rows = []
    for one in proof.lateness.table():
        worst, by_quickest = one["worst"], one["by_quickest"]
        possible = worst["quickest_s"] or worst["closed_form_s"]
        ratios = (
            f"{by_quickest['0.5']:.2f}, {by_quickest['1']:.2f} at most" if by_quickest else "not compared"
        )
        cells = (
            one["command"],
            f"{one['commands']}",
            f"{one['late']}",
            ratios,
            f"{worst['takes_s']:.3g} s for {possible:.3g} s, {worst['state']}",
            f"{worst['history']} at {worst['time_s']:.2f} s",
        )
        rows.append(TableRow(cells=cells, mark="failed" if proof.demanded and one["late"] else ""))
    head = ("commands", "timed", "late", "time by the quickest, median", "the latest", "history")
    return Table(head=head, rows=rows, words=1)


def _groups(proof: Proof) -> Table:
    rows = []
    for group in proof.to_dict()["groups"]:
        quantiles = [Share(share).percent for share in group["quantiles"].values()]
        cells = [group["what"], f"{group['histories']}", *quantiles, Share(group["worst_share"])]
        rows.append(TableRow(cells=cells))
    return Table(head=("histories", "how many", "median", "90 %", "99 %", "worst"), rows=rows)


def _proved(proof: Proof) -> Iterator[tuple[str, str]]:
    yield "Seed", f"{proof.seed}, which makes every history again"
    same = f"apart by {proof.apart:.1e} m at most" if proof.apart else "the same to the last bit"
    yield "Co-simulated by FMPy, too", f"{len(proof.by_fmpy)} histories, {same}"
    yield "Numerical error", f"below {mm(proof.error_bound)}, counted against the margin"
