"""Template of the playback function block in Structured Text, filled in for writing and matched for reading.

Lines with ``~`` are repeated for every axis, with the axis's suffix in its place. ``@name`` is a hole: the
exporter puts a value there, the reader finds it there; nothing else may differ. Comments are free.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import attrs

from gen_profile.errors import ExportError

HEADER = """\
(*
    @name: motion table and playback block, IEC 61131-3 Structured Text, from gen-profile.

    @samples samples, one per cycle of @cycle s, @kilobytes kB.
    Axis @axis~, @unit~: @first~ to @final~, peaks @peak_velocity~ @unit~/s and @peak_acceleration~ @unit~/s2.
    SHA-256 of cycle time and positions: @sha256

    Call the block once in every cycle of its task. Give its outputs to the drive while bBusy, bDone or
    bAborted; before, and after an error, they mean nothing. A rising edge of bExecute starts. Dropping
    bExecute does not stop the motion, it ends the hold at the target. bAbort brakes every axis with its
    fStopDeceleration; the load sways after that, as it does after any stop that was not planned.

    nErrorId: 0 none
              1 fCycleTime is not the cycle time of the table
              2 fActPosition is farther than fStartTolerance from the start of the table
              3 fStopDeceleration is not greater than zero
              4 bAbort was set at the start
*)
"""

BLOCK = """\
FUNCTION_BLOCK @block
VAR_INPUT
    bExecute : BOOL; (* rising edge: start *)
    bAbort : BOOL; (* brake to standstill *)
    fCycleTime : LREAL; (* s, of the task that calls this block *)
    fActPosition~ : LREAL; (* @unit~, where the axis stands *)
    fStartTolerance~ : LREAL := @start_tolerance~; (* @unit~ *)
    fStopDeceleration~ : LREAL := @stop_deceleration~; (* @unit~/s2, taken over at the start *)
END_VAR
VAR_OUTPUT
    fPosition~ : LREAL := @start~; (* @unit~ *)
    fVelocity~ : LREAL; (* @unit~/s *)
    fAcceleration~ : LREAL; (* @unit~/s2 *)
    bBusy : BOOL; (* plays or brakes *)
    bDone : BOOL; (* holds the target *)
    bAborted : BOOL; (* holds where it braked to *)
    bError : BOOL; (* did not start, see nErrorId *)
    nErrorId : INT;
END_VAR
VAR
    nState : INT;
    nIndex : DINT; (* of the sample issued last *)
    bExecuteBefore : BOOL;
    fDeceleration~ : LREAL;
    fVelocityStep~ : LREAL;
END_VAR
VAR CONSTANT
    cIdle : INT := 0;
    cPlaying : INT := 1;
    cBraking : INT := 2;
    cDone : INT := 3;
    cAborted : INT := 4;
    cFailed : INT := 5;
    cLast : DINT := @last;
    cCycleTime : LREAL := @cycle_time; (* s *)
    aPosition~ : ARRAY @range OF LREAL := @position~;
    aVelocity~ : ARRAY @range OF LREAL := @velocity~;
    aAcceleration~ : ARRAY @range OF LREAL := @acceleration~;
END_VAR

IF bExecute AND NOT bExecuteBefore AND (nState <> cPlaying) AND (nState <> cBraking) THEN
    nState := cPlaying;
    nIndex := -1;
    nErrorId := 0;
    IF bAbort THEN nErrorId := 4; END_IF;
    (* Not-a-number fails every comparison, so the checks ask for what must hold. *)
    IF NOT (fStopDeceleration~ > 0.0) THEN nErrorId := 3; END_IF;
    IF NOT (ABS(fActPosition~ - aPosition~[0]) <= fStartTolerance~) THEN nErrorId := 2; END_IF;
    IF NOT (ABS(fCycleTime - cCycleTime) <= 1.0E-6 * cCycleTime) THEN nErrorId := 1; END_IF;
    IF nErrorId <> 0 THEN nState := cFailed; END_IF;
    fDeceleration~ := fStopDeceleration~;
