"""Whether an axis stands: measured by the positions that its drive tells, and never taken for granted."""

import attrs

from gen_profile.support.units import AxisScale
from gen_profile_exporters.can.host.clock import NANOSECONDS
from gen_profile_exporters.can.scaling import magnitude_counts

STANDSTILL_TIME = NANOSECONDS // 10  # for which an axis must stay in its place
TREMBLING = 0.0001  # m (or rad), of an axis that stands
LEAST_COUNTS = 2  # counts, likewise


@attrs.define
class Standing:
    """For how long an axis has reported the same place.

    Attributes
    ----------
    allowed : int
        How far its places may lie apart, in counts.
    """

    allowed: int
    _place: int | None = None
    _since: int = 0
    _told: int = 0

    def take(self, position: int, now: int) -> None:
        """Take down where it was at an instant in ns."""
        if self._place is None or abs(position - self._place) > self.allowed:
            self._place, self._since = position, now
        self._told = now

    def proved(self, after: int = 0) -> bool:
        """Tell whether it has stood for long enough since an instant in ns."""
        return self._place is not None and self._told - max(self._since, after) >= STANDSTILL_TIME


def trembling(axis: AxisScale) -> int:
    """Tell by how many counts an axis that stands may tremble."""
    return max(LEAST_COUNTS, magnitude_counts(TREMBLING, axis))
