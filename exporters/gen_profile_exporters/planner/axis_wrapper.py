"""Function blocks around the planner block that power real axes, take them over and guide them.

One for the axes of a vendor's motion library, and one whose output is a velocity, for frequency converters.
An axis that fails is let go at once, the others brake, and nothing is guided again before a reset and another
rising edge: the block then takes the axes over where they stand.
"""

from collections import Counter
from collections.abc import Mapping

import attrs

from gen_profile.support.errors import ExportError
from gen_profile_exporters.block_source import BlockSource, BlockVariable
from gen_profile_exporters.motion_libraries import (
    CODESYS,
    SIEMENS,
    TWINCAT,
    VELOCITY,
    MotionLibrary,
    around,
    each,
)
from gen_profile_exporters.playback.structured_text import literal
from gen_profile_exporters.templates import names_by_type, text_parts

TEXTS = text_parts("planner/axis_wrapper.st")
INTERFACE = ("VAR_INPUT", "VAR_OUTPUT")
STAGES = ("cOff", "cPowering", "cTaking", "cGuiding", "cStopping")
STAGE = BlockVariable(
    "VAR_OUTPUT", "nStage", "DINT", comment="0 off, 1 waits for power, 2 takes over, 3 guides, 4 stops"
)
POWER = BlockVariable("VAR_INPUT", "bPower", "BOOL", comment="power the axes")
COMMENTS = {
    "bEnable": "rising edge: take the axes over; low: stop without sway, then let them go",
    "bReset": "acknowledge errors, of the axes, too",
    "bEnabled": "the axes are guided",
}
OWN = names_by_type(TEXTS["variables"])
SETPOINTS = OWN["LREAL"]  # outputs of the block that go to the axes
PLACES = {"fActPosition": "fPlace{n}", "fActVelocity": "{speed} / cUnits{n}"}  # inputs that come from them
PATIENCE = 10.0  # s, for power, and for the vendor's block
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


def planner_wrapper(block: BlockSource, units: Mapping[str, float], library: MotionLibrary) -> BlockSource:
    """Write the block around a planner block, with the same inputs and outputs but the axes' own.

    Raises
    ------
    ExportError
        A live parameter's input has the name of a variable of the wrapper.
    """
    name = f"{block.name}_{'Axis' if library.axis_type else 'Velocity'}"
    outer = [v for v in block.variables if v.section in INTERFACE]
    hidden = {f"{key}{n}" for n in units for key in (*SETPOINTS, *(PLACES if library.axis_type else ()))}
    declared = [
        attrs.evolve(v, comment=COMMENTS.get(v.name, v.comment)) for v in outer if v.name not in hidden
    ]
    variables = (
        *(BlockVariable("VAR_IN_OUT", f"Axis{n}", library.axis_type) for n in units if library.axis_type),
        POWER,
        *declared,
        *(attrs.evolve(v, name=v.name.format(n=n)) for n in units for v in library.variables),
        STAGE,
        *_own(block, units, library),
    )
    counted = Counter(v.name.lower() for v in variables)  # the language has one case only
    if twice := [v.name for v in variables if counted[v.name.lower()] > 1]:
        raise ExportError(f"{name} has a variable {twice[0]} of its own; name the live parameter otherwise.")
    return BlockSource(
        header=TEXTS["header"].format(
            name=name,
            block=block.name,
            axes="axes of the motion library" if library.axis_type else "frequency converters",
            guide=library.guide,
            patience=PATIENCE,
        )
        + "\n",
        name=name,
        variables=variables,
        body=_body(block, units, library),
    )


def _own(block: BlockSource, units: Mapping[str, float], library: MotionLibrary) -> list[BlockVariable]:
    """Declare what is the wrapper's own."""
    own = {"fbPlanner": block.name} | {name: type_ for type_, names in OWN.items() for name in names}
    if any(v.array for v in block.variables if v.section in INTERFACE):
        own["nIndex"] = "DINT"
    instances = library.power_instances | library.instances
    for n in units:
        own |= {f"bTaken{n}": "BOOL", f"fPlace{n}": "LREAL"}
        own |= {f"{key}{n}": type_ for key, type_ in instances.items()}
    (cycle,) = (float(v.initial) for v in block.variables if v.name == "fCycleTime")
    whole = {stage: number for number, stage in enumerate(STAGES)} | {"cPatience": round(PATIENCE / cycle)}
    constants = {name: ("DINT", str(number)) for name, number in whole.items()}
    constants |= {f"cUnits{n}": ("LREAL", literal(factor)) for n, factor in units.items()}
    return [
        *(BlockVariable("VAR", name, type_) for name, type_ in own.items()),
        *(
            BlockVariable("VAR CONSTANT", name, type_, initial=initial)
            for name, (type_, initial) in constants.items()
        ),
    ]


def _body(block: BlockSource, units: Mapping[str, float], library: MotionLibrary) -> str:
    places = [{"n": n} for n in units]
    # until it is enabled, the block follows the axis, which goes on as fast as it does
    prepare, feed = (each(around(TEXTS, part, library), places) for part in ("prepare", "feed"))
    inputs, outputs = ([v for v in block.variables if v.section == section] for section in INTERFACE)
    given = {v.name: v.name for v in inputs if not v.array} | {
        "bEnable": "bGuided AND (nStage >= cGuiding)",
        "bStop": "bStop OR (nStage = cStopping)",
        "bQuickStop": "bQuickStop OR (nFault <> 0)",
    }
    for n in units:
        for key, place in PLACES.items():
            given[f"{key}{n}"] = place.format(n=n, speed=library.speed.format(n=n))
    setpoints = {f"{key}{n}" for n in units for key in SETPOINTS}
    copied = [v for v in outputs if v.name not in setpoints]
    text = TEXTS["body"].format(
        prepare=prepare,
        take=each("    bTaken{n} := TRUE;", places),
        lists="".join(_list(v, f"fbPlanner.{v.name}", v.name) for v in inputs if v.array),
        arguments=",\n    ".join(f"{name} := {value}" for name, value in given.items()),
        feed=feed,
        results="".join(
            _list(v, v.name, f"fbPlanner.{v.name}") if v.array else f"{v.name} := fbPlanner.{v.name};\n"
            for v in copied
        ),
    )
    return f"{text}\n"


def _list(variable: BlockVariable, to: str, of: str) -> str:
    """Hand an array over, element by element: matiec takes no whole array for a parameter."""
    assert variable.array is not None
    first, last, _ = variable.array
    text = TEXTS["list"].format(first=first, last=last, to=to, of=of)
    return f"{text}\n"
