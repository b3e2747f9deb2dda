"""Processes that answer the studio's questions, and what becomes of a question where one dies."""

from multiprocessing import active_children
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from queue import Queue
from time import sleep

import pytest

from gen_profile.presentation.studio.workers import BEGUN, ENDED, Job, Workers

HANG = 300.0  # s without any answer


@pytest.mark.slow
def test_one_that_dies_while_it_waits_answers_nothing(monkeypatch):
    workers = Workers()
    (waiting,) = active_children()
    # what the standard library says while another thread is collecting the process
    monkeypatch.setattr(BaseProcess, "is_alive", lambda _: True)
    waiting.kill()
    while Path(f"/proc/{waiting.pid}").exists():
        sleep(0.001)
    heard = Queue()
    workers.take(lambda _, message: heard.put(message.name)).ask(Job(number=0, kind="picture", question=None))
    assert heard.get(timeout=HANG) == BEGUN
    workers.close()


@pytest.mark.slow
def test_one_that_stands_still_goes_on_when_it_is_asked():
    heard, workers = Queue(), Workers()
    worker = workers.take(lambda _, message: heard.put(message.name))
    worker.ask(Job(number=0, kind="picture", question=None))
    while heard.get(timeout=HANG) != ENDED:
        pass
    worker.pause()
    worker.ask(Job(number=1, kind="picture", question=None))
    assert heard.get(timeout=HANG) == BEGUN
    worker.pause()
    ended = active_children()
    workers.close()
    # not `is_alive`, which errs while the worker's own thread is collecting the process
    assert all(wait([process.sentinel], HANG) for process in ended)
