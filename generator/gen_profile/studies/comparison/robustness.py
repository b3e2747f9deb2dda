"""How much sway motions leave on machines that are not as specified: over one parameter, or over two."""

import csv
from collections.abc import Mapping, Sequence
from io import StringIO
from itertools import product
from types import MappingProxyType
from typing import Any

import attrs
import numpy as np

from gen_profile.assurance.verification.batch import Feed, many_machines, residual_peaks
from gen_profile.dynamics.evaluation.residual_sway import SHORTEST_WATCH, STANDSTILL
from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.motion.actuator import lag_compensated
from gen_profile.motion.profile import Array, Profile, grid_length, grid_times, read_only
from gen_profile.spec.model import Spec
from gen_profile.spec.values import require_whole
from gen_profile.studies.comparison.candidates import candidates
from gen_profile.support.errors import GenProfileError, SpecError
from gen_profile.support.progress import Progress, no_progress
from gen_profile.support.suggestion import suggestion
from gen_profile.support.summary import Drawable, Tabled

POINTS = {1: 61, 2: 25}  # per parameter, of a curve and of a map
USUAL_RANGE = 0.3  # relative, of a parameter that the spec takes for certain
RANGE_FACTOR = 1.5  # of a parameter's own range, which the curve covers
WIDEST = 0.9
FEWEST = 3  # points of a curve
# rad of the fastest mode between setpoints: linear interpolation errs by some 10⁻⁴ of the sway
SETPOINT_PHASE = 0.05
STEPS_PER_MOVE = 300


def _arrays(values: Mapping[str, Array]) -> Mapping[str, Array]:
    return MappingProxyType({name: read_only(array) for name, array in values.items()})


