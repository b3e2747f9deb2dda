"""Work on all processors, with results in order, so that they do not depend on how many there are."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

from gen_profile.assurance.verification.batch import processors
from gen_profile.support.one_thread import one_thread

T = TypeVar("T")
R = TypeVar("R")


def in_order(function: Callable[[T], R], work: Iterable[T]) -> Iterator[R]:
    """Do work as it comes, on threads, as NumPy lets them run at once; few are ahead, as arrays are large."""
    count, running = processors(), deque[Future[R]]()
    with one_thread, ThreadPoolExecutor(count) as pool:
        for one in work:
            running.append(pool.submit(function, one))
            if len(running) > count:
                yield running.popleft().result()
        while running:
            yield running.popleft().result()
