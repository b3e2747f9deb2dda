"""The optimal control problem of one motion task; knows no algorithm."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import attrs

from gen_profile.dynamics.problem.held_axes import reduced
from gen_profile.plants.plant import Plant
from gen_profile.spec.model import AxisLimitsSpec, LimitsSpec, Spec
from gen_profile.spec.passed_target import BoundedTarget, targets
from gen_profile.support.units import RATES

Effort = Literal["jerk", "snap", "reference"]


@attrs.frozen(kw_only=True)
class WorstCase:
    """The residual sway of the worst machine is what counts, rather than zero sway of the nominal one.

    Attributes
    ----------
    uncertain : mapping of str to float
        Relative half-ranges of parameters.
    load_limits : tuple of float
        Allowed residual sway of every load in m: the worst is the greatest share of it.
    nominal_zero : bool
        Whether the nominal machine shall come to rest exactly all the same.
    """

    uncertain: Mapping[str, float]
    load_limits: tuple[float, ...]
    nominal_zero: bool


@attrs.frozen(kw_only=True)
class Problem:
    """Plant, move, actuator, robustness and cost of eq. (26), in SI units.

    Attributes
    ----------
    plant : Plant
        Of a spec only what moves: without held axes, and coordinates that nothing swings then.
    parameters : mapping of str to float
        Value of every plant parameter.
    start, target : tuple of float
        Positions of every axis in m (or rad) at both ends.
    duration : float
        s.
    tau : float or None
        Time constant in s of a first-order actuator (eq. 6); None for an ideal one.
    desensitized : tuple of str
        Parameters whose sensitivities shall vanish at both ends.
    order : int
        Of these sensitivities: 1, or 2 for first and second ones.
    effort : str
        What the cost's quadratic term weighs.
    sway_weight : float
        β.
    sway_scale : float or None
        γ in 1/m; None lets the solver take `AUTO_SWAY` over the peak sway of the same move with β = 0.
    limits : LimitsSpec
        Of the command and of the sway on the way.
    targets : tuple of BoundedTarget
        What the end load may pass by `limits.overshoot`, with the problem's own axes.
    overshoot_margin : float
        m, by which less the nominal machine may pass them, since others pass them farther.
    sway_spread : float
        How many times the nominal machine's sway on the way the worst one's is, for which the limit holds.
    worst_case : WorstCase or None
    ranges : mapping of str to (float, float)
        Least and greatest values of the parameters of all machines for which the limit of sway holds.
    initial : mapping of str to float
        What swings at the start: unactuated coordinates by name, and their rates as ``NAME.rate``. It is what
        was measured, so no parameter changes it, and its sensitivities are zero.
    final_velocity : tuple of float
        Of every axis at the target, in m/s (or rad/s), with no acceleration; the loads hang still then.
    """

    plant: Plant
    parameters: Mapping[str, float]
    start: tuple[float, ...]
    target: tuple[float, ...]
    duration: float
    tau: float | None
    desensitized: tuple[str, ...]
    effort: Effort
    sway_weight: float
    sway_scale: float | None
    order: int = 1
    limits: LimitsSpec = attrs.field(factory=LimitsSpec)
    targets: tuple[BoundedTarget, ...] = ()
    overshoot_margin: float = 0.0
    sway_spread: float = 1.0
    worst_case: WorstCase | None = None
    ranges: Mapping[str, tuple[float, float]] = attrs.field(factory=dict)
    initial: Mapping[str, float] = attrs.field(factory=dict)
    final_velocity: tuple[float, ...] = attrs.field()

    @final_velocity.default
    def _standstill(self) -> tuple[float, ...]:
        return (0.0,) * len(self.target)

    @property
    def distance(self) -> tuple[float, ...]:
        """Signed distance of every axis."""
        return tuple(b - a for a, b in zip(self.start, self.target, strict=True))

    def within(self, share: float) -> Problem:
        """Ask for a share of what limits allow of velocity, acceleration, jerk, overshoot and room."""
        room = 1.0 - share

        def narrow(column: int, own: AxisLimitsSpec) -> AxisLimitsSpec:
            low, high = own.travel or (0.0, 0.0)
            ends = (self.start[column], self.target[column])
            inside = (min(low + room * (high - low), *ends), max(high - room * (high - low), *ends))
            rates = {name: value * share for name in RATES if (value := getattr(own, name)) is not None}
            return attrs.evolve(own, **rates, travel=None if own.travel is None else inside)

        axis = {f"axis{column}": narrow(column, self.limits.of(column)) for column in range(len(self.target))}
        past = None if self.limits.overshoot is None else share * self.limits.overshoot
        return attrs.evolve(self, limits=LimitsSpec(sway=self.limits.sway, overshoot=past, axis=axis))

    def without_limits(self) -> Problem:
        """Leave out limits, the machines for which they hold, and that the worst machine counts."""
        return attrs.evolve(
            self,
            limits=LimitsSpec(),
            targets=(),
            overshoot_margin=0.0,
            sway_spread=1.0,
            worst_case=None,
            ranges={},
        )

    def of_least_effort(self) -> Problem:
        """Leave out limits and the cost of the sway."""
        return attrs.evolve(self.without_limits(), sway_weight=0.0, sway_scale=1.0)

    @property
    def nominal_sway(self) -> float | None:
        """What the limit of sway on the way leaves to the nominal machine, in m; None without a limit."""
        return None if self.limits.sway is None else self.limits.sway / self.sway_spread

    @property
    def nominal_overshoot(self) -> float | None:
        """How far the nominal machine's load may pass its target, in m; None without a limit."""
        if self.limits.overshoot is None or not self.targets:
            return None
        return max(self.limits.overshoot - self.overshoot_margin, 0.0)


# With sway_scale = "auto" β and γ mean for every move what they mean for the paper's: the sway counts in
# units of its peak, and the effort in units of its root mean square, of the same move with β = 0.
AUTO_SWAY = 1.45  # γ · peak sway: the paper's 50/m · 29.4 mm, rounded
AUTO_EFFORT = 1.0655  # m/s³, root mean square jerk of the paper's move with β = 0


def problem_of(spec: Spec, *, whole: bool = False) -> Problem:
    """State the problem that a spec asks to solve, of the axes that may move, or of the whole machine."""
    robustness = spec.robustness
    worst_case = None
    if robustness.method == "range":
        worst_case = WorstCase(
            uncertain=robustness.uncertain,
            load_limits=tuple(spec.check.residual_sway.values()),
            nominal_zero=robustness.nominal_zero,
        )
    move = spec.move
    machine = reduced(spec.machine(), {} if whole else spec.held(), move.initial)
    return Problem(
        plant=machine.plant,
        parameters=spec.plant.parameters,
        start=tuple(move.start[axis] for axis in machine.moving),
        target=tuple(move.target[axis] for axis in machine.moving),
        duration=move.duration,
        tau=spec.actuator.tau,
        desensitized=tuple(robustness.uncertain) if robustness.method == "sensitivity" else (),
        order=robustness.order,
        limits=spec.limits.only(machine.moving),
        targets=tuple(
            attrs.evolve(
                one, direction=attrs.evolve(one.direction, axis=machine.moving.index(one.direction.axis))
            )
            for one in targets(spec)
        ),
        worst_case=worst_case,
        ranges=spec.checked_ranges(),
        effort=spec.cost.effort,
        sway_weight=spec.cost.sway_weight,
        sway_scale=spec.cost.sway_scale,
        initial=move.initial,
        final_velocity=tuple(move.final_velocity[axis] for axis in machine.moving),
    )
