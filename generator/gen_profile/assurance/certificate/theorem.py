"""What a certificate proves, and of what: machines, setpoints, and the time in which the sway counts."""

from collections.abc import Iterator, Sequence
from functools import cached_property
from math import prod
from typing import TypeVar

import attrs
import numpy as np

from gen_profile.assurance.certificate.approximate_motions import Approximation
from gen_profile.assurance.certificate.arithmetic.balls import Array
from gen_profile.assurance.certificate.axes.axis_motion import AxisMotion, Gap, gap_between
from gen_profile.assurance.certificate.axes.axis_track import Track, track_of
from gen_profile.assurance.certificate.boxes import DyadicBox, Ranges
from gen_profile.assurance.certificate.enclosure import TIME_NODES, Enclosure, nodes_for
from gen_profile.assurance.certificate.equations import EnclosedEquations, enclosed_equations
from gen_profile.assurance.certificate.scaling import Scaling
from gen_profile.assurance.certificate.sway_limits import SwayLimit, WatchedSway
from gen_profile.dynamics.evaluation.clearance import zones_of
from gen_profile.dynamics.evaluation.residual_sway import observation_time
from gen_profile.dynamics.problem.initial_state import initial_state
from gen_profile.motion.profile import SampledProfile
from gen_profile.spec.model import Spec
from gen_profile.spec.stacks import ROOM_TOLERANCE
from gen_profile.support.errors import CertificateError

T = TypeVar("T")

SCALE_TERMS = 3  # of S, in each parameter at most
MOST_TERMS = 32  # of motions, likewise
SAME_TIME = 1e-9  # relative: periods on computers whose linear algebra rounds otherwise
BATCH = 2_000_000  # numbers in an array over all nodes of a batch


