"""What a check found: values only, no work."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from gen_profile.dynamics.evaluation.clearance import Nearest
from gen_profile.dynamics.evaluation.scenarios import GROUPS, SEARCH, TIMING, Scenario
from gen_profile.dynamics.evaluation.static_deflection import StaticDeflection
from gen_profile.dynamics.problem.limits import SWAY_TOLERANCE
from gen_profile.spec.stacks import ROOM_TOLERANCE, StacksSpec
from gen_profile.support.errors import CheckFailed
from gen_profile.support.phrase import Phrase
from gen_profile.support.summary import Drawable, Tabled

QUANTILES = (0.5, 0.9, 0.99)  # of the residual sways of a group, as they are reported
FINE = 1e3  # µm, up to which an error is shown in these
MOST_LISTED = 50  # rows of a group; of a larger one the worst are listed: a manifest must not hold thousands


@attrs.frozen(kw_only=True)
class Finding:
    """How much one machine sways once its axes stand still.

    Attributes
    ----------
    scenario : Scenario
    residual : mapping of str to float
        Greatest sway of every load in m.
    modal : mapping of str to float
        Sum of the modes' amplitudes at standstill in m: what the sway of every load can ever reach.
    on_the_way : float or None
        Greatest sway of the end load at any time in m, where that is limited.
    nearest : Nearest or None
        Where it has the least room to stacks, if the spec has some.
    overshoot : float or None
        How far the end load passes its target at any time in m, where that is limited; negative before it.
    """

    scenario: Scenario
    residual: Mapping[str, float]
    modal: Mapping[str, float]
    on_the_way: float | None = None
    nearest: Nearest | None = None
    overshoot: float | None = None

    @property
    def room(self) -> float | None:
        """Least room to stacks beyond the clearance in m; negative where it is broken."""
        return None if self.nearest is None else self.nearest.room

    def nearness(self, path: StacksSpec | None) -> Phrase:
        """Say how near to a stack a load comes, and where."""
        assert self.nearest is not None and path is not None
        room = self.nearest.room
        template = (
            "keeps the clearance with {room:.4g} mm to spare" if room >= 0.0 else "{room:.4g} mm too near"
        )
        kept = Phrase(template, room=1e3 * abs(room))
        return Phrase(
            "{kept}: {body} at {obstacle}, after {time:.4g} s",
            kept=kept,
            body=self.nearest.body,
            obstacle=path.named(self.nearest.obstacle),
            time=self.nearest.time,
        )


class Examination:
    """What was examined passes where there is no reason against it."""

    __slots__ = ()

    def reasons(self) -> tuple[str, ...]:
        """Say why it failed, a sentence each."""
        raise NotImplementedError

    @property
    def passed(self) -> bool:
        """Whether every limit is kept, the error bound included."""
        return not self.reasons()

    def raise_for_failure(self) -> None:
        """Do nothing where it passed.

        Raises
        ------
        CheckFailed
            With the reasons.
        """
        if not self.passed:
            raise CheckFailed("\n".join(self.reasons()))


@attrs.frozen(kw_only=True, repr=False)
class Check(Drawable, Tabled, Examination):
    """Verdict on one artefact.

    Attributes
    ----------
    limit : mapping of str to float
        Allowed residual sway of every load in m; the end load is the last one, or the last `directions`.
    error_bound : float
        No residual is further than this from the truth, in m.
    arrival : float
        When the axes stand still, in s.
    findings : tuple of Finding
    directions : int
        In how many directions the end load swings.
    faults : tuple of str
        What else is wrong with the artefact, a sentence each.
    strict : bool
        Whether faults in the timing of setpoints count as well.
    sway_limit : float or None
        Allowed sway of the end load at any time in m.
    overshoot_limit : float or None
        How far the end load may pass its target in m: `limits.overshoot`, or as far as it may sway after the
        move where that is more.
    searched : int
        Number of machines that were looked at for the worst ones in the ranges.
    plausibility_warnings : tuple of str
        What the spec states and hardly means, a sentence each.
    wind : StaticDeflection or None
        What the spec's wind adds to every sway for as long as it blows, which is not judged.
    path : StacksSpec or None
        What stands in the way of the loads.
    """

    limit: Mapping[str, float]
    error_bound: float
    arrival: float
    findings: tuple[Finding, ...]
    directions: int = 1
    faults: tuple[str, ...] = ()
    strict: bool = False
    sway_limit: float | None = None
    overshoot_limit: float | None = None
    searched: int = 0
    plausibility_warnings: tuple[str, ...] = ()
    wind: StaticDeflection | None = None
    path: StacksSpec | None = None

    def summary(self) -> dict[str, object]:
        """Tell what a reader looks for first."""
        load, worst = self.worst
        return {
            "check": "passed" if self.passed else "failed",
            "machines": len(self.findings),
            "worst": f"{load} {1e3 * worst.residual[load]:.4g} mm of {1e3 * self.limit[load]:.4g} mm allowed",
        }

    def records(self) -> list[dict[str, object]]:
        """List what was tried: machine, parameters, residual sway of every load in m, and the verdict."""
        return [
            {
                "group": finding.scenario.group,
                "machine": finding.scenario.name,
                **finding.scenario.parameters,
                **{f"{load}_m": sway for load, sway in finding.residual.items()},
                "passed": self.keeps_limit(finding),
            }
            for finding in self.findings
        ]

    @property
    def groups(self) -> dict[str, tuple[Finding, ...]]:
        """Findings by group, in the order of `GROUPS`."""
        by_name = {name: tuple(one for one in self.findings if one.scenario.group == name) for name in GROUPS}
        return {name: findings for name, findings in by_name.items() if findings}

    @property
    def judged(self) -> tuple[Finding, ...]:
        """Findings that the verdict rests on."""
        counted = tuple(one for one in self.findings if self.strict or one.scenario.group != TIMING)
        return counted or self.findings

    def keeps_limit(self, finding: Finding) -> bool:
        """Whether every load keeps its limits in one scenario, the error bound included."""
        return self._share(finding) <= 1.0

    def _share_on_the_way(self, finding: Finding) -> float:
        """Share of what may be swayed at any time, the error bound included; 0 where there is no limit."""
        if self.sway_limit is None or finding.on_the_way is None:
            return 0.0
        return (finding.on_the_way + self.error_bound) / (SWAY_TOLERANCE * self.sway_limit)

    def _share_passed(self, finding: Finding) -> float:
        """Share of how far the target may be passed, the error bound included; 0 where there is no limit."""
        if self.overshoot_limit is None or finding.overshoot is None:
            return 0.0
        return (finding.overshoot + self.error_bound) / (SWAY_TOLERANCE * self.overshoot_limit)

    def _share_of_room(self, finding: Finding) -> float:
        """Tell by how much in m a load is nearer to a stack than it may be, above 1."""
        if finding.room is None:
            return 0.0
        return max(1.0 - (finding.room - self.error_bound + ROOM_TOLERANCE), 0.0)

    @property
    def nearest(self) -> Finding | None:
        """The machine that has the least room to stacks; none where there are none."""
        rooms = [one for one in self.judged if one.room is not None]
        return min(rooms, key=lambda one: one.room or 0.0) if rooms else None

    @property
    def worst(self) -> tuple[str, Finding]:
        """The load that takes up the greatest share of its limit, and where."""
        return self.worst_of(self.judged)

    def worst_of(self, findings: Sequence[Finding]) -> tuple[str, Finding]:
        """Find the load that takes up the greatest share of its limit in some scenarios, and where."""
        pairs = [(load, finding) for finding in findings for load in self.limit]
        return max(pairs, key=lambda pair: self._share_after(pair[1], pair[0]))

    def _share_after(self, finding: Finding, load: str) -> float:
        """Share of a load's limit of residual sway, the error bound included."""
        return (finding.residual[load] + self.error_bound) / self.limit[load]

    @property
    def demand(self) -> float:
        """Share of its limit that the worst load takes up; infinite where something else is wrong."""
        return float("inf") if self.faults else max(map(self._share, self.judged))

    @property
    def worst_in_ranges(self) -> float:
        """Greatest residual sway of the end load in m that was found by the search; 0 where it found none."""
        return max(map(self._end_load, self.groups.get(SEARCH, ())), default=0.0)

    def reasons(self) -> tuple[str, ...]:
        """Say why the check failed, a sentence each; none when it passed: first the file, as the cause."""
        return (*self.faults, *self._sentences(self.judged))

    def warnings(self) -> tuple[str, ...]:
        """Say what is wrong without counting: implausible values, faults of timing."""
        timing = () if self.strict else self.groups.get(TIMING, ())
        template = "{sentence} It counts where the check is strict."
        late = (Phrase(template, sentence=sentence) for sentence in self._sentences(timing))
        return (*self.plausibility_warnings, *late)

    def _sentences(self, findings: Sequence[Finding]) -> Iterator[str]:
        """Say which limits the worst of some scenarios break."""
        if not findings:
            return
        load, finding = self.worst_of(findings)
        if self._share_after(finding, load) > 1.0:
            template = (
                "The {load} sways by {found:.4g} mm after the move ({name}), and {limit:.4g} mm are allowed "
                "(check.residual_sway; integration error up to {error})."
            )
            if finding.residual[load] <= self.limit[load]:
                template = (
                    "The {load} sways by {found:.4g} mm after the move ({name}), which keeps the {limit:.4g} "
                    "mm that are allowed (check.residual_sway), but the integration may be off by {error}; "
                    "allow more."
                )
            yield self._exceeded(template, finding, load, finding.residual[load], self.limit[load])
        swaying = max(findings, key=self._share_on_the_way)
        load = list(self.limit)[-1] if self.directions == 1 else "load"
        if self.sway_limit is not None and self._share_on_the_way(swaying) > 1.0:
            template = (
                "The {load} sways by {found:.4g} mm on the way ({name}), and {limit:.4g} mm are allowed "
                "(limits.sway; integration error up to {error}); allow more, take more time, or narrow the "
                "ranges."
            )
            yield self._exceeded(template, swaying, load, swaying.on_the_way or 0.0, self.sway_limit)
        passing = max(findings, key=self._share_passed)
        if self.overshoot_limit is not None and self._share_passed(passing) > 1.0:
            template = (
                "The {load} passes its target by {found:.4g} mm ({name}), and {limit:.4g} mm are allowed "
                "(limits.overshoot, or check.residual_sway where that is more; integration error up to "
                "{error}); allow more, take more time, or narrow the ranges."
            )
            yield self._exceeded(template, passing, load, passing.overshoot or 0.0, self.overshoot_limit)
        near = max(findings, key=self._share_of_room)
        if self._share_of_room(near) > 1.0:
            template = "path.clearance: {where} ({name}; integration error up to {error})."
            where = near.nearness(self.path)
            yield Phrase(template, where=where, name=near.scenario.name, error=self._error())

    def _exceeded(self, template: str, finding: Finding, load: str, sway: float, limit: float) -> Phrase:
        name, error = finding.scenario.name, self._error()
        return Phrase(template, load=load, found=1e3 * sway, name=name, limit=1e3 * limit, error=error)

    def _error(self) -> str:
        micrometres = float(f"{1e6 * self.error_bound:.2g}")
        return f"{micrometres:g} µm" if micrometres < FINE else f"{micrometres / 1e3:g} mm"

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON and the manifest."""
        return {
            "passed": self.passed,
            "limit_m": self.limit[list(self.limit)[-1]],
            "limits_m": dict(self.limit),
            "error_bound_m": self.error_bound,
            "arrival_s": self.arrival,
            "strict": self.strict,
            "sway_limit_m": self.sway_limit,
            "overshoot_limit_m": self.overshoot_limit,
            "machines_searched": self.searched,
            "wind": None if self.wind is None else self.wind.to_dict(),
            "nearest": self._nearest(),
            "groups": [self._group(name, findings) for name, findings in self.groups.items()],
            "scenarios": [
                {
                    "name": finding.scenario.name,
                    "row": finding.scenario.row,
                    "group": finding.scenario.group,
                    "parameters": dict(finding.scenario.parameters),
                    "lag_s": finding.scenario.lag,
                    "residual_peak_m": self._end_load(finding),
                    "residual_peaks_m": dict(finding.residual),
                    "residual_modal_m": dict(finding.modal),
                    "sway_peak_m": finding.on_the_way,
                    "overshoot_m": finding.overshoot,
                    "room_m": finding.room,
                    "passed": self.keeps_limit(finding),
                }
                for finding in self.listed()
            ],
            "reasons": list(self.reasons()),
            "warnings": list(self.warnings()),
        }

    def listed(self) -> tuple[Finding, ...]:
        """Choose the findings worth a line: all of a small group, the first and the worst of a large one."""
        kept: list[Finding] = []
        for first, *rest in self.groups.values():
            fractions = sorted(map(self._share, rest), reverse=True)
            least = fractions[MOST_LISTED - 2] if len(rest) >= MOST_LISTED else 0.0
            kept += [first, *[finding for finding in rest if self._share(finding) >= least]]
        return tuple(kept)

    def fraction_after(self, finding: Finding) -> float:
        """Greatest share that any load takes up of its limit of residual sway, the error bound included."""
        return max(self._share_after(finding, load) for load in self.limit)

    def _share(self, finding: Finding) -> float:
        return max(
            self.fraction_after(finding),
            self._share_on_the_way(finding),
            self._share_passed(finding),
            self._share_of_room(finding),
        )

    def _nearest(self) -> dict[str, Any] | None:
        finding = self.nearest
        if finding is None:
            return None
        where, path = finding.nearest, self.path
        assert where is not None and path is not None
        past = where.obstacle - len(path.stacks)
        place = (
            {"stack": None, "overhead": past} if past >= 0 else {"stack": where.obstacle, "overhead": None}
        )
        return {
            "room_m": where.room,
            "row": finding.scenario.row,
            "time_s": where.time,
            **place,
            "body": where.body,
        }

    def _end_load(self, finding: Finding) -> float:
        return max(finding.residual[load] for load in list(self.limit)[-self.directions :])

    def _group(self, name: str, findings: Sequence[Finding]) -> dict[str, Any]:
        load, worst = self.worst_of(findings)
        quantiles = np.quantile([self._end_load(finding) for finding in findings], QUANTILES)
        levels = (f"{quantile:g}" for quantile in QUANTILES)
        return {
            "group": name,
            "what": GROUPS[name],
            "rows": len(findings),
            "passed": all(map(self.keeps_limit, findings)),
            "counts": self.strict or name != TIMING,
            "quantiles_m": dict(zip(levels, quantiles.tolist(), strict=True)),
            "worst": {"load": load, "row": worst.scenario.row, "residual_peak_m": worst.residual[load]},
        }
