"""Who answers a page whose questions come faster than answers: workers and a clock of the tests' own."""

import asyncio
import json

from gen_profile.presentation.studio.session import IDLE_TIME, PATIENCE, Session
from gen_profile.presentation.studio.workers import BEGUN, ENDED, LOST, Message


class Clock:
    """An event loop whose time passes when a test says so."""

    def __init__(self):
        self.now, self.calls = 0.0, []

    def call_later(self, delay, callback, *arguments):
        self.calls.append((self.now + delay, callback, arguments))

    def call_soon_threadsafe(self, callback, *arguments):
        callback(*arguments)

    def wait(self, seconds):
        self.now += seconds
        due, self.calls = (
            [call for call in self.calls if call[0] <= self.now],
            [call for call in self.calls if call[0] > self.now],
        )
        for _, callback, arguments in due:
            callback(*arguments)


class Hand:
    """A worker that answers when a test says so."""

    def __init__(self, hear):
        self.hear, self.jobs, self.ended, self.still = hear, [], False, False

    def ask(self, job):
        self.jobs.append(job)
        self.still = False

    def pause(self):
        self.still = True

    def say(self, name, job=None):
        job = job or self.jobs[-1]
        self.hear(self, Message(number=job.number, kind=job.kind, name=name))


class Hands:
    def __init__(self):
        self.taken = []

    def take(self, hear):
        self.taken.append(Hand(hear))
        return self.taken[-1]

    def give_back(self, worker):
        worker.ended = True


def page():
    clock, hands, messages = Clock(), Hands(), []
    session = Session(hands, clock)
    session.attach(messages.append)
    return clock, hands, messages, session


def names(messages):
    return [(message.number, message.name) for message in messages]


def test_a_quick_worker_answers_all_the_way_and_keeps_its_place():
    clock, hands, messages, session = page()
    for number in range(5):
        session.show(number, f"state {number}")
        (worker,) = hands.taken
        worker.say(BEGUN)
        worker.say("curves")
        clock.wait(0.9 * PATIENCE)
    assert names(messages) == [(number, "curves") for number in range(5)]
    assert not worker.ended


def test_one_that_is_at_an_older_question_for_too_long_is_replaced():
    clock, hands, messages, session = page()
    session.show(0, "slow")
    slow = hands.taken[0]
    slow.say(BEGUN)
    session.show(1, "newer")
    session.show(2, "newest")
    clock.wait(0.9 * PATIENCE)
    assert not slow.ended
    clock.wait(0.2 * PATIENCE)
    assert slow.ended and len(hands.taken) == 2
    (job,) = hands.taken[1].jobs
    assert (job.number, job.question) == (2, "newest")
    slow.say("curves", slow.jobs[0])  # what was on its way from it is not heard
    clock.wait(10.0)
    assert (
        len(hands.taken) == 2 and messages == []
    )  # and one that starts is not replaced for being slow to start


def test_what_takes_longer_is_asked_for_once_the_hand_rests():
    clock, hands, _, session = page()
    for number in range(3):
        session.show(number, f"state {number}")
        for name in (BEGUN, "curves", "verdict", ENDED):
            hands.taken[0].say(name)
        clock.wait(0.5 * IDLE_TIME)
    assert len(hands.taken) == 1
    clock.wait(IDLE_TIME)
    (job,) = hands.taken[1].jobs
    assert (job.kind, job.number, job.question) == ("depth", 2, "state 2")


def test_nothing_longer_is_asked_for_where_there_is_no_motion():
    clock, hands, _, session = page()
    session.show(0, "infeasible")
    for name in (BEGUN, "setting", "failure", ENDED):
        hands.taken[0].say(name)
    clock.wait(10.0)
    assert len(hands.taken) == 1


def test_the_same_question_is_asked_for_once_and_every_number_is_answered():
    _, hands, _, session = page()
    session.show(0, "state")
    session.show(0, "state")
    assert len(hands.taken[0].jobs) == 1
    session.show(2, "state")  # the page asked something else meanwhile, which was not let run
    assert hands.taken[0].jobs[-1].number == 2


def test_a_worker_that_dies_is_told_of_and_the_next_question_has_another():
    _, hands, messages, session = page()
    session.show(0, "deadly")
    hands.taken[0].say(BEGUN)
    hands.taken[0].hear(hands.taken[0], Message(number=-1, name=LOST))
    (message,) = messages
    assert "Undo the last change" in json.loads(message.text)["sentences"][0]
    session.show(1, "harmless")
    assert hands.taken[1].jobs[0].question == "harmless"


def test_a_worker_that_dies_before_it_begins_is_no_fault_of_the_question():
    _, hands, messages, session = page()
    session.show(0, "harmless")
    for worker in range(2):
        hands.taken[worker].hear(hands.taken[worker], Message(number=-1, name=LOST))
    assert messages == [] and [hand.jobs[0].question for hand in hands.taken] == ["harmless"] * 3
    hands.taken[2].hear(hands.taken[2], Message(number=-1, name=LOST))  # none can be had
    assert names(messages) == [(0, "failure")]
    assert json.loads(messages[0].text)["answer"] == "unanswered"


def test_what_a_worker_says_after_the_studio_ended_is_let_go():
    _, hands, messages, session = page()
    session.show(0, "state")
    loop = asyncio.new_event_loop()
    loop.close()
    session._queues["picture"]._loop = loop
    hands.taken[0].say("curves")
    assert messages == []


def test_a_page_that_comes_late_hears_what_was_found_before():
    clock, hands = Clock(), Hands()
    session = Session(hands, clock)
    session.show(0, "first")
    hands.taken[0].say("curves")
    messages = []
    session.attach(messages.append)
    hands.taken[0].say("verdict")
    assert names(messages) == [(0, "curves"), (0, "verdict")]


def test_a_page_that_leaves_takes_its_workers_along():
    _, hands, _, session = page()
    session.show(0, "state")
    session.ask("files", 1, "order")
    session.close()
    assert [worker.ended for worker in hands.taken] == [True, True]


def test_a_page_that_is_closed_takes_no_worker_any_more():
    """What is looked at later was asked for after the page had gone, by a process that was not ended."""
    clock, hands, _, session = page()
    session.show(0, "state")
    for name in (BEGUN, "verdict", ENDED):
        hands.taken[0].say(name)
    session.close()
    clock.wait(2 * IDLE_TIME)
    assert len(hands.taken) == 1 and hands.taken[0].ended


def test_what_looks_deeper_stands_still_while_a_hand_waits():
    clock, hands, _, session = page()
    session.show(0, "state 0")
    picture = hands.taken[0]
    for name in (BEGUN, "verdict", ENDED):
        picture.say(name)
    clock.wait(IDLE_TIME)
    deeper = hands.taken[1]
    deeper.say(BEGUN)
    assert not deeper.still
    session.show(1, "state 1")
    assert deeper.still and not picture.still
    for name in (BEGUN, "verdict", ENDED):
        picture.say(name)
    clock.wait(IDLE_TIME)
    assert not deeper.still and deeper.jobs[-1].number == 1
