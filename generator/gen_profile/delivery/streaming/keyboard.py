"""A planner commanded from the keyboard: keys of a terminal as the stick and buttons of a crane."""

import os
import select
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress

from gen_profile.delivery.streaming.status import in_units
from gen_profile.planner.commands import Command
from gen_profile.planner.interface import BlockAxis
from gen_profile.support.errors import SpecError
from gen_profile.support.suggestion import number_meant

FRACTION = 0.1  # of the greatest velocity, by which an arrow changes that of the stick
ARROWS = "← →", "↓ ↑"  # of the first axis and the second
CURSOR = {b"C": (0, 1), b"D": (0, -1), b"A": (1, 1), b"B": (1, -1)}  # keys' last bytes: axis, tenths more
CURSOR_KEY = 3  # bytes of its escape sequence, also in application mode; other keys have more
LETTERS = 0x40  # from which on a byte ends one
ENTER, ERASE, END = b"\r\n", b"\x7f\x08", b"xX\x04"


class Keys:
    """Commands out of the bytes that a terminal sends.

    Parameters
    ----------
    axes : sequence of BlockAxis
        Two of which have arrows.
    greatest : (axes,) sequence of float
        m/s (or rad/s), of the stick.

    Attributes
    ----------
    typed : str
        Positions that are being typed, with commas between.
    shown : str
        The command that holds, in words.
    over : bool
        Whether the end was asked for.
    """

    def __init__(self, axes: Sequence[BlockAxis], greatest: Sequence[float]) -> None:
        self.typed, self.shown, self.over = "", "stands", False
        self._axes, self._greatest, self._rest = axes, greatest, b""
        self._tenths = [0] * len(axes)

    def take(self, sent: bytes) -> Iterator[Command]:
        """Turn what was typed into commands."""
        left, self._rest = self._rest + sent, b""
        while left:
            size = _length(left)
            if size > len(left):
                self._rest = left  # of a cursor key, whose rest comes with the next bytes
                return
            key, left = left[:size], left[size:]
            command = self._command(key)
            if command is not None:
                yield command

    def _command(self, key: bytes) -> Command | None:
        axis, more = CURSOR.get(key[-1:], (0, 0)) if len(key) == CURSOR_KEY else (0, 0)
        if more and axis < len(self._axes):
            self._tenths[axis] = max(-10, min(10, self._tenths[axis] + more))
            pairs = zip(self._tenths, self._greatest, strict=True)
            values = tuple(tenths * FRACTION * greatest for tenths, greatest in pairs)
            return self._given("velocity", values, f"stick at {in_units(values, self._axes, '{:.3g}', '/s')}")
        if key in END:
            self.over = True
        if key == b" " or self.over:
            return self._given("stop", (), "stop")
        if key in b"qQ":
            return self._given("quick-stop", (), "quick stop")
        if key in ENTER and self.typed:
            return self._target()
        if key in ERASE:
            self.typed = self.typed[:-1]
        elif len(key) == 1 and key > b" ":
            self.typed += key.decode("ascii", "replace")  # all of it: 3,5 without its comma would be 35 m
        return None

    def _target(self) -> Command | None:
        text, self.typed = self.typed, ""
        parts = text.split(",") if len(self._axes) > 1 else [text]
        try:
            values = tuple(float(part) for part in parts)
        except ValueError:
            self.shown = f"{text} is no number{number_meant(text)}"
            return None
        if len(values) != len(self._axes):
            self.shown = f"{text}: enter a position for each of {len(self._axes)} axes"
            return None
        return self._given("position", values, f"to {in_units(values, self._axes, '{:g}')}")

    def _given(self, command: str, values: tuple[float, ...], words: str) -> Command:
        if command != "velocity":
            self._tenths = [0] * len(self._axes)
        self.typed, self.shown = "", words
        return Command(time=0.0, command=command, values=values)


def _in_foreground(terminal: int) -> bool:
    """Tell whether keys can be read, as no process in the background can."""
    if sys.platform == "win32":
        return False
    return os.isatty(terminal) and os.tcgetpgrp(terminal) == os.getpgrp()


def _length(left: bytes) -> int:
    """Count the bytes of the first key: an escape sequence ends with a letter or a tilde."""
    if left[:1] != b"\x1b" or left[1:2] not in (b"", b"[", b"O"):
        return 1
    return next((end for end in range(CURSOR_KEY, len(left) + 1) if left[end - 1] >= LETTERS), len(left) + 1)


class Keyboard:
    """A terminal's keys as an `Operator` of a planner.

    Parameters
    ----------
    terminal : int
        Its file descriptor.
    axes, greatest
        As of `Keys`.

    Raises
    ------
    SpecError
        It is no terminal in the foreground.
    """

    attends = True

    def __init__(self, terminal: int, axes: Sequence[BlockAxis], greatest: Sequence[float]) -> None:
        if not _in_foreground(terminal):
            raise SpecError(
                "The keyboard: standard input is no terminal in the foreground (of Linux or macOS); give a "
                "file of commands."
            )
        self._terminal, self._axes, self._keys = terminal, axes, Keys(axes, greatest)

    @property
    def help(self) -> str:
        """Which keys there are."""
        several = len(self._axes) > 1
        arrows = zip(ARROWS, self._axes, strict=False)
        sticks = ", ".join(f"{keys} velocity{f' of {a.name}' if several else ''}" for keys, a in arrows)
        place = f"positions ({','.join(a.name for a in self._axes)})" if several else "a position"
        return f"Keys: {sticks}, space stop, q quick stop, {place} and Enter, x end."

    @property
    def over(self) -> bool:
        """Whether the end was asked for, or the terminal is gone."""
        return self._keys.over

    @property
    def commanded(self) -> str:
        """What holds, and what is being typed."""
        typed = f"to {self._keys.typed}_ {self._axes[-1].unit}" if self._keys.typed else ""
        return "; ".join(filter(None, [self._keys.shown, typed]))

    @contextmanager
    def operated(self) -> Iterator[None]:
        """Take keys one by one, unseen; the terminal is given back as it was, whatever happens."""
        if sys.platform == "win32":
            raise NotImplementedError  # as no keyboard is made there
        import termios  # noqa: PLC0415
        import tty  # noqa: PLC0415

        before = termios.tcgetattr(self._terminal)
        try:
            tty.setcbreak(self._terminal)  # Ctrl-C goes on being one; what was typed before is lost
            yield
        finally:
            with suppress(termios.error):  # it is gone
                termios.tcsetattr(self._terminal, termios.TCSAFLUSH, before)

    def due(self, cycle: int) -> Iterable[Command]:
        """Read the keys that were hit, and wait for none; what was typed before the first cycle is lost."""
        if self.over or not select.select([self._terminal], [], [], 0)[0]:
            return ()
        try:
            sent = os.read(self._terminal, 64)
        except OSError:
            sent = b""
        if cycle == 0 and sent:
            return ()
        return tuple(self._keys.take(sent or b"\x04"))