@attrs.frozen(kw_only=True, eq=False, repr=False)
class Robustness(Drawable, Tabled):
    """Residual sway over relative errors of one parameter (a curve) or of two (a map).

    Attributes
    ----------
    spec : Spec
    errors : mapping of str to (points,) array
        Relative errors by parameter, rising; 0 is among them.
    residual : mapping of str to (points, …, loads) array
        Greatest sway of every load after the move in m, by method; an axis per parameter.
    left_out : mapping of str to str
        Methods without a motion for the move, and why.
    """

    spec: Spec
    errors: Mapping[str, Array] = attrs.field(converter=_arrays)
    residual: Mapping[str, Array] = attrs.field(converter=_arrays)
    left_out: Mapping[str, str] = attrs.field(factory=dict)

    def records(self) -> list[dict[str, object]]:
        """List every machine with its errors, and under each method what its end load is left with in m."""
        machines = product(*self.errors.values())
        swayed = {method: self.end_load(method).ravel().tolist() for method in self.residual}
        return [
            dict(zip([*self.errors, *swayed], [*map(float, machine), *sways], strict=True))
            for machine, *sways in zip(machines, *swayed.values(), strict=True)
        ]

    def summary(self) -> dict[str, object]:
        """Tell what a reader looks for first."""
        ends = {name: (100.0 * values[0], 100.0 * values[-1]) for name, values in self.errors.items()}
        errors = ", ".join(f"{name} {low:+.3g} to {high:+.3g} %" for name, (low, high) in ends.items())
        worst = {method: f"{1e3 * self.end_load(method).max():.4g} mm at worst" for method in self.residual}
        return {"name": self.spec.name, "errors": errors, **worst}

    @property
    def limits(self) -> Array:
        """Allowed residual sway of every load in m, shape (loads,)."""
        return np.array(list(self.spec.check.residual_sway.values()))

    @property
    def tolerance(self) -> float:
        """Allowed residual sway of the end load in m; the least where its directions differ."""
        return float(self.limits[self.spec.machine().end_load].min())

    def end_load(self, method: str) -> Array:
        """Greatest residual sway of the end load in any direction in m, shape (points, …)."""
        return np.asarray(self.residual[method][..., self.spec.machine().end_load].max(axis=-1))

    def fraction(self, method: str) -> Array:
        """Greatest share of its limit that any load takes up, shape (points, …)."""
        return np.asarray((self.residual[method] / self.limits).max(axis=-1))

    def insensitivity(self, method: str) -> tuple[float, float] | None:
        """Range of errors around 0 of a curve within which every load keeps its limit.

        Its width is what input shaping calls the insensitivity at this tolerance. It ends between two points
        where the share of the limit, taken as linear there, passes 1, else with the curve. None where the
        machine as specified does not keep the limits, or for a map.
        """
        if len(self.errors) != 1:
            return None
        (errors,) = self.errors.values()
        fraction, zero = self.fraction(method), int(np.abs(errors).argmin())
        if fraction[zero] > 1.0:
            return None
        return (-_crossing(-errors[zero::-1], fraction[zero::-1]), _crossing(errors[zero:], fraction[zero:]))

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON."""
        return {
            "name": self.spec.name,
            "spec_sha256": self.spec.sha256(),
            "limits_m": dict(self.spec.check.residual_sway),
            "errors": {name: values.tolist() for name, values in self.errors.items()},
            "methods": [
                {
                    "method": method,
                    "residual_peaks_m": {
                        load: residual[..., index].tolist()
                        for index, load in enumerate(self.spec.machine().loads)
                    },
                    "residual_worst_m": float(self.end_load(method).max()),
                    "keeps_limits_share": float((self.fraction(method) <= 1.0).mean()),
                    "insensitivity": self.insensitivity(method),
                }
                for method, residual in self.residual.items()
            ],
            "left_out": [{"method": method, "reason": why} for method, why in self.left_out.items()],
        }

    def table(self) -> str:
        """Write a row per machine as CSV: relative errors, then every load's residual sway in m by method."""
        loads = self.spec.machine().loads
        head = [*(f"{name}_error" for name in self.errors)]
        head += [f"{method}_{load}_m" for method in self.residual for load in loads]
        grid = np.meshgrid(*self.errors.values(), indexing="ij")
        columns = [values.ravel() for values in grid]
        for sway in self.residual.values():
            columns += list(sway.reshape(-1, len(loads)).T)
        text = StringIO()
        rows = csv.writer(text, lineterminator="\n")
        rows.writerow(head)
        rows.writerows([f"{value:.9g}" for value in row] for row in zip(*columns, strict=True))
        return text.getvalue()


def _crossing(errors: Array, fraction: Array) -> float:
    """Where a share passes 1 on the way outwards from the first point."""
    over = np.flatnonzero(fraction > 1.0)
    if not len(over):
        return float(errors[-1])
    at = int(over[0])
    part = (1.0 - fraction[at - 1]) / (fraction[at] - fraction[at - 1])
    return float(errors[at - 1] + part * (errors[at] - errors[at - 1]))


def robustness(
    spec: Spec,
    parameters: Sequence[str] = (),
    *,
    methods: Sequence[str] = (),
    own: Sequence[Profile] = (),
    points: int | None = None,
    half_range: float | None = None,
    progress: Progress = no_progress,
) -> Robustness:
    """Try shapers, variants of the optimal motion, and own motions over errors of one or two parameters.

    Raises
    ------
    SpecError
        A parameter or method is unknown, there are too few points, or the range is none.
    """
    errors = error_grid(spec, parameters, points, half_range)
    motions: dict[str, Profile] = {}
    left_out: dict[str, str] = {}
    listed = {candidate.method: candidate for candidate in candidates(spec, own)}
    for method in methods:
        if method not in listed:
            raise SpecError(f"method {method[:60]}: unknown method{suggestion(method, list(listed))}")
    chosen = [*methods, *(motion.method for motion in own)] if methods else list(listed)
    for done, method in enumerate(chosen):
        progress("designing", done, len(chosen), method)
        try:
            motions[method] = listed[method].design()
        except GenProfileError as error:
            left_out[method] = str(error)
    progress("trying all machines")
    return attrs.evolve(robustness_of(spec, motions, errors), left_out=left_out)


