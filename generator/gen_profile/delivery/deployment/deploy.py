"""Putting a proved table into a controller: written to the idle buffer, read back, checked, switched to."""

from contextlib import suppress
from typing import Any, Literal

import attrs

from gen_profile.assurance.proof.check import BlockJudgement
from gen_profile.assurance.verification.check import Judgement
from gen_profile.delivery.deployment import mailbox
from gen_profile.delivery.deployment.mailbox import BlockRefusedError, BlockStatus, LinkLostError, Mailbox
from gen_profile.delivery.deployment.table import BlockTable, table_hash
from gen_profile.motion.profile import Array
from gen_profile.support.errors import CheckFailed, DeploymentError, ExportError
from gen_profile.support.progress import Progress, no_progress
from gen_profile_exporters.exporter import target_of
from gen_profile_exporters.playback.buffers import INTERFACE, LAYOUT_NAMES, PLANNER, is_library, kind_of

CURE = "export the block with these settings and load it into the controller, or export the artefact for it"

FORMER = "The controller uses the table that it had."
EITHER = "The switch was asked for already; verify which of the two tables is used, whole."


@attrs.frozen(kw_only=True, eq=False)
class DeployedTable:
    """What was done.

    Attributes
    ----------
    action : str
        Whether the table was ``"deployed"``, ``"rolled back"`` to, or ``"in use already"``.
    table : BlockTable
    before, after : BlockStatus
    held_sha256 : str
        Of the values that were read from the buffer in use at the end.
    judgement : Judgement
        Of the values that were read back.
    """

    action: Literal["deployed", "rolled back", "in use already"]
    table: BlockTable
    before: BlockStatus
    after: BlockStatus
    held_sha256: str
    judgement: Judgement | BlockJudgement

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON."""
        return {
            "action": self.action,
            "artefact": self.table.path.name,
            **self.table.hashes,
            "held_sha256": self.held_sha256,
            "checksum": int(self.after.checksum),
            "checksum_before": int(self.before.checksum),
            "values": len(self.table.values),
            "motions": len(self.table.specs),
            "check": self.judgement.check.to_dict(),
        }


def deploy(
    table: BlockTable,
    box: Mailbox,
    *,
    rollback: bool = False,
    trial: bool = False,
    progress: Progress = no_progress,
) -> DeployedTable:
    """Have a controller use a table, once it is proved to hold it.

    Parameters
    ----------
    table : BlockTable
    box : Mailbox
    rollback : bool
        Whether to write nothing, since the idle buffer holds the table.
    trial : bool
        Whether to take a planner that was judged on fewer histories than make a proof.
    progress : callable

    Raises
    ------
    ExportError
        The controller's block cannot take it.
    CheckFailed
        What was read back leaves too much sway, or is a trial; nothing was switched.
    DeploymentError
    CosimulationError
    """
    in_force = FORMER
    if not trial:
        table.require_proved()
    try:
        before = box.status()
        require_fit(table, before)
        same = before.checksum == table.checksum and before.checked != mailbox.WRONG
        in_use = same and not _differs(table, box, mailbox.IN_USE)
        judgement = _proved(
            table, box, mailbox.IN_USE if in_use else mailbox.IDLE, rollback or in_use, progress
        )
        if not in_use:
            progress("switching")
            in_force = EITHER
            box.switch(table.checksum)
        held, after = _confirmed(table, box, before, in_use=in_use)
        _release(box)
    except LinkLostError as error:
        words = f"The connection broke ({error}), and could not be taken up again."
        raise DeploymentError(words, in_force) from error
    except KeyboardInterrupt:
        _release(box)
        progress(in_force.removesuffix("."))
        raise
    except (DeploymentError, CheckFailed) as error:
        _release(box)
        kind = CheckFailed if isinstance(error, CheckFailed) else DeploymentError
        raise kind(*error.sentences, FORMER if isinstance(error, BlockRefusedError) else in_force) from error
    action: Literal["deployed", "rolled back"] = "rolled back" if rollback else "deployed"
    return DeployedTable(
        action="in use already" if in_use else action,
        table=table,
        before=before,
        after=after,
        held_sha256=table_hash(held),
        judgement=judgement,
    )


def _proved(
    table: BlockTable, box: Mailbox, buffer: int, held: bool, progress: Progress
) -> Judgement | BlockJudgement:
    """Write a table to a buffer if it is not held there, read it back twice, and check it in between."""
    if not held:
        progress("writing the table")
        box.write(table.values)
    elif _differs(table, box, buffer):
        raise DeploymentError(
            f"The idle buffer does not hold {table.path}, so there is nothing to go back to; name the file "
            "that was in use before, as deployments.json tells, or deploy it without rollback."
        )
    progress("reading the table back")
    values = box.read(buffer, len(table.values))
    mailbox.require_same(values, table.values, cure=mailbox.KEPT)
    judgement = table.check(values, progress)
    if not judgement.check.passed:
        raise CheckFailed(*judgement.check.reasons())
    mailbox.require_same(box.read(buffer, len(table.values)), table.values, cure=mailbox.KEPT)
    return judgement


def _confirmed(
    table: BlockTable, box: Mailbox, before: BlockStatus, *, in_use: bool
) -> tuple[Array, BlockStatus]:
    """Read what is used now; go back to the former table where that is not what was proved."""
    held, after = box.read(mailbox.IN_USE, len(table.values)), box.settled()
    try:
        _require_held(held, table, after)
    except CheckFailed as error:
        if in_use:
            raise
        box.switch(before.checksum)
        raise BlockRefusedError(*error.sentences) from error
    return held, after


def _release(box: Mailbox) -> None:
    with suppress(LinkLostError, DeploymentError):  # others may write in half a minute anyway
        box.release()


def verify(table: BlockTable, box: Mailbox) -> BlockStatus:
    """Tell whether a controller uses a table, bit for bit, and finds its checksum right.

    Raises
    ------
    CheckFailed
        It does not.
    ExportError
        Its block cannot even take it.
    DeploymentError
    """
    try:
        status = box.settled()
        require_fit(table, status)
        held = box.read(mailbox.IN_USE, len(table.values))
    except LinkLostError as error:
        raise DeploymentError(f"The connection broke ({error}); run this again.") from error
    _require_held(held, table, status)
    return status


def require_fit(table: BlockTable, status: BlockStatus) -> None:
    """Refuse a block that is not of the table's kind.

    Raises
    ------
    ExportError
        With what is different.
    """
    layout = LAYOUT_NAMES[table.constant("cLayout")]
    cycle = table.spec.export.cycle_time
    shown = LAYOUT_NAMES[status.layout] if 0 <= status.layout < len(LAYOUT_NAMES) else "unknown"
    due = {
        "version": (status.interface, INTERFACE),
        "table's layout": (shown, layout),
        "number of axes": (status.axes, table.constant("cAxes")),
        "cycle time in s": (status.cycle_time, cycle),
    }
    for what, (there, here) in due.items():
        if there != here:
            raise ExportError(
                f"The block in the controller has another {what}, {there} and not {here}; {CURE}."
            )
    if status.kind != table.constant("cKind") and layout == PLANNER:
        raise ExportError(
            f"The planner block in the controller is built otherwise than that of {table.path.name} (inputs, "
            f"live parameters, modes or slots), so that its numbers would not make it that one; {CURE}."
        )
    library = is_library(table.source)
    if status.kind == kind_of(target_of(table.spec), layout, library=not library):
        plays = ("library", "single motion") if library else ("single motion", "library")
        raise ExportError(
            f"{table.path.name} is a {plays[0]}, and the block in the controller takes a {plays[1]}; {CURE}."
        )
    if status.kind != table.constant("cKind"):
        raise ExportError(
            f"The block in the controller is for axes of other names, units or signs than {table.path.name}; "
            f"{CURE}."
        )
    if len(table.values) > status.capacity:
        raise ExportError(
            f"The buffers in the controller hold {status.capacity} values, and {table.path.name} has "
            f"{len(table.values)}; load its own block into the controller, whose buffers are larger."
        )


def _differs(table: BlockTable, box: Mailbox, buffer: int) -> bool:
    return bool(mailbox.differing(box.read(buffer, len(table.values)), table.values))


def _require_held(held: Array, table: BlockTable, status: BlockStatus) -> None:
    places = mailbox.differing(held, table.values)
    if places:
        raise CheckFailed(
            f"The controller does not use {table.path}: {len(places)} of {len(held)} values differ, first "
            f"number {places[0]}. Deploy it, or find out what is in use (deployments.json)."
        )
    if status.checked != mailbox.RIGHT:
        raise CheckFailed(
            f"The controller holds {table.path}, but works out another checksum, and so starts nothing: its "
            "memory is at fault, or was a moment ago; restart it."
        )
