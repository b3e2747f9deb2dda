"""Linear algebra on one thread.

Matrices of a hundred rows are too small to share: threads that wait for a busy machine's other core cost up
to a hundredfold, and how they share the work would show in the last bits.
"""

from contextlib import ContextDecorator
from functools import cache
from threading import Lock

from threadpoolctl import ThreadpoolController


class _OneThread(ContextDecorator):
    """Let BLAS and LAPACK use one thread in a context or function, and in all that run at the same time.

    The limit is that of the whole process, from the first context that begins to the last one that ends.
    """

    def __init__(self) -> None:
        self._lock, self._open = Lock(), 0

    def __enter__(self) -> None:
        with self._lock:
            if self._open == 0:
                self._limit = _libraries().limit(limits=1, user_api="blas")
            self._open += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._open -= 1
            if self._open == 0:
                self._limit.restore_original_limits()


one_thread = _OneThread()


@cache
def _libraries() -> ThreadpoolController:
    """Find the libraries of NumPy and of SciPy, which has its own; only what is loaded is found."""
    import scipy.linalg  # noqa: F401, PLC0415  (loads slowly)

    return ThreadpoolController()