def error_grid(
    spec: Spec, parameters: Sequence[str] = (), points: int | None = None, half_range: float | None = None
) -> dict[str, Array]:
    """Choose the relative errors of one or two parameters; an odd number of them, 0 in their middle.

    Those are left out at which the parameter would leave the bounds of its machine.

    Raises
    ------
    SpecError
        A parameter is unknown or 0, none is uncertain, or more than two are asked for; or there are too few
        points, or no such range.
    """
    plant, nominal, ranges = spec.machine(), spec.plant.parameters, spec.robustness.uncertain
    names = tuple(dict.fromkeys(parameters)) or tuple(ranges)[:1]
    if not names:
        raise SpecError("parameter: name one, such as L1; the spec states no uncertain ones.")
    if len(names) > 2:
        raise SpecError("parameter: at most two, of which a map is drawn.")
    if points is not None:
        require_whole(points, FEWEST, "points")
    if half_range is not None and not 0.0 < half_range <= WIDEST:
        raise SpecError(
            f"range: must be greater than 0 and at most {WIDEST} (0.1 is 10 %), found {half_range}."
        )
    bounds = {parameter.name: (parameter.lower, parameter.upper) for parameter in plant.parameters}
    grid: dict[str, Array] = {}
    for name in names:
        if name not in nominal:
            raise SpecError(f"parameter {name[:60]}: unknown parameter{suggestion(name, list(nominal))}")
        if nominal[name] == 0.0:
            raise SpecError(f"parameter {name}: its value is 0, so a relative error means nothing.")
        widest = min(RANGE_FACTOR * ranges[name] if name in ranges else USUAL_RANGE, WIDEST)
        half = int(points or POINTS[len(names)]) // 2
        errors = np.array([(half_range or widest) * k / half for k in range(-half, half + 1)])
        low, high = bounds[name]
        values = nominal[name] * (1.0 + errors)
        grid[name] = errors[(values >= low) & (values <= high)]
    return grid


def robustness_of(spec: Spec, motions: Mapping[str, Profile], errors: Mapping[str, Array]) -> Robustness:
    """Find the residual sway that motions leave over errors of parameters.

    Parameters
    ----------
    spec : Spec
    motions : mapping of str to Profile
        Of the axes, by method.
    errors : mapping of str to (points,) array
        Relative errors of one or two parameters; see `error_grid`.

    Raises
    ------
    CosimulationError
        The FMU cannot be built or run.
    """
    plant, nominal = spec.machine(), spec.plant.parameters
    names = [parameter.name for parameter in plant.parameters]
    grid = np.meshgrid(*errors.values(), indexing="ij")
    machines = np.tile([nominal[name] for name in names], (grid[0].size, 1))
    for name, off in zip(errors, grid, strict=True):
        machines[:, names.index(name)] *= 1.0 + off.ravel()
    rows = (dict(zip(names, row, strict=True)) for row in machines)
    frequencies = np.array([linearize(plant, one, spec.move.target).frequencies[[0, -1]] for one in rows])
    watch = max(SHORTEST_WATCH, 4.0 * np.pi / float(frequencies[:, 0].min()))
    step = SETPOINT_PHASE / float(frequencies[:, 1].max())
    tau = spec.actuator.tau or 0.0
    residuals = {}
    with many_machines(plant) as runs:
        for method, motion in motions.items():
            cycle = min(step, motion.duration / STEPS_PER_MOVE)
            since = motion.duration + STANDSTILL * tau
            times = grid_times(grid_length(since + watch, cycle), cycle)
            peaks = residual_peaks(
                runs,
                spec,
                Feed(times=times, position=lag_compensated(motion, spec.actuator.tau)(times).position),
                machines,
                tau=np.full(len(machines), tau),
                max_step=np.full(len(machines), cycle),
                since=since + cycle,
            )
            residuals[method] = peaks[:, : len(plant.loads)].reshape(*grid[0].shape, -1)
    return Robustness(spec=spec, errors=errors, residual=residuals)
