"""Function blocks around the playback block, for axes of a vendor's motion library or frequency converters.

The vendor's block first takes the axes where they stand, so that no setpoint is a step; then the motion
begins, under watch: an axis in error, without power or no longer this block's is let go at once, the others
stop on the path, and nothing goes on before another rising edge and the check of the start.
The calls follow the vendors' public manuals; they were not tried on a controller.
"""

from gen_profile_exporters.block_source import BlockSource, parse_function_block
from gen_profile_exporters.motion_libraries import VELOCITY
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
    """Write the block around a playback block, with the same inputs and outputs but the axes' own."""
    several = axes > 1
    inputs = [v for v in block.variables if v.section == "VAR_INPUT" and v.name not in {ACTUAL, *MAILBOX}]
    outputs = [v for v in block.variables if v.section == "VAR_OUTPUT" and v.name not in SETPOINTS | MAILBOX]
    text = filled(
        "playback/text/axis_wrapper.st",
        library=library,
        block=block,
        name=f"{block.name}_{'Velocity' if library == VELOCITY else 'Axis'}",
        axes=[(f"{n}" * several, f"[{n}]" * several) for n in range(1, axes + 1)],
        inputs=inputs,
        outputs=outputs,
        triggers=[key for key in TRIGGERS if key in {v.name for v in inputs}],
    )
    return parse_function_block(text)
