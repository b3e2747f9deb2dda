"""How near the bodies of machines come to what stands under them, and when."""

import attrs
import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.spec.model import Spec
from gen_profile.spec.plan_view import StraightWay
from gen_profile.spec.stacks import StackZone, hanging, path_axes, zones


@attrs.frozen(kw_only=True)
class Nearest:
    """Where a machine has the least room to a stack, or to what is overhead.

    Attributes
    ----------
    room : float
        m beyond the clearance; negative where the clearance is not kept.
    time : float
        s.
    obstacle : int
        Its number in ``path.stacks``, from 0; those in ``path.overhead`` follow.
    body : str
    """

    room: float
    time: float
    obstacle: int
    body: str


def zones_of(spec: Spec) -> tuple[StackZone, ...]:
    """List where the bodies of a spec's machine may not be; none without a path over stacks."""
    if spec.path is None:
        return ()
    plant, move = spec.machine(), spec.move
    ends = [hanging(plant, spec.plant.parameters, q_a) for q_a in (move.start, move.target)]
    return zones(spec.path, ends)


def line_of(spec: Spec) -> StraightWay:
    """Lay the way of a spec's path in plan view, along which loads go."""
    axes = path_axes(spec.machine(), spec.plant.parameters)
    assert axes is not None  # as the spec's rules hold
    return axes.line(spec.move.start, spec.move.target)


def nearest(spec: Spec, times: Array, bodies: Array) -> Nearest:
    """Find where a machine has the least room; between two times its bodies go straight.

    Parameters
    ----------
    spec : Spec
        With a path over stacks.
    times : (samples,) array
        s, rising.
    bodies : (samples, bodies, 3) array
        m.
    """
    found = []
    for zone in zones_of(spec):
        x, y, z = bodies[:, zone.body].T
        beside, above = zone.beside(x, y), zone.clear(z)
        room = np.maximum(beside, above)
        apart = beside - above
        passes = apart[:-1] * apart[1:] < 0.0
        share = np.divide(apart[:-1], -np.diff(apart), out=np.zeros(len(x) - 1), where=passes)
        between = beside[:-1] + share * np.diff(beside)
        room[:-1] = np.where(passes, np.minimum(room[:-1], between), room[:-1])
        least = int(np.argmin(room))
        body = spec.machine().bodies[zone.body]
        found.append(
            Nearest(room=float(room[least]), time=float(times[least]), obstacle=zone.obstacle, body=body)
        )
    return min(found, key=lambda one: one.room)
