"""Linear algebra on one thread.

Matrices of a hundred rows are too small to share: threads that wait for a busy machine's other core cost up
to a hundredfold, and how they share the work would show in the last bits.
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache

from threadpoolctl import ThreadpoolController


def one_thread() -> AbstractContextManager[object]:
    """Let BLAS and LAPACK use one thread in the context."""
    context: AbstractContextManager[object] = _libraries().limit(limits=1, user_api="blas")
    return context


@cache
def _libraries() -> ThreadpoolController:
    """Find the libraries of NumPy and of SciPy, which has its own; only what is loaded is found."""
    import scipy.linalg  # noqa: F401, PLC0415  (loads slowly)

    return ThreadpoolController()
