"""The table ``[planner]`` of a spec: which parameters the controller knows at run time."""

from __future__ import annotations

from collections.abc import Mapping

from gen_profile.plants.plant import Coordinate, Parameter, Plant
from gen_profile.spec.structure import Faults, Table, finite, found, place
from gen_profile.suggestion import suggestion


def planner_table(table: Table, plant: Plant | None, faults: Faults) -> Table:
    """Hold the ranges of live parameters to the machine's; its least value counts as 0 where it is little."""
    live = table.get("live", {})
    if not isinstance(live, Mapping):
        faults.add("planner.live", f"must be a table such as {{ L1 = [3.0, 9.0] }}, found {found(live)}")
        return {**table, "live": {}}
    if plant is None:
        return {**table, "live": {}}
    known: dict[str, Parameter | Coordinate] = {
        **{p.name: p for p in plant.parameters},
        **{axis.name: axis for axis in plant.actuated[1:]},
    }
    ranges: Table = {}
    for name, ends in live.items():
        where = place("planner.live", name)
        if name not in known:
            faults.add(where, f"unknown parameter{suggestion(name, known)}")
            continue
        numbers = [finite(end) for end in ends] if isinstance(ends, list | tuple) else []
        low, high = numbers if len(numbers) == 2 else (None, None)
        least, most = known[name].lower, known[name].upper
        if low is None or high is None or not min(0.0, least) <= low < high <= most or high <= least:
            faults.add(where, f"must be two rising numbers from {least:g} to {most:g}, found {found(ends)}")
        elif low < least > 1e-3 * high:
            faults.add(where, f"begins below the least that the machine takes, {least:g}")
        else:
            ranges[name] = (low, high)
    return {**table, "live": ranges}
