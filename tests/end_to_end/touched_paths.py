"""Run `gen-profile` and write down which of its calls touch a folder: touched_paths.py LOG FOLDER WORDS…

Its worker processes import this file, too, for it is their main module.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from typing import Any

LOG, FOLDER = sys.argv[1:3]
ASKING = ("stat", "lstat", "access", "readlink", "listdir", "scandir", "open", "statvfs", "getxattr")


def note(event: str, arguments: tuple[Any, ...]) -> None:
    """Write down a call that names the folder or what is in it."""
    if any(isinstance(word, str | bytes | os.PathLike) and FOLDER in os.fsdecode(word) for word in arguments):
        descriptor = WRITE(LOG, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        os.write(descriptor, f"{event} {arguments}\n".encode())
        os.close(descriptor)


def spied(name: str, call: Callable[..., Any]) -> Callable[..., Any]:
    """Note a call before it is made: for these, Python has no audit event."""

    def noting(*arguments: Any, **options: Any) -> Any:
        note(f"os.{name}", arguments)
        return call(*arguments, **options)

    return noting


WRITE = os.open
for asked in ASKING:
    setattr(os, asked, spied(asked, getattr(os, asked)))
sys.addaudithook(
    lambda event, arguments: note(event, arguments) if event.split(".")[0] in ("open", "os") else None
)

if __name__ == "__main__":
    from gen_profile.cli import main

    sys.argv[1:] = sys.argv[3:]
    main()
