"""A planner block with a program and a task, as OpenPLC Runtime and others that use matiec run it."""

from collections.abc import Iterable, Iterator

from gen_profile_exporters.block_source import BlockVariable, parse_function_block
from gen_profile_exporters.exporter import File
from gen_profile_exporters.playback.structured_text import plain
from gen_profile_exporters.templates import text_parts

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
    project = text_parts("planner/openplc.st")["project"].format(
        file=plain(file),
        name=source.name,
        milliseconds=f"{1e3 * cycle:g}",
        block=text,
        located="\n".join(
            [*_located(inputs, 0), *_located([NUMBER, *outputs], STEP * -(-len(inputs) // STEP))]
        ),
        arguments=",\n    ".join(f"{v.name} := {v.name}" for v in inputs),
        results="\n".join(f"{v.name} := fbPlanner.{v.name};" for v in outputs),
    )
    return (File(f"{file}{OPENPLC}", f"{project}\n".encode("ascii")),)


def _located(variables: Iterable[BlockVariable], first: int) -> Iterator[str]:
    """Declare variables at the next addresses of their areas, from the first one on."""
    numbers: dict[str, int] = {}
    for v in variables:
        area = AREAS[v.type]
        number = numbers.setdefault(area, first)
        numbers[area] += 1
        place = f"{number // 8}.{number % 8}" if v.type == "BOOL" else str(number)
        initial = f" := {v.initial}" if v.initial else ""
        comment = f" (* {v.comment} *)" if v.comment else ""
        yield f"    {v.name} AT %{area}{place} : {v.type}{initial};{comment}"
