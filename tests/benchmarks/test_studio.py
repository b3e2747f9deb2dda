"""How long the studio takes from a knob to its picture: in units of a solve, and in a browser. Printed."""

import json
import time
from contextlib import suppress

import numpy as np
import pytest
from end_to_end.studios import studio
from headless import browser

from gen_profile.methods.solvers.plan import answer_of, draft
from gen_profile.presentation.studio.knobs import knobs
from gen_profile.presentation.studio.orders import Question
from gen_profile.presentation.studio.state import StudioState, preset_start
from gen_profile.presentation.studio.views import picture
from gen_profile.spec.reading import presets
from gen_profile.support.errors import SpecError
from gen_profile.support.remembered import forget
from gen_profile.support.work import budget

GOAL = 0.4  # of a solve, for the step of a knob
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


@pytest.mark.parametrize("preset", presets())
def test_the_step_of_a_knob_beside_a_solve_of_which_nothing_is_remembered(preset):
    """By 1 %, from the preset's own values; of knobs that its spec states as numbers."""

    def solved(state):
        spec = Question(start=preset_start(preset), state=state).spec()
        began = time.process_time()
        with budget(*answer_of(spec)):
            draft(spec)
        return time.process_time() - began

    still = StudioState(preset=preset, edits={})
    question = Question(start=preset_start(preset), state=still)
    spec = question.spec()
    solved(still)  # derives the machine's equations
    forget()
    every = knobs(spec, question.document(), question.beginning())
    numbers = [knob for knob in every if knob.kind == "number" and knob.index is None and knob.value]
    cold, found = solved(still), dict[str, float]()
    for knob in numbers:
        edits = {knob.path: knob.value + 1 if knob.whole else 1.01 * knob.value}
        with suppress(SpecError):
            found[knob.path] = solved(StudioState(preset=preset, edits=edits)) / cold
        solved(still)
    slow = ", ".join(f"{path} {ratio:.2f}" for path, ratio in found.items() if ratio > GOAL)
    share = np.mean([ratio <= GOAL for ratio in found.values()])
    print(
        f"\n{preset}: {1e3 * cold:.1f} ms; {100 * share:.0f} % of the knobs take at most {GOAL} of it; {slow}"
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
