"""How much sway a design, and other methods, leave on machines that are not as specified."""

from collections.abc import Mapping

import attrs

from gen_profile.charts.figure import Style
from gen_profile.charts.robustness import curves_figure, maps_figure
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
    curves = {name: robustness_of(spec, motions, error_grid(spec, (name,))) for name in names}
    telling = sorted(names, key=lambda name: float(curves[name].fraction(own).max()), reverse=True)
    figure = curves_figure({name: one for name, one in curves.items() if name in telling[:MOST]}, styles)
    if len(names) > MOST:
        more = f" Of {len(names)} uncertain parameters those {MOST} with which it sways most."
        figure = attrs.evolve(figure, caption=figure.caption + more)
    figures = [figure]
    if len(names) > 1:
        shown = [own, *(method for method in motions if styles[method].shown and method != own)][:MAPPED]
        both = {method: motions[method] for method in shown}
        pair = [name for name in names if name in telling[:2]]
        figures.append(maps_figure(robustness_of(spec, both, error_grid(spec, pair))))
    return Section(
        title="Robustness",
        words=[" ".join(_reach(name, one, own) for name, one in curves.items())],
        blocks=figures,
    )


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
