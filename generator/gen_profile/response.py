"""A plant's answer to a motion of its axes, as arrays over time."""

from __future__ import annotations

import attrs

from gen_profile.profile import Array


@attrs.frozen(kw_only=True, eq=False)
class Response:
    """What the machine does.

    Attributes
    ----------
    times : (samples,) array
        s, rising.
    position, velocity : (samples, axes) array
        Of the driven axes, in m and m/s (or rad and rad/s).
    sway, angle : (samples, loads) array
        Of every load as `gen_profile.plants.plant.Outputs` defines them, in m and rad.
    """

    times: Array
    position: Array
    velocity: Array
    sway: Array
    angle: Array
