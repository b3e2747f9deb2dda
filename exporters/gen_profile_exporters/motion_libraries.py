"""How vendors' axes are powered, taken and guided: their libraries' calls, for wrappers around our blocks.

The calls follow the vendors' public manuals; they were not tried on a controller.
"""

import re
from collections.abc import Mapping, Sequence

import attrs

from gen_profile_exporters.block_source import BlockVariable
from gen_profile_exporters.templates import text_parts

_INSTANCE = re.compile(r"(\w+) : (\w+);")
_VARIABLE = re.compile(r"(\w+) (\S+) : (\w+);() \(\* (.*) \*\)")
# What follows a vendor's statements: an axis that failed is commanded no more.
LET_GO = """\
IF bTaken{n} AND (nCause <> 0) THEN
    bTaken{n} := FALSE;
    IF nFault = 0 THEN nFault := nCause; END_IF;
END_IF;"""


@attrs.frozen(kw_only=True)
class MotionLibrary:
    """How a vendor's axis takes setpoints.

    In names and statements, ``{n}`` ends what is an axis's, and ``{i}`` is its index in the playback block's
    arrays; both are empty where there is one axis.

    Attributes
    ----------
    axis_type : str
        Empty where the axis is inputs and outputs.
    guide : str
        Name of the block that guides the axis.
    instances : dict of str to str
        Library blocks, and other variables of each axis, by the beginning of their names.
    power_instances : dict of str to str
        Likewise, of what powers it.
    setpoint, speed, actual : str
        Where the axis is commanded to be, at which velocity, and where it is.
    power : str
        Powers the axis while ``bOn`` is set and resets it with ``bAcknowledge``; sets ``bResets`` as long as
        that takes.
    homed : str
        Whether its position is known.
    prepare : str
        Before the block is called: tells by ``nCause`` what is wrong with the axis, and clears ``bReady`` as
        long as it is not guided.
    feed : str
        After it was called: gives ``fPosition``, ``fVelocity`` and ``fAcceleration`` to the axis if
        ``bFeed``, and tells by ``nCause`` what went wrong.
    variables : tuple of BlockVariable
        Inputs and outputs of the wrapper for each axis, beside those of the block.
    """

    axis_type: str
    guide: str
    instances: dict[str, str]
    power_instances: dict[str, str]
    setpoint: str
    speed: str
    actual: str
    power: str
    homed: str
    prepare: str
    feed: str
    variables: tuple[BlockVariable, ...] = ()


def each(template: str, places: Sequence[Mapping[str, str]]) -> str:
    """Repeat statements for every axis, with its places put in."""
    return "\n".join(template.format(**place) for place in places)


def around(texts: Mapping[str, str], part: str, library: MotionLibrary) -> str:
    """Put a library's statements into a wrapper's, where ``{vendor}`` is; the axis's places stay open."""
    values = attrs.asdict(library, recurse=False)
    return texts[part].format(n="{n}", i="{i}", vendor=values[part], let_go=LET_GO, **values)


def _library(name: str) -> MotionLibrary:
    """Read a library's texts; what is declared there stands as in a controller's program."""
    parts = text_parts(f"libraries/{name}.st")
    instances = {
        kind: dict(_INSTANCE.findall(parts.get(kind, ""))) for kind in ("instances", "power_instances")
    }
    variables = tuple(BlockVariable(*found) for found in _VARIABLE.findall(parts.get("variables", "")))
    return MotionLibrary(**{"axis_type": "", **parts, **instances, "variables": variables})


# The last one has velocity setpoints with a position control of our own; its converter is inputs and outputs.
TWINCAT, CODESYS, SIEMENS, VELOCITY = map(_library, ("twincat", "codesys", "siemens", "velocity"))