ELSIF NOT bExecute AND (nState <> cPlaying) AND (nState <> cBraking) THEN
    nState := cIdle;
    nErrorId := 0;
END_IF;
bExecuteBefore := bExecute;

IF bAbort AND (nState = cPlaying) THEN nState := cBraking; END_IF;

IF nState = cPlaying THEN
    nIndex := nIndex + 1;
    fPosition~ := aPosition~[nIndex];
    fVelocity~ := aVelocity~[nIndex];
    fAcceleration~ := aAcceleration~[nIndex];
    IF nIndex >= cLast THEN nState := cDone; END_IF;
ELSIF nState = cBraking THEN
    nState := cAborted;
    fVelocityStep~ := LIMIT(-fDeceleration~ * cCycleTime, fVelocity~, fDeceleration~ * cCycleTime);
    fPosition~ := fPosition~ + (fVelocity~ - 0.5 * fVelocityStep~) * cCycleTime;
    fVelocity~ := fVelocity~ - fVelocityStep~;
    fAcceleration~ := -fVelocityStep~ / cCycleTime;
    IF fVelocity~ <> 0.0 THEN nState := cBraking; END_IF;
ELSE
    fVelocity~ := 0.0;
    fAcceleration~ := 0.0;
END_IF;

bBusy := (nState = cPlaying) OR (nState = cBraking);
bDone := nState = cDone;
bAborted := nState = cAborted;
bError := nState = cFailed;
END_FUNCTION_BLOCK
"""

_COMMENT = re.compile(r"\(\*.*?\*\)", re.DOTALL)
_HOLE = re.compile(r"@(\w+)")
# An array's initialiser, a name or hole, a number with its sign, an operator.
_TOKEN = re.compile(
    r"\[[^\[\]]*\]|@?[A-Za-z_]\w*|[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?|:=|<=|>=|<>|\S", re.ASCII
)


@attrs.frozen
class Token:
    """A piece of program text and the line it begins on."""

    text: str
    line: int


def fill(values: Mapping[str, str], suffixes: Sequence[str]) -> str:
    """Write a block: a value for every hole, by the hole's name with the axis's suffix."""
    return _HOLE.sub(lambda hole: values[hole[1]], _expand(HEADER + BLOCK, suffixes))


def match(text: str, suffixes: Sequence[str]) -> dict[str, Token]:
    """Read a block: what stands in every hole, by the hole's name with the axis's suffix.

    Raises
    ------
    ExportError
        The text differs from the template elsewhere, or one value from place to place.
    """
    found, due = _tokens(text), _tokens(_expand(BLOCK, suffixes))
    values: dict[str, Token] = {}
    for token, expected in zip(found, due, strict=False):
        hole = _HOLE.fullmatch(expected.text)
        known = values.setdefault(hole[1], token).text if hole else expected.text
        if token.text.lower() != known.lower():
            raise ExportError(
                f"line {token.line}: {token.text[:40]!r} stands where the exported block has {known[:40]!r}; "
                "only numbers and comments may be edited in it, export it again."
            )
    if len(found) != len(due):
        line = found[len(due)].line if len(found) > len(due) else len(text.splitlines())
        raise ExportError(f"line {line}: the block breaks off or goes on after its end; export it again.")
    return values


def _expand(template: str, suffixes: Sequence[str]) -> str:
    """Repeat every line with ``~`` for every axis."""
    lines = []
    for line in template.splitlines(keepends=True):
        lines += [line.replace("~", suffix) for suffix in suffixes] if "~" in line else [line]
    return "".join(lines)


def _tokens(text: str) -> list[Token]:
    """Split program text; comments are left out, but their line ends counted."""
    program = _COMMENT.sub(lambda comment: "\n" * comment[0].count("\n") or " ", text)
    tokens = []
    line, counted = 1, 0
    for piece in _TOKEN.finditer(program):
        line += program.count("\n", counted, piece.start())
        counted = piece.start()
        tokens.append(Token(text=piece[0], line=line))
    return tokens
