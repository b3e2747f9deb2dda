"""A planner commanded from the keyboard: keys of a terminal as the stick and buttons of a crane."""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress

from gen_profile.errors import SpecError
from gen_profile.planner.commands import Command

SHARE = 0.1  # of the greatest velocity, by which an arrow changes that of the stick
PAUSE = 0.25  # s between two reports
PROMISES = {0: "no sway", 1: "may sway", 2: "may sway", 3: "not ready"}  # by nPromise
HELP = "Keys: ← → velocity, space stop, q quick stop, a position and Enter, x end."
RIGHT, LEFT = (b"\x1b[C", b"\x1bOC"), (b"\x1b[D", b"\x1bOD")  # cursor keys, and in application mode
ENTER, ERASE, END = b"\r\n", b"\x7f\x08", b"xX\x04"


class Keys:
    """Commands out of the bytes that a terminal sends.

    Parameters
    ----------
    greatest : float
        m/s, of the stick.

    Attributes
    ----------
    typed : str
        Position that is being typed.
    shown : str
        The command that holds, in words.
    over : bool
        Whether the end was asked for.
    """

    def __init__(self, greatest: float) -> None:
        self.typed, self.shown, self.over = "", "stands", False
        self._greatest, self._tenths, self._rest = greatest, 0, b""

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
        if key in RIGHT or key in LEFT:
            self._tenths = max(-10, min(10, self._tenths + (1 if key in RIGHT else -1)))
            value = self._tenths * SHARE * self._greatest
            return self._given("velocity", value, f"stick at {value:.3g} m/s")
        if key in END:
            self.over = True
        if key == b" " or self.over:
            return self._given("stop", 0.0, "stop")
        if key in b"qQ":
            return self._given("quick-stop", 0.0, "quick stop")
        if key in ENTER and self.typed:
            return self._target()
        if key in ERASE:
            self.typed = self.typed[:-1]
        elif key in b"0123456789.-":
            self.typed += key.decode("ascii")
        return None

    def _target(self) -> Command | None:
        text, self.typed = self.typed, ""
        try:
            value = float(text)
        except ValueError:
            self.shown = f"{text} is no number"
            return None
        return self._given("position", value, f"to {value:g} m")

    def _given(self, command: str, value: float, words: str) -> Command:
        if command != "velocity":
            self._tenths = 0
        self.typed, self.shown = "", words
        return Command(time=0.0, command=command, value=value)


def _in_foreground(terminal: int) -> bool:
    """Tell whether keys can be read, as nobody in the background can."""
    if sys.platform == "win32":
        return False
    return os.isatty(terminal) and os.tcgetpgrp(terminal) == os.getpgrp()


def _length(left: bytes) -> int:
    """Count the bytes of the first key: an escape sequence is three of them."""
    if left[:1] != b"\x1b" or left[1:2] not in (b"", b"[", b"O"):
        return 1
    return 3


class Keyboard:
    """A terminal's keys as an `Operator` of a planner.

    Parameters
    ----------
    terminal : int
        Its file descriptor.
    greatest : float
        m/s, of the stick.
    cycle : float
        The block's, in s.

    Raises
    ------
    SpecError
        It is no terminal in the foreground.
    """

    def __init__(self, terminal: int, greatest: float, cycle: float) -> None:
        if not _in_foreground(terminal):
            raise SpecError(
                "The keyboard: standard input is no terminal in the foreground (of Linux or macOS); give a "
                "file of commands."
            )
        self._terminal, self._keys = terminal, Keys(greatest)
        self._pause, self._reported, self._told = round(PAUSE / cycle), 0, ""

    @property
    def over(self) -> bool:
        """Whether the end was asked for, or the terminal is gone."""
        return self._keys.over

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

    def words(self, cycle: int, issued: Mapping[str, float]) -> str:
        """Say now and then where the axis is, and what was commanded."""
        if cycle < self._reported + self._pause:
            return ""
        self._reported = cycle
        state = PROMISES[int(issued["nPromise"])]
        if issued["nErrorId"]:
            state = f"error {issued['nErrorId']:.0f}"
        said = f"{issued['fPosition']:.3f} m, {issued['fVelocity']:+.3f} m/s, {state}; {self._keys.shown}"
        if self._keys.typed:
            said += f"; to {self._keys.typed}_ m"
        before, self._told = self._told, said
        return "" if said == before else said
