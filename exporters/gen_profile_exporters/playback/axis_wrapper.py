"""Function blocks around the playback block, for axes of a vendor's motion library or frequency converters.

The vendor's block first takes the axes where they stand, so that no setpoint is a step; then the motion
begins, under watch: an axis in error, without power or no longer this block's is let go at once, the others
stop on the path, and nothing goes on before another rising edge and the check of the start.
The calls follow the vendors' public manuals; they were not tried on a controller.
"""

from gen_profile.support.errors import ExportError
from gen_profile_exporters.block_source import BlockSource, parse_function_block
from gen_profile_exporters.motion_libraries import OF_MODULO_AXES, VELOCITY
from gen_profile_exporters.playback.buffers import REPLY, REQUEST, STATE
from gen_profile_exporters.templates import filled

TRIGGERS = ("bExecute", "bContinue")  # inputs whose rising edge starts
ACTUAL = "fActPosition"  # the only input of the playback block that comes from the axes
SETPOINTS = {"fPosition", "fVelocity", "fAcceleration", "nPosition"}  # what goes to them
MAILBOX = {REQUEST, REPLY, STATE}  # reached from outside in the playback block itself


def axis_wrappers(block: BlockSource, axes: int, library: str) -> tuple[BlockSource, ...]:
    """Write the wrapper of a playback block; others have none."""
    plays = any(v.section == "VAR_INPUT" and v.name == "bAbort" for v in block.variables)
    return (axis_wrapper(block, axes, library),) if plays else ()


def axis_wrapper(block: BlockSource, axes: int, library: str) -> BlockSource:
    """Write the block around a playback block, with the same inputs and outputs but the axes' own.

    Raises
    ------
    ExportError
        An axis is a modulo axis, and what the library's axes expect at the end of a turn is not known.
    """
    several, turns = axes > 1, turns_of(block, axes)
    if turns and library not in OF_MODULO_AXES:
        raise ExportError(
            f"{block.name} has a modulo axis, whose end of a turn no block of this vendor's axes is known to "
            "take; write the block by plc or plcopen-xml, and join it to the axis by hand."
        )
    inputs = [v for v in block.variables if v.section == "VAR_INPUT" and v.name not in {ACTUAL, *MAILBOX}]
    outputs = [v for v in block.variables if v.section == "VAR_OUTPUT" and v.name not in SETPOINTS | MAILBOX]
    text = filled(
        "playback/text/axis_wrapper.st",
        library=library,
        block=block,
        name=f"{block.name}_{'Velocity' if library == VELOCITY else 'Axis'}",
        axes=[(f"{n}" * several, f"[{n}]" * several) for n in range(1, axes + 1)],
        turns=turns,
        inputs=inputs,
        outputs=outputs,
        triggers=[key for key in TRIGGERS if key in {v.name for v in inputs}],
    )
    return parse_function_block(text)


def turns_of(block: BlockSource, axes: int) -> dict[str, str]:
    """Tell after how much each modulo axis wraps, by its number, as the text of a playback block has it."""
    values = next((v.values for v in block.variables if v.name == "cModulo"), [])
    numbers = [f"{n}" * (axes > 1) for n in range(1, axes + 1)]
    return {n: value for n, value in zip(numbers, values, strict=False) if float(value) > 0.0}
