"""Function blocks around the planner block that power real axes, take them over and guide them.

One for the axes of a vendor's motion library, and one whose output is a velocity, for frequency converters.
An axis that fails is let go at once, the others brake, and nothing is guided again before a reset and another
rising edge: the block then takes the axes over where they stand.
"""

from collections import Counter
from collections.abc import Mapping

import attrs

from gen_profile.support.errors import ExportError
from gen_profile_exporters.block_source import BlockSource, parse_function_block
from gen_profile_exporters.motion_libraries import CODESYS, SIEMENS, TWINCAT, VELOCITY
from gen_profile_exporters.playback.structured_text import literal
from gen_profile_exporters.templates import filled, macros

INTERFACE = ("VAR_INPUT", "VAR_OUTPUT")
COMMENTS = {
    "bEnable": "rising edge: take the axes over; low: stop without sway, then let them go",
    "bReset": "acknowledge errors, of the axes, too",
    "bEnabled": "the axes are guided",
}
SETPOINTS = ("fPosition", "fVelocity", "fAcceleration")  # outputs of the block that go to the axes
MEASURED = ("fActPosition", "fActVelocity")  # inputs that come from them
POWER_TIMEOUT = 10.0  # s, for power, and for the vendor's block
LIBRARIES = {"twincat": TWINCAT, "codesys": CODESYS, "siemens-scl": SIEMENS}


def planner_wrappers(block: BlockSource, units: Mapping[str, float], format_: str) -> dict[str, BlockSource]:
    """Write the wrappers of a planner block that a format carries, by what their files' names end with.

    Parameters
    ----------
    block : BlockSource
    units : mapping of str to float
        By the end of the names of each axis's variables: the axis's own units in one of the block's.
    format_ : str
    """
    converters = dict.fromkeys(units, 1.0)
    wrappers = {"_velocity": planner_wrapper(block, converters, VELOCITY)}
    if format_ in LIBRARIES:
        wrappers["_axis"] = planner_wrapper(block, units, LIBRARIES[format_])
    return wrappers


def planner_wrapper(block: BlockSource, units: Mapping[str, float], library: str) -> BlockSource:
    """Write the block around a planner block, with the same inputs and outputs but the axes' own.

    Raises
    ------
    ExportError
        A live parameter's input has the name of a variable of the wrapper.
    """
    moves_axis = library != VELOCITY
    name = f"{block.name}_{'Axis' if moves_axis else 'Velocity'}"
    inputs, outputs = (
        [attrs.evolve(v, comment=COMMENTS.get(v.name, v.comment)) for v in block.variables if v.section == of]
        for of in INTERFACE
    )
    setpoints = {f"{key}{n}" for n in units for key in SETPOINTS}
    measured = {f"{key}{n}" for n in units for key in MEASURED}
    (cycle,) = (float(v.initial) for v in inputs if v.name == "fCycleTime")
    speed = macros(library).speed
    given = {
        "bEnable": "bGuided AND (nStage >= cGuiding)",
        "bStop": "bStop OR (nStage = cStopping)",
        "bQuickStop": "bQuickStop OR (nFault <> 0)",
        **{f"fActPosition{n}": f"fPlace{n}" for n in units},
        # until it is enabled, the block follows the axis, which goes on as fast as it does
        **{f"fActVelocity{n}": f"{speed(n)} / cUnits{n}" for n in units},
    }
    text = filled(
        "planner/axis_wrapper.st",
        library=library,
        block=block,
        name=name,
        inputs=inputs,
        outputs=outputs,
        hidden=setpoints | (measured if moves_axis else set()),
        given=given,
        copied=[v for v in outputs if v.name not in setpoints],
        has_lists=any(v.array for v in (*inputs, *outputs)),
        units={n: literal(factor) for n, factor in units.items()},
        patience=f"{POWER_TIMEOUT:g}",
        patience_cycles=round(POWER_TIMEOUT / cycle),
    )
    wrapper = parse_function_block(text)
    counted = Counter(v.name.lower() for v in wrapper.variables)  # the language has one case only
    if twice := [v.name for v in wrapper.variables if counted[v.name.lower()] > 1]:
        raise ExportError(f"{name} has a variable {twice[0]} of its own; name the live parameter otherwise.")
    return wrapper
