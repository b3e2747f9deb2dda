"""What was found before, found again in place of being computed."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

from gen_profile.support.work import budget, left, spend

KEPT = 8  # results of a function: a hand turns one knob at a time, and a sweep varies the last key first
MUCH = 1e6  # s of work, more than any answer takes

Asked = ParamSpec("Asked")
Found = TypeVar("Found")
_memories: list[deque[Any]] = []


def remembered(asks: Callable[Asked, Any]) -> Callable[[Callable[Asked, Found]], Callable[Asked, Found]]:
    """Keep the last results of a function that depends on nothing but what it is asked for.

    The work that it took is counted again, so that a search ends where it would have ended: answers are the
    same to the last bit, whatever was asked before.

    Parameters
    ----------
    asks : callable
        From the function's arguments to all that its result depends on, which is compared by ``==``.
    """

    def keeping(find: Callable[Asked, Found]) -> Callable[Asked, Found]:
        kept: deque[tuple[Any, Found, float]] = deque(maxlen=KEPT)
        _memories.append(kept)

        @wraps(find)
        def found_again(*arguments: Asked.args, **options: Asked.kwargs) -> Found:
            asked = asks(*arguments, **options)
            for before, found, work in tuple(kept):
                if before == asked:
                    spend(work)
                    return found
            with budget(MUCH):
                begun = left()
                found = find(*arguments, **options)
                kept.append((asked, found, begun - left()))
            return found

        return found_again

    return keeping


def forget() -> None:
    """Forget all that was found."""
    for kept in _memories:
        kept.clear()
