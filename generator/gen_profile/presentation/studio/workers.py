"""Processes that answer questions, one each; one that is overtaken can be ended, for another is ready."""

import gc
import json
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from multiprocessing.connection import Connection
from threading import Lock, Thread, Timer
from typing import Any

import attrs

from gen_profile.delivery.streaming.priority import lower_priority
from gen_profile.support.one_thread import one_thread
from gen_profile.support.phrase import plain
from gen_profile.support.work import Overtaken, budget

# what can be asked, and what answers it, which only a worker loads
ANSWERS = {
    "picture": "gen_profile.presentation.studio.views:picture",
    "depth": "gen_profile.presentation.studio.depth:depth",
    "files": "gen_profile.presentation.studio.files:files",
    "drive": "gen_profile.presentation.studio.driving:drive",
    "log": "gen_profile.presentation.studio.logs:log",
}
POLITE = {"depth", "files", "log"}  # give way to what a hand waits for
PURE = {"picture", "depth"}  # which can be left anywhere: they keep and write nothing
MUCH = 1e6  # s of work, more than any answer takes
FRAME = 0.015  # s after the curves of a picture, in which the browser has the processor to draw them
# s after a part, in which a newer question is waited for: while a stack is dragged, one comes every frame
PAUSES = {"curves": FRAME, "sketch": 0.05}
PAUSE = 1.0  # s after a worker was taken, in which it has the processor for itself
BEGUN, ENDED, LOST = "begun", "ended", "lost"

Part = dict[str, Any]


@attrs.frozen(kw_only=True)
class Message:
    """A part of an answer, as it goes to a page.

    Attributes
    ----------
    number : int
        Of the question.
    kind : str
        Of the question.
    name : str
        Of the part; or that a question is taken up (`BEGUN`) or done with (`ENDED`), or the process `LOST`.
    text : str
        The part in JSON.
    file : (str, bytes) or None
        Name and content of a file that was made.
    """

    number: int
    kind: str = ""
    name: str
    text: str = "{}"
    file: tuple[str, bytes] | None = None


def failure(answer: str, sentences: Sequence[str], suggestions: Sequence[Mapping[str, Any]] = ()) -> Part:
    """Say why there is no picture, and what would help.

    Parameters
    ----------
    answer : {"none", "faulty", "unanswered"}
        Whether there is no such motion, a value does not fit, or no answer was found.
    sentences : sequence of str
    suggestions : sequence of mapping
        Edits of the spec.
    """
    return {
        "part": "failure",
        "answer": answer,
        "sentences": [*sentences],
        "cures": [dict(one) for one in suggestions],
    }


Hear = Callable[["Worker", Message], None]


@attrs.frozen(kw_only=True)
class Job:
    """A question, and who is to answer it.

    Attributes
    ----------
    number : int
        By which its answer is known.
    kind : str
        One of `ANSWERS`.
    question
        What they take.
    """

    number: int
    kind: str
    question: Any


class Worker:
    """One process, and a thread that hears it.

    Parameters
    ----------
    hear : callable
        Takes every part of an answer, in that thread.
    """

    def __init__(self, hear: Hear | None = None) -> None:
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._process = context.Process(target=_work, args=(theirs,), daemon=True)
        self._process.start()
        theirs.close()
        self._lock, self._lost, self._hear = Lock(), False, hear
        Thread(target=self._listen, daemon=True).start()

    def heard_by(self, hear: Hear) -> bool:
        """Let another receiver hear it from now on; False where it is lost already."""
        with self._lock:  # else it could be lost in between, unnoticed
            if not self._lost:
                self._hear = hear
            return not self._lost

    def ask(self, job: Job) -> None:
        """Hand over a question; what is being answered is left unfinished at the next part."""
        self._signal("SIGCONT")
        with suppress(OSError):  # a process that has ended is heard of
            self._connection.send(job)

    def pause(self) -> None:
        """Let the process stand still until it is asked again."""
        self._signal("SIGSTOP")

    def _signal(self, name: str) -> None:
        """Send the process a signal, where the system knows it, which Windows does not."""
        pid = self._process.pid
        if pid is not None and hasattr(signal, name):
            with suppress(OSError):
                os.kill(pid, getattr(signal, name))

    def end(self) -> None:
        """End the process at once, and hear no more of it."""
        self._hear = None
        self._process.kill()

    def _listen(self) -> None:
        with suppress(EOFError, OSError):
            while True:
                self._tell(self._connection.recv())
        with self._lock:
            self._lost = True
        self._process.join()
        self._tell(Message(number=-1, name=LOST))

    def _tell(self, message: Message) -> None:
        hear = self._hear
        if hear is not None:
            hear(self, message)


class Workers:
    """Workers that wait until they are needed: one is ready soon after another was taken."""

    def __init__(self) -> None:
        self._lock, self._closed = Lock(), False
        self._taken: list[Worker] = []
        self._ready: Worker | None = Worker()

    def take(self, hear: Hear) -> Worker:
        """Take the worker that is ready, or a new one."""
        with self._lock:
            ready, self._ready = self._ready, None
            worker = ready if ready is not None and ready.heard_by(hear) else Worker(hear)
            self._taken.append(worker)
        later = Timer(PAUSE, self._prepare)
        later.daemon = True
        later.start()
        return worker

    def _prepare(self) -> None:
        with self._lock:
            if self._ready is None and not self._closed:
                self._ready = Worker()

    def give_back(self, worker: Worker) -> None:
        """End a worker."""
        worker.end()
        with self._lock, suppress(ValueError):
            self._taken.remove(worker)

    def close(self) -> None:
        """End all."""
        with self._lock:
            self._closed = True
            for worker in filter(None, (*self._taken, self._ready)):
                worker.end()


def _work(connection: Connection) -> None:
    """Answer questions until none is asked any more; in a process of its own."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # which is for the server
    if sys.platform != "win32":
        os.setpgrp()
    import_module("gen_profile.presentation.studio.views")  # before the first question comes
    gc.freeze()  # what was loaded stays: looking through it for garbage takes as long as a solve
    with one_thread, suppress(EOFError, OSError):
        while True:
            job = connection.recv()
            while connection.poll():
                job = connection.recv()
            _answer(connection, job)


def _answer(connection: Connection, job: Job) -> None:
    if job.kind in POLITE:
        lower_priority()
    connection.send(Message(number=job.number, kind=job.kind, name=BEGUN))
    with suppress(Overtaken), budget(MUCH, stop=connection.poll if job.kind in PURE else None):
        _tell(connection, job)


def _tell(connection: Connection, job: Job) -> None:
    """Send the parts of an answer, as long as no newer question is asked."""
    for part in _parts(job):
        file, document = part.get("file"), {**part, "of": job.kind, "serial": job.number}
        if file is not None:
            document["file"] = None
        text = json.dumps(plain(document), separators=(",", ":"))
        connection.send(Message(number=job.number, kind=job.kind, name=part["part"], text=text, file=file))
        if connection.poll(PAUSES.get(part["part"], 0.0)):
            return
    connection.send(Message(number=job.number, kind=job.kind, name=ENDED))


def _parts(job: Job) -> Iterator[Mapping[str, Any]]:
    """Answer a question; what should not happen is a sentence, too."""
    module, _, name = ANSWERS[job.kind].partition(":")
    try:
        yield from getattr(import_module(module), name)(job.question)
    except Exception as error:
        sentence = f"Internal error ({type(error).__name__}: {error}); undo the last change."
        yield failure("unanswered", [sentence])
