"""A planner block with a program and a task, as OpenPLC Runtime and others that use matiec run it."""

from collections.abc import Iterable, Iterator

from gen_profile_exporters.block_source import BlockVariable, parse_function_block
from gen_profile_exporters.exporter import File
from gen_profile_exporters.playback.structured_text import plain
from gen_profile_exporters.templates import filled

OPENPLC = "_openplc.st"
CYCLE = "fCycleTime"  # is the task's
STEP = 64  # the first address of the outputs, or a multiple of it behind many inputs
AREAS = {"BOOL": "QX", "DINT": "MD", "LREAL": "ML", "LINT": "ML"}  # coils, memory of 32 and of 64 bits
NUMBER = BlockVariable("VAR_OUTPUT", "nCycle", "LINT", comment="so many")


def openplc_files(text: str, file: str) -> tuple[File]:
    """Write a planner block with a program whose variables have addresses, and a task.

    Parameters
    ----------
    text : str
        The block.
    file : str
        With which the file's name begins.

    Raises
    ------
    ExportError
        The text is no function block.
    """
    source = parse_function_block(text)
    (cycle,) = (float(v.initial) for v in source.variables if v.name == CYCLE)
    inputs, outputs = (
        [v for v in source.variables if v.section == section and not v.array and v.name != CYCLE]
        for section in ("VAR_INPUT", "VAR_OUTPUT")
    )
    project = filled(
        "planner/openplc.st",
        file=plain(file),
        source=source,
        milliseconds=f"{1e3 * cycle:g}",
        block=text,
        located=[*_located(inputs, 0), *_located([NUMBER, *outputs], STEP * -(-len(inputs) // STEP))],
        inputs=inputs,
        outputs=outputs,
    )
    return (File(f"{file}{OPENPLC}", project.encode("ascii")),)


def _located(variables: Iterable[BlockVariable], first: int) -> Iterator[tuple[str, BlockVariable]]:
    """Give variables the next addresses of their areas, from the first one on."""
    numbers: dict[str, int] = {}
    for v in variables:
        area = AREAS[v.type]
        number = numbers.setdefault(area, first)
        numbers[area] += 1
        yield f"{area}{number // 8}.{number % 8}" if v.type == "BOOL" else f"{area}{number}", v
