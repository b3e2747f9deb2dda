"""What became of a stream, in SI units: for people, for programs, and as a table."""

from typing import Any

import attrs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from gen_profile.motion.profile import Array, grid_times
from gen_profile.plants.plant import Coordinate
from gen_profile.spec.model import Spec
from gen_profile_exporters.can.frames import Integers
from gen_profile_exporters.can.streaming.following import Standstill, standstills
from gen_profile_exporters.can.streaming.plan import SetpointSource
from gen_profile_exporters.can.streaming.record import Record


@attrs.frozen(kw_only=True, eq=False)
class Source:
    """A verified motion, or planner, and the spec that it was designed for."""

    spec: Spec
    plan: SetpointSource

    @property
    def axes(self) -> tuple[Coordinate, ...]:
        """The axes that are streamed to."""
        names = [axis.name for axis in self.plan.target.axes]
        return tuple(axis for axis in self.spec.machine().actuated if axis.name in names)

    def si(self, counts: ArrayLike) -> Array:
        """Turn positions of all axes, in the last dimension, from counts into m (or rad)."""
        scale = np.array([axis.counts_per_si for axis in self.plan.target.axes])
        return np.asarray(np.asarray(counts) / scale)


@attrs.frozen(kw_only=True, eq=False)
class StreamOutcome:
    """What became of a stream; see the command-line contract.

    Attributes
    ----------
    source : Source
    record : Record
    notes : tuple of str
        What limited this machine's punctuality or made up for it, and what else there is to say.
    sway : float or None
        Of the simulated machine after the move, in m.
    """

    source: Source
    record: Record
    notes: tuple[str, ...]
    sway: float | None = None

    @property
    def done(self) -> bool:
        """Whether the motion was carried out to its end."""
        return not self.record.reason

    @property
    def planned(self) -> Array:
        """Position that each axis is led to by the instant of each SYNC, in m, shape (cycles, axes)."""
        return self.source.si(self.source.plan.at_sync)

    @property
    def actual(self) -> Array:
        """Position that each drive reported at each SYNC, in m; not a number where none was."""
        return np.where(self._answered[:, None], self.source.si(self._actual), np.nan)

    @property
    def standstills(self) -> tuple[Standstill, ...]:
        """Axes that stood still while their setpoints went on."""
        period = self.source.plan.target.can.sync_period
        return standstills(self.source.plan.at_sync, self._actual, self._answered, period)

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON."""
        answered, goal = self._answered, self.source.plan.goal
        apart = np.abs(self.actual - self.planned)[answered]
        final = np.array(self.record.final)
        final_error = final - (final if goal is None else goal)
        drive = {
            "position_error_m": float(np.abs(self.source.si(final_error)).max()),
            "following_error_max_m": float(apart.max()) if answered.any() else None,
            "sway_residual_peak_m": self.sway,
            "cycles_unanswered": self.record.sent - int(answered.sum()),
            "cycles_standing": sum(len(standstill.cycles) for standstill in self.standstills),
        }
        return {
            "state": self.record.phase.value,
            "cycles_sent": self.record.sent,
            "cycles_planned": self.source.plan.planned,
            "lateness_us": self.record.lateness.to_dict(),
            "drift_s": self.record.lateness.drift,
            "drive": drive if answered.any() else None,
            "planner": self._planner(),
            "reason": self.record.reason,
            "notes": [*self.notes, *map(self._standstill_words, self.standstills)],
        }

    def table(self) -> bytes:
        """Render plan and reality side by side (RFC 4180)."""
        axes, further = self.source.axes, self.source.plan.columns
        heads = [f"{axis.name}_{what}_{axis.unit}" for axis in axes for what in ("planned", "actual")]
        times = grid_times(len(self.planned) - 1, self.source.plan.target.can.sync_period)
        places = np.stack([self.planned, self.actual], axis=2).reshape(len(times), 2 * len(axes))
        columns = np.column_stack([places, *further.values()])
        heads += further
        rows = [
            ",".join([f"{time:.9g}", *("" if np.isnan(cell) else f"{cell:.9g}" for cell in row)])
            for time, row in zip(times, columns, strict=True)
        ]
        return ("\n".join([",".join(["time_s", *heads]), *rows]) + "\n").encode("ascii")

    def _planner(self) -> dict[str, Any] | None:
        """Say what a planner block showed; None of a log."""
        columns = self.source.plan.columns
        if not columns:
            return None
        promise, errors = columns["promise"].tolist(), columns["error_id"].tolist()
        shown = [error for error in dict.fromkeys(errors) if error]
        return {"promise": bool(promise and promise[-1]), "error_ids": shown}

    def _standstill_words(self, standstill: Standstill) -> str:
        axis, many = self.source.plan.target.axes[standstill.column], len(standstill.cycles)
        apart, unit = standstill.apart / abs(axis.counts_per_si), self.source.axes[standstill.column].unit
        return (
            f"axis {axis.name}: it stood still in {many} {'cycles' if many > 1 else 'cycle'} of the motion, "
            f"from cycle {standstill.cycles[0]} on, and came {1e3 * apart:.3g} m{unit} off it: "
            "its drive left setpoints out."
        )

    @property
    def _answered(self) -> NDArray[np.bool_]:
        """For which cycles there is a position; the record may have room for more of them."""
        return self.record.answered[: len(self.source.plan.at_sync)]

    @property
    def _actual(self) -> Integers:
        return self.record.actual[: len(self.source.plan.at_sync)]
