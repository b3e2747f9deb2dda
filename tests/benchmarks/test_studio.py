"""How long the studio takes from a knob to its picture: in units of a solve, and in a browser. Printed."""

import json
import time

import numpy as np
from end_to_end.studios import studio
from headless import browser

from gen_profile.methods.solvers.plan import draft
from gen_profile.presentation.studio.orders import Question
from gen_profile.presentation.studio.state import StudioState, preset_start
from gen_profile.presentation.studio.views import picture

TURNS = 60
REST = 0.5  # s between them, after which nothing of the last one is still at work


def test_the_first_part_of_a_picture_beside_the_solve():
    times = {"solve": [], "first part": [], "whole picture": []}
    for turn in range(15):
        edits = {"move.duration": 3.0 + 0.01 * turn}
        question = Question(start=preset_start("paper"), state=StudioState(preset="paper", edits=edits))
        spec = question.spec()
        began = time.process_time()
        draft(spec)
        times["solve"].append(time.process_time() - began)
        began = time.process_time()
        answer = picture(question)
        json.dumps(next(answer))
        times["first part"].append(time.process_time() - began)
        list(answer)
        times["whole picture"].append(time.process_time() - began)
    best = {name: min(spent) for name, spent in times.items()}
    print()
    for name, spent in best.items():
        print(
            f"{name:14} {1e3 * spent:6.1f} ms of the processor, {spent / best['solve']:4.1f} times the solve"
        )


def test_from_the_knob_s_event_to_the_picture_drawn():
    """The browser's own clock: from the event's time stamp to the frame after the curves were drawn."""
    began = time.perf_counter()
    with studio("--preset", "paper") as running:
        started = time.perf_counter() - began
        with browser() as page:
            page.size(1400, 900)
            running.open(page)
            page.wait("return document.documentElement.dataset.drawn === 'true'")
            page.wait("return document.querySelectorAll('#designs tr').length > 5")
            for _ in range(TURNS):
                page.run("""
                    const knob = document.querySelectorAll('[data-group=move] input[type=range]')[1];
                    knob.value = Number(knob.value) + 1;
                    knob.dispatchEvent(new Event('input'))""")
                time.sleep(REST)
            spent = np.array(
                page.run("""
                    return performance.getEntriesByName('picture')
                        .map((one) => [one.duration, one.detail.answered])""")
            )
    print(f"\naddress after {started:.2f} s; {len(spent)} turns: ", end="")
    print(", ".join(f"{share} % within {np.percentile(spent[:, 0], share):.0f} ms" for share in (5, 50, 95)))
    answered, drawn = np.median(spent[:, 1]), np.median(spent[:, 0] - spent[:, 1])
    print(f"{answered:.0f} ms of it until the answer is there, {drawn:.0f} ms until it is drawn")
