"""Who answers a page whose questions come faster than answers: workers and a clock of the tests' own."""

import asyncio
import json

from gen_profile.studio.desk import CALM, PATIENCE, Desk
from gen_profile.studio.workers import BEGUN, ENDED, LOST, Message


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
    clock, hands, told = Clock(), Hands(), []
    desk = Desk(hands, clock)
    desk.attach(told.append)
    return clock, hands, told, desk


def names(told):
    return [(message.number, message.name) for message in told]


def test_a_quick_worker_answers_all_the_way_and_keeps_its_place():
    clock, hands, told, desk = page()
    for number in range(5):
        desk.show(number, f"state {number}")
        (worker,) = hands.taken
        worker.say(BEGUN)
        worker.say("curves")
        clock.wait(0.9 * PATIENCE)
    assert names(told) == [(number, "curves") for number in range(5)]
    assert not worker.ended


def test_one_that_is_at_an_older_question_for_too_long_is_replaced():
    clock, hands, told, desk = page()
    desk.show(0, "slow")
    slow = hands.taken[0]
    slow.say(BEGUN)
    desk.show(1, "newer")
    desk.show(2, "newest")
    clock.wait(0.9 * PATIENCE)
    assert not slow.ended
    clock.wait(0.2 * PATIENCE)
    assert slow.ended and len(hands.taken) == 2
    (job,) = hands.taken[1].jobs
    assert (job.number, job.question) == (2, "newest")
    slow.say("curves", slow.jobs[0])  # what was on its way from it is not heard
    clock.wait(10.0)
    assert len(hands.taken) == 2 and told == []  # and one that starts is not replaced for being slow to start


def test_what_takes_longer_is_asked_for_once_the_hand_rests():
    clock, hands, _, desk = page()
    for number in range(3):
        desk.show(number, f"state {number}")
        for name in (BEGUN, "curves", "verdict", ENDED):
            hands.taken[0].say(name)
        clock.wait(0.5 * CALM)
    assert len(hands.taken) == 1
    clock.wait(CALM)
    (job,) = hands.taken[1].jobs
    assert (job.kind, job.number, job.question) == ("depth", 2, "state 2")


def test_nothing_longer_is_asked_for_where_there_is_no_motion():
    clock, hands, _, desk = page()
    desk.show(0, "infeasible")
    for name in (BEGUN, "setting", "failure", ENDED):
        hands.taken[0].say(name)
    clock.wait(10.0)
    assert len(hands.taken) == 1


def test_the_same_question_is_asked_for_once_and_every_number_is_answered():
    _, hands, _, desk = page()
    desk.show(0, "state")
    desk.show(0, "state")
    assert len(hands.taken[0].jobs) == 1
    desk.show(2, "state")  # the page asked something else meanwhile, which was not let run
    assert hands.taken[0].jobs[-1].number == 2


def test_a_worker_that_dies_is_told_of_and_the_next_question_has_another():
    _, hands, told, desk = page()
    desk.show(0, "deadly")
    hands.taken[0].say(BEGUN)
    hands.taken[0].hear(hands.taken[0], Message(number=-1, name=LOST))
    (message,) = told
    assert "Undo the last change" in json.loads(message.text)["sentences"][0]
    desk.show(1, "harmless")
    assert hands.taken[1].jobs[0].question == "harmless"


def test_a_worker_that_dies_before_it_begins_is_no_fault_of_the_question():
    _, hands, told, desk = page()
    desk.show(0, "harmless")
    for worker in range(2):
        hands.taken[worker].hear(hands.taken[worker], Message(number=-1, name=LOST))
    assert told == [] and [hand.jobs[0].question for hand in hands.taken] == ["harmless"] * 3
    hands.taken[2].hear(hands.taken[2], Message(number=-1, name=LOST))  # none can be had
    assert names(told) == [(0, "failure")]
    assert json.loads(told[0].text)["answer"] == "unanswered"


def test_what_a_worker_says_after_the_studio_ended_is_let_go():
    _, hands, told, desk = page()
    desk.show(0, "state")
    loop = asyncio.new_event_loop()
    loop.close()
    desk._picture._loop = loop
    hands.taken[0].say("curves")
    assert told == []


def test_a_page_that_comes_late_hears_what_was_found_before():
    clock, hands = Clock(), Hands()
    desk = Desk(hands, clock)
    desk.show(0, "first")
    hands.taken[0].say("curves")
    told = []
    desk.attach(told.append)
    hands.taken[0].say("verdict")
    assert names(told) == [(0, "curves"), (0, "verdict")]


def test_a_page_that_leaves_takes_its_workers_along():
    _, hands, _, desk = page()
    desk.show(0, "state")
    desk.make("order")
    desk.close()
    assert [worker.ended for worker in hands.taken] == [True, True]


def test_a_page_that_is_closed_takes_no_worker_any_more():
    """What is looked at later was asked for after the page had gone, by a process that nobody ended."""
    clock, hands, _, desk = page()
    desk.show(0, "state")
    for name in (BEGUN, "verdict", ENDED):
        hands.taken[0].say(name)
    desk.close()
    clock.wait(2 * CALM)
    assert len(hands.taken) == 1 and hands.taken[0].ended


def test_what_looks_deeper_stands_still_while_a_hand_waits():
    clock, hands, _, desk = page()
    desk.show(0, "state 0")
    picture = hands.taken[0]
    for name in (BEGUN, "verdict", ENDED):
        picture.say(name)
    clock.wait(CALM)
    deeper = hands.taken[1]
    deeper.say(BEGUN)
    assert not deeper.still
    desk.show(1, "state 1")
    assert deeper.still and not picture.still
    for name in (BEGUN, "verdict", ENDED):
        picture.say(name)
    clock.wait(CALM)
    assert not deeper.still and deeper.jobs[-1].number == 1
