"""What one page asks, and who answers: the newest question only, however fast a hand is."""

import json
from asyncio import AbstractEventLoop
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import attrs

from gen_profile.presentation.studio.workers import (
    ANSWERS,
    BEGUN,
    ENDED,
    LOST,
    Job,
    Message,
    Worker,
    Workers,
    failure,
)

PATIENCE = 0.6  # s that a question may wait for the first part of an older one's answer
IDLE_TIME = 0.3  # s without a new question, after which what takes longer is asked for
NO_PAGE = -2  # whose question no page asks
TRIES = 2  # of a new worker in the place of one that died before it began anything
GONE = "The process that solved this has ended, and another one takes its place. Undo the last change."

Tell = Callable[[Message], None]


class RequestQueue:
    """Questions of one kind, numbered upwards; what is overtaken is left unfinished."""

    def __init__(self, kind: str, workers: Workers, loop: AbstractEventLoop, tell: Tell) -> None:
        self._workers, self._loop, self._tell = workers, loop, tell
        self._worker: Worker | None = None
        self._job = Job(number=-1, kind=kind, question=None)
        self._begun = self._ended = -1
        self._deaths = 0  # of workers, in a row, that had begun nothing
        # whether the worker has begun anything: one that starts is at no older question
        self._answers = False

    def ask(self, number: int, question: Any) -> None:
        """Ask."""
        waits = self._ended < self._job.number
        self._job = attrs.evolve(self._job, number=number, question=question)
        if self._worker is None:
            self._take_worker()
        else:
            self._worker.ask(self._job)
        if waits:
            self._loop.call_later(PATIENCE, self._overtake, number)

    def pause(self) -> None:
        """Let the worker stand still until it is asked again."""
        if self._worker is not None:
            self._worker.pause()

    def stop(self) -> None:
        """Let go of the worker, whatever it does."""
        if self._worker is not None:
            self._workers.give_back(self._worker)
        self._worker, self._ended = None, self._job.number

    def _overtake(self, number: int) -> None:
        """Ask another worker where this one is still at an older question."""
        if self._worker is None or self._begun >= number:
            return
        if self._answers:
            self._workers.give_back(self._worker)
            self._take_worker()
        elif number == self._job.number:  # one that starts may yet begin with an older question
            self._loop.call_later(PATIENCE, self._overtake, number)

    def _take_worker(self) -> None:
        self._worker, self._answers = self._workers.take(self._heard_elsewhere), False
        self._worker.ask(self._job)

    def _heard_elsewhere(self, worker: Worker, message: Message) -> None:
        with suppress(RuntimeError):  # the loop was closed: the studio ends
            self._loop.call_soon_threadsafe(self._heard, worker, message)

    def _heard(self, worker: Worker, message: Message) -> None:
        if worker is not self._worker:
            return
        if message.name == LOST and not self._answers and self._deaths < TRIES:
            self._deaths += 1
            self._take_worker()  # it died while it waited: the question is not to blame
            return
        if message.name == LOST:
            self.stop()
            kind, number = self._job.kind, self._job.number
            text = json.dumps({**failure("unanswered", [GONE]), "of": kind, "serial": number})
            message = Message(number=number, kind=kind, name="failure", text=text)
        elif message.name == BEGUN:
            self._begun, self._answers, self._deaths = message.number, True, 0
        elif message.name == ENDED:
            self._ended = message.number
        self._tell(message)


class Session:
    """The lines of one page: the picture, then what takes longer; files and logs when they are asked for."""

    def __init__(self, workers: Workers, loop: AbstractEventLoop) -> None:
        self._loop, self._heard = loop, list[Message]()
        self._tell: Tell = self._heard.append
        self._queues = {kind: RequestQueue(kind, workers, loop, self._take) for kind in ANSWERS}
        self._question: Any = None
        self._newest = self._solved = -1

    def attach(self, tell: Tell) -> None:
        """Pass on what was found so far, and from now on."""
        self._tell = tell
        for message in self._heard:
            tell(message)

    def show(self, number: int, question: Any) -> None:
        """Ask for the picture of a state."""
        if (number, question) != (self._newest, self._question):  # else it is on its way: the first page's
            self._newest, self._question = number, question
            self._queues["depth"].pause()
            self.ask("picture", number, question)

    def ask(self, kind: str, number: int, question: Any) -> None:
        """Ask for one of `ANSWERS`; the numbers of a kind rise."""
        self._queues[kind].ask(number, question)

    def stop(self, kind: str) -> None:
        """Ask no more for it, and let go of its worker."""
        self._queues[kind].stop()

    def close(self) -> None:
        """Let go of all workers, and take none any more for what was due later."""
        self._newest = NO_PAGE
        for queue in self._queues.values():
            queue.stop()

    def _take(self, message: Message) -> None:
        if message.name not in (BEGUN, ENDED):
            self._tell(message)
        if message.name == "verdict":
            self._solved = message.number
        elif message.name == ENDED and message.kind == "picture" and self._solved == message.number:
            self._loop.call_later(IDLE_TIME, self._look_deeper, message.number)

    def _look_deeper(self, number: int) -> None:
        if number == self._newest:
            self.ask("depth", number, self._question)