@attrs.frozen(kw_only=True)
class Theorem:
    """No machine of some ranges sways by more than a bound, after a file's motion or at any time.

    Attributes
    ----------
    spec : Spec
    setpoints : SampledProfile
        Replayed from an artefact.
    ranges : Ranges
    limits : tuple of SwayLimit
        What bounds are wanted of.
    axes : AxisMotion
        Beside the setpoints; any will do.
    terms : tuple of int
        Of motions' series, in each parameter; any will do.

    Raises
    ------
    CertificateError
        No proof is written for what the spec asks.
    """

    spec: Spec
    setpoints: SampledProfile
    ranges: Ranges
    limits: tuple[SwayLimit, ...]
    axes: AxisMotion
    terms: tuple[int, ...]

    def __attrs_post_init__(self) -> None:
        if self.spec.check.foreign is not None:
            raise CertificateError(
                "check.fmu: a certificate is of this project's own equations of the machine; "
                "a foreign FMU can be co-simulated only."
            )
        if not self._axes_fit():
            raise CertificateError(
                "The certificate's motion of the axes does not belong to the file's setpoints."
            )

    def _axes_fit(self) -> bool:
        """Whether pieces end at points of the track, the last one, too, and go on while the sway counts."""
        axes, times, m = self.axes, self.track.times, self.setpoints.position.shape[1]
        knots, pieces = axes.knots, len(axes.knots) - 1
        shapes = (axes.position.shape, axes.velocity.shape, axes.acceleration.shape)
        if knots.ndim != 1 or shapes != ((pieces + 1, m), (pieces + 1, m), (pieces, 2, m)):
            return False
        moving = knots[knots <= times[-1]]
        return bool(
            all(np.isfinite(part).all() for part in (knots, axes.position, axes.velocity, axes.acceleration))
            and (np.diff(knots) > 0.0).all()
            and np.isin(moving, times).all()
            and np.isin(times[[0, -1]], moving).all()
            and knots[0] == times[0]
            and knots[-1] >= self.until * (1.0 - SAME_TIME)
            and np.array_equal(axes.position[0], self.setpoints.position[0])
        )

    def require_shapes(self, boxes: Sequence[DyadicBox], coefficients: Array, scales: Array) -> None:
        """Refuse arrays that do not fit together.

        Raises
        ------
        CertificateError
        """
        d, size = len(self.ranges.names), 2 * len(self.spec.machine().unactuated)
        pieces, count = len(self.axes.knots) - 1, len(boxes)
        fits = (
            coefficients.ndim == 5
            and coefficients.shape[:3] == (count, pieces, size)
            and 1 <= coefficients.shape[3] <= TIME_NODES
            and len(self.terms) == d
            and all(1 <= terms <= MOST_TERMS for terms in self.terms)
            and coefficients.shape[4] == prod(self.terms)
            and scales.shape[:4] in ((count, 1, size, size), (count, pieces, size, size))
            and scales.shape[4:] in ((1,), (prod(self.scale_terms),))
            and all(len(box) == d for box in boxes)
        )
        if not fits or not (np.isfinite(coefficients).all() and np.isfinite(scales).all()):
            raise CertificateError("The certificate is damaged: its arrays do not fit together.")

    @property
    def arrival(self) -> float:
        """When the sway begins to count, in s."""
        return float(self.track.times[-1])

    @property
    def until(self) -> float:
        """How long it counts at least, in s."""
        return self.arrival + observation_time(self.spec)

    @property
    def scale_terms(self) -> tuple[int, ...]:
        """Terms of S in each parameter."""
        return tuple(min(SCALE_TERMS, count) for count in self.terms)

    @property
    def nodes(self) -> int:
        """Nodes of one box, over all pieces."""
        return (len(self.axes.knots) - 1) * TIME_NODES * prod(map(nodes_for, self.terms))

    @cached_property
    def equations(self) -> EnclosedEquations:
        """Of the machine."""
        return enclosed_equations(self.spec.machine(), self.spec.path is not None)

    @property
    def allowed(self) -> Array:
        """Limits in m, and where there are zones by how much nearer than the clearance bodies may come."""
        nearer = [] if self.spec.path is None else [ROOM_TOLERANCE]
        return np.array([*(limit.allowed for limit in self.limits), *nearer])

    @cached_property
    def track(self) -> Track:
        """Motion of the axes."""
        return followed(self.spec, self.setpoints)

    @cached_property
    def gap(self) -> Gap:
        """How far the axes are from the smooth motion."""
        return gap_between(self.axes, self.track)

    def enclosure(self, boxes: Sequence[DyadicBox], coefficients: Array, scales: Array) -> Enclosure:
        """Enclose the machines of some boxes by an approximation of their motions, see `Approximation`."""
        nominal = self.spec.plant.parameters
        lower, upper = self.ranges.enclosed(boxes)
        scale_terms = self.scale_terms if scales.shape[4] > 1 else (1,) * len(self.terms)
        return Enclosure(
            equations=self.equations,
            axes=self.axes,
            gap=self.gap,
            watches=self._watches(),
            zones=zones_of(self.spec),
            approximation=Approximation(
                lower=lower,
                upper=upper,
                varied=tuple(list(nominal).index(name) for name in self.ranges.names),
                nominal=np.array(list(nominal.values())),
                series=coefficients.reshape(*coefficients.shape[:4], *self.terms),
                scaling=Scaling(series=scales.reshape(*scales.shape[:4], *scale_terms)),
                start=initial_state(self.spec.machine(), self.spec.move.initial),
            ),
        )

    def _watches(self) -> tuple[WatchedSway, ...]:
        """Tell where and when to look, for each of the limits."""
        plant = self.spec.machine()
        arrived = int(np.searchsorted(self.axes.knots, self.arrival, side="right")) - 1

        def watch(limit: SwayLimit) -> WatchedSway:
            if limit.on_the_way:
                return WatchedSway(loads=plant.end_load, first=0)
            load = plant.loads.index(limit.load)
            return WatchedSway(loads=slice(load, load + 1), first=arrived)

        return tuple(map(watch, self.limits))

    def batches(self, boxes: Sequence[T]) -> Iterator[Sequence[T]]:
        """Split boxes, or what belongs to them, into batches of a size to be worked on at once."""
        size = max(1, BATCH // self.nodes)
        for first in range(0, len(boxes), size):
            yield boxes[first : first + size]


def followed(spec: Spec, setpoints: SampledProfile) -> Track:
    """Move the axes as a spec's drives follow setpoints."""
    return track_of(setpoints, np.array(spec.move.final_velocity), spec.actuator.tau or 0.0)


def ranges_of(spec: Spec) -> Ranges:
    """List the parameters that the check changes, in alphabetical order, as JSON's objects have none."""
    wide = {name: ends for name, ends in sorted(spec.checked_ranges().items()) if ends[1] > ends[0]}
    lower, upper = (np.array([ends[side] for ends in wide.values()]) for side in (0, 1))
    return Ranges(names=tuple(wide), lower=lower, upper=upper)
