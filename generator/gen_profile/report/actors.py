"""The machines of an evaluation as actors of an animation."""

from collections.abc import Sequence

import numpy as np

from gen_profile.charts.curves import Shown, end_load_sway
from gen_profile.evaluation.motion_evaluation import MotionEvaluation
from gen_profile.plants.looks import body_size, drawings, pose_of
from gen_profile.report.animation import Actor, Animation
from gen_profile.spec.model import Spec

TWINS = 2
FRAME_RATE = 30.0  # 1/s; the page draws between frames
MOST_FRAMES = 600


def animation(spec: Spec, evaluation: MotionEvaluation, shown: Sequence[Shown], arrival: float) -> Animation:
    """Let the nominal machine and those that sway the most play the move, and swing on.

    Parameters
    ----------
    spec : Spec
    evaluation : MotionEvaluation
    shown : sequence of Shown
        Of which the first ranks play.
    arrival : float
        When the axes stand still, in s.
    """
    until = evaluation.motion.duration + evaluation.watch
    times = np.linspace(0.0, until, min(MOST_FRAMES, int(np.ceil(FRAME_RATE * until)) + 1))
    responses = evaluation.swing.at(times)
    plant = spec.machine()
    size = body_size(plant, evaluation.machines[0].parameters, responses[0].position)
    actors = []
    for one in shown:
        if one.rank > TWINS:
            continue
        response, parameters = responses[one.index], evaluation.machines[one.index].parameters
        pose = pose_of(plant, parameters, response.position, response.q_u, size)
        sway = end_load_sway(spec, response)
        actors.append(
            Actor(name=one.name, colour=one.style.colour, sway=sway, drawings=drawings(plant, pose))
        )
    return Animation(
        times=times,
        arrival=arrival,
        limit=spec.check.residual_sway[plant.loads[-1]],
        load=plant.end_load_name,
        actors=actors,
    )
