"""How much sway a design, and other methods, leave on machines that are not as specified."""

from __future__ import annotations

from collections.abc import Mapping

from gen_profile.charts.figure import Band, Figure, Level, Line, Map, Panel, Style, ceiling
from gen_profile.comparison.robustness import Robustness, error_grid, robustness_of
from gen_profile.motion.profile import Profile
from gen_profile.report.content import Section
from gen_profile.spec.model import Spec

MOST = 4  # parameters that have a curve each
MAPPED = 4  # methods that have a map each


def robustness_section(
    spec: Spec, own: str, motions: Mapping[str, Profile], styles: Mapping[str, Style]
) -> Section | None:
    """Draw residual sway over the error of every uncertain parameter, and over two of them together.

    None where the spec states none. Where there are many, those are drawn with which the design sways most.

    Parameters
    ----------
    spec : Spec
    own : str
        Which of the motions is the design's.
    motions : mapping of str to Profile
        Of the axes, by method.
    styles : mapping of str to Style
        Of the methods that are not shown at once there are no maps.
    """
    names = list(spec.robustness.uncertain)
    if not names:
        return None
    found = {name: robustness_of(spec, motions, error_grid(spec, (name,))) for name in names}
    telling = sorted(names, key=lambda name: float(found[name].share(own).max()), reverse=True)
    caption = "Shaded: the range that the spec states; dashed in red: what is allowed."
    if len(names) > MOST:
        caption += f" Of {len(names)} uncertain parameters those {MOST} with which it sways most."
    panels = [_panel(name, one, styles) for name, one in found.items() if name in telling[:MOST]]
    figures = [Figure(caption=caption, panels=panels)]
    if len(names) > 1:
        shown = [own, *(method for method in motions if styles[method].shown and method != own)][:MAPPED]
        both = {method: motions[method] for method in shown}
        pair = [name for name in names if name in telling[:2]]
        figures.append(_maps(robustness_of(spec, both, error_grid(spec, pair))))
    return Section(
        title="Robustness",
        words=[" ".join(_reach(name, one, own) for name, one in found.items())],
        blocks=figures,
    )


def _maps(found: Robustness) -> Figure:
    """Draw a map of every method over two parameters."""
    (across, x), (upwards, y) = found.errors.items()
    stated = found.spec.robustness.uncertain
    return Figure(
        caption=(
            f"How much of its allowed residual sway the load takes up that takes most, where {across} and "
            f"{upwards} are off at once. Thick line: all of it; dotted: the ranges that the spec states."
        ),
        panels=[
            Map(
                title=f"{method} over {across} and {upwards}",
                x_label=f"error of {across} (%)",
                y_label=f"error of {upwards} (%)",
                unit="%",
                x=100.0 * x,
                y=100.0 * y,
                values=100.0 * found.share(method).T,
                limit=100.0,
                frame=(100.0 * stated[across], 100.0 * stated[upwards]),
            )
            for method in found.residual
        ],
    )


def _reach(name: str, found: Robustness, own: str) -> str:
    """Say between which errors every load keeps its limit."""
    reach = found.insensitivity(own)
    if reach is None:
        return f"On the machine as specified a load exceeds its limit, whatever {name}."
    low, high = (f"{100.0 * end:+.3g}\N{NO-BREAK SPACE}%".replace("-", "−") for end in reach)
    (errors,) = found.errors.values()
    if reach == (errors[0], errors[-1]):
        return f"Every load keeps its limit over all errors of {name} tried, {low} to {high}."
    return f"Every load keeps its limit while the error of {name} is between {low} and {high}."


def _panel(name: str, found: Robustness, styles: Mapping[str, Style]) -> Panel:
    spec, limit = found.spec, 1e3 * found.tolerance
    stated = 100.0 * spec.robustness.uncertain[name]
    (errors,) = found.errors.values()
    lines = [
        Line(name=method, x=100.0 * errors, y=1e3 * found.end_load(method), style=styles[method])
        for method in found.residual
    ]
    return Panel(
        title=f"Residual sway of the {spec.machine().end_load_name} over {name}",
        x_label=f"error of {name} (%)",
        y_label="residual sway (mm)",
        lines=lines,
        levels=[Level(value=limit)],
        bands=[Band(low=-stated, high=stated)],
        ceiling=ceiling(max(float(line.y.max()) for line in lines), limit),
    )
