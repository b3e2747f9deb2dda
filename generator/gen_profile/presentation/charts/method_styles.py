"""How the curves of every method look: the same in all pictures, whichever others take part."""

from collections.abc import Collection, Iterable
from itertools import cycle

from gen_profile.methods.shapers.impulses import SHAPERS
from gen_profile.presentation.charts.figure import PALETTE, Dash, Style

THICK, THIN = 2.6, 1.4  # pixels

OPTIMAL = (
    *(f"optimal-beta{weight}" for weight in (0, 20, 50)),
    *(f"optimal{kind}" for kind in ("", "-range", "-order1", "-order2")),
)
# methods that share their dashes differ in colour, by their place, the first of which has this one; so do the
# usual optimal motions and the shapers that are recommended most
GROUPS: tuple[tuple[Dash, int, tuple[str, ...]], ...] = (
    ("solid", 0, OPTIMAL),
    ("dash", 3, tuple(sorted((name for name in SHAPERS if "ei" not in name), key="zvdd".__eq__))),
    ("dot", 4, tuple(name for name in SHAPERS if "ei" in name)),
)


def method_styles(methods: Iterable[str], thick: Collection[str | None] = ()) -> dict[str, Style]:
    """Draw optimal motions solid, shapers dashed, and extra-insensitive ones dotted.

    Parameters
    ----------
    methods : iterable of str
        As a comparison names them.
    thick : collection of str
        Those that matter most.
    """
    looks: dict[str, tuple[str, Dash]] = {
        method: (PALETTE[(first + place) % len(PALETTE)], dash)
        for dash, first, group in GROUPS
        for place, method in enumerate(group)
    }
    methods = list(methods)
    taken = {looks[method][0] for method in methods if method in looks}
    # the spec's own β first, then what users bring: first in colours that no other curve has
    backwards = PALETTE[::-1]
    others = cycle(sorted(backwards, key=taken.__contains__))
    styles = {}
    for method in methods:
        colour, dash = looks.get(method) or (next(others), "solid")
        styles[method] = Style(colour=colour, dash=dash, width=THICK if method in thick else THIN)
    return styles
