"""Many commands in one rhythm, which accumulate what stated errors leave."""

from gen_profile.assurance.proof.habits import Manner, Surroundings
from gen_profile.motion.profile import Array
from gen_profile.planner.commands import Command

WAITS = (0.15, 1.0)  # periods, from one command of a rhythm to the next
UNEVEN = 2.0  # by which every other wait may be longer or shorter
EVEN = 1.0 / 3.0  # share of the rhythms whose waits are all the same
STEPS = (0.002, 0.5)  # of the travel, between targets
SPEEDS = (0.2, 1.0)  # of the greatest
BEATS = (  # what a rhythm commands in turn, and its sign
    (("velocity", 1.0), ("velocity", -1.0)),
    (("velocity", 1.0), ("velocity", 0.0), ("velocity", -1.0), ("velocity", 0.0)),
    (("position", 1.0), ("position", -1.0)),
    (("position", 1.0), ("stop", 0.0), ("position", -1.0), ("stop", 0.0)),
)


def rhythm(choices: Array, around: Surroundings, lasts: float) -> Manner:
    """Throw the stick over, or send the axes to and fro, in one rhythm for so many seconds; then stop.

    Parameters
    ----------
    choices : (5 + axes,) array
        Kind, wait, how uneven, size and place; and a share of the size for each axis.
    around : Surroundings
    lasts : float
    """
    kind, wait, uneven, size, place, *shares = choices.tolist()
    beats = BEATS[min(int(kind * len(BEATS)), len(BEATS) - 1)]
    first = around.period * WAITS[0] * (WAITS[1] / WAITS[0]) ** wait
    uneven = 2.0 * uneven - 1.0
    waits = (first, first * UNEVEN ** (uneven - min(max(uneven, -EVEN), EVEN)))
    size = min(1.0, 1.1 * size)
    axes = [*zip(around.targets, around.speeds, shares, strict=True)]
    fast, far = SPEEDS[0] + size * (SPEEDS[1] - SPEEDS[0]), STEPS[0] * (STEPS[1] / STEPS[0]) ** size
    speeds = [top * fast * min(1.0, 0.5 + share) for _, (_, top), share in axes]
    steps = [0.5 * (high - low) * far * min(1.0, 0.5 + share) for (low, high), _, share in axes]
    middles = [
        low + step + place * (high - low - 2.0 * step)
        for ((low, high), *_), step in zip(axes, steps, strict=True)
    ]
    commands, time = [Command(time=0.0, command="velocity", values=(0.0,) * len(axes))], 0.5 * around.period
    while time < lasts:
        command, sign = beats[(len(commands) - 1) % len(beats)]
        values = {
            "velocity": tuple(sign * speed for speed in speeds),
            "position": tuple(middle + sign * step for middle, step in zip(middles, steps, strict=True)),
        }
        commands.append(Command(time=time, command=command, values=values.get(command, ())))
        time += waits[len(commands) % 2]
    return *commands, Command(time=time, command="stop")
