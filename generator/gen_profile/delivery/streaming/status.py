"""What a planner's axes do now, in one line: where they are, how far a stop leads, and what was commanded."""

from collections.abc import Iterable, Mapping, Sequence

from gen_profile.planner.interface import BlockAxis

REPORT_INTERVAL = 0.25  # s between two reports
PROMISES = {0: "no sway", 3: "not ready", 4: "not ready"}  # by nPromise; "may sway" otherwise


class StatusLine:
    """A line now and then, where there is anything new to say.

    Parameters
    ----------
    axes : sequence of BlockAxis
    cycle : float
        The block's, in s.
    """

    def __init__(self, axes: Sequence[BlockAxis], cycle: float) -> None:
        self._axes, self._pause = axes, round(REPORT_INTERVAL / cycle)
        self._reported, self._told = 0, ""

    def words(self, cycle: int, issued: Mapping[str, float], commanded: str) -> str:
        """Say how it is in a cycle of the block, given its outputs; nothing where it was said just now."""
        if cycle < self._reported + self._pause:
            return ""
        self._reported = cycle
        state = PROMISES.get(int(issued["nPromise"]), "may sway")
        if issued["nErrorId"]:
            state = f"error {issued['nErrorId']:.0f}"
        places = in_units((issued[a.of("fPosition")] for a in self._axes), self._axes, "{:.3f}")
        speeds = in_units((issued[a.of("fVelocity")] for a in self._axes), self._axes, "{:+.3f}", "/s")
        stops = in_units((issued[a.of("fStopDistance")] for a in self._axes), self._axes, "{:.3f}")
        said = "; ".join(filter(None, [f"{places}, {speeds}, stops within {stops}, {state}", commanded]))
        before, self._told = self._told, said
        return "" if said == before else said


def in_units(values: Iterable[float], axes: Iterable[BlockAxis], form: str, per: str = "") -> str:
    """Write a value of each axis with its name, where it has one, and its unit."""
    return ", ".join(
        f"{axis.name} {form.format(value)} {axis.unit}{per}".lstrip()
        for value, axis in zip(values, axes, strict=True)
    )
