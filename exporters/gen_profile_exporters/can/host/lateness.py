"""How punctual cycles were: figures of lateness, and a rehearsal of this machine."""

from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile_exporters.can.host.clock import NANOSECONDS, Clock

BINS_US = (10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000)


@attrs.frozen(kw_only=True, eq=False)
class Lateness:
    """Lateness of every cycle that was sent.

    Attributes
    ----------
    cycles : (n,) integer array
        Their numbers.
    late : (n,) integer array
        ns after the due instant.
    """

    cycles: NDArray[np.int64]
    late: NDArray[np.int64]

    def percentile(self, percent: float) -> float:
        """Lateness in µs that `percent` percent of the cycles keep; 0 without any."""
        return float(np.percentile(self.late, percent)) / 1e3 if self.late.size else 0.0

    @property
    def drift(self) -> float:
        """How much later the last cycle was than the first, by a straight line through all, in s."""
        if self.late.size < 2:
            return 0.0
        slope = np.polynomial.Polynomial.fit(self.cycles, self.late / NANOSECONDS, 1).convert().coef
        return float(slope[1] * (self.cycles[-1] - self.cycles[0])) if slope.size > 1 else 0.0

    def histogram(self) -> dict[str, int]:
        """Count the cycles by lateness, in µs."""
        edges = np.array([-np.inf, *BINS_US, np.inf]) * 1e3
        counts, _ = np.histogram(self.late, edges)
        names = [f"< {edge}" for edge in BINS_US] + [f">= {BINS_US[-1]}"]
        return dict(zip(names, map(int, counts), strict=True))

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON."""
        return {
            "p50": self.percentile(50),
            "p99": self.percentile(99),
            "max": self.percentile(100),
            "histogram": self.histogram(),
        }


def rehearse(clock: Clock, period: int, count: int) -> Lateness:
    """Keep so many cycles without any bus, and say how late they were."""
    late = np.zeros(count, dtype=np.int64)
    start = clock.now() + period
    for cycle in range(count):
        clock.sleep_until(start + cycle * period)
        late[cycle] = clock.now() - (start + cycle * period)
    return Lateness(cycles=np.arange(count), late=late)
