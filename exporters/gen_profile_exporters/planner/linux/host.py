"""A host for the C form of a planner block: a real-time loop, and an OPC UA server beside it."""

from gen_profile_exporters.exporter import File
from gen_profile_exporters.planner.c_source import c_files, c_name
from gen_profile_exporters.playback.structured_text import literal
from gen_profile_exporters.st_to_c import translate
from gen_profile_exporters.templates import filled

GIVEN = {"BOOL": "row[{}] > 0.0", "LREAL": "row[{}]"}
ALIVE, PUNCTUAL = "bAlive", ("fCycleLate", "fCycleWork", "nCyclesLeftOut")  # the host's own
CYCLE = "fCycleTime"


def linux_files(text: str, file: str) -> tuple[File, ...]:
    """Write a planner block in C, and the programs by which a Linux machine runs it and serves it.

    Parameters
    ----------
    text : str
        The block.
    file : str
        With which the files' names begin.

    Raises
    ------
    ExportError
        The text is no function block of the subset that is translated.
    """
    block = translate(text)
    (cycle,) = (v.start for v in block.inputs if v.name == CYCLE)
    inputs = [v for v in block.inputs if v.name != CYCLE]
    names = [ALIVE, *(v.name for v in (*inputs, *block.outputs)), *PUNCTUAL]
    values = {
        "file": file,
        "name": c_name(file),
        "cycle": literal(cycle),
        "period": str(round(cycle * 1e9)),
        "inputs": str(1 + len(inputs)),
        "columns": str(len(names)),
        "stop": str(names.index("bStop")),
        "quick_stop": str(names.index("bQuickStop")),
        "names": ",\n".join(f'    "{name}"' for name in names),
        "first": ",\n".join(f"    {literal(value)}" for value in (0.0, *(v.start for v in inputs))),
        "taken": "\n".join(
            f"    in->{v.name} = {GIVEN[v.type].format(k)};" for k, v in enumerate(inputs, start=1)
        ),
        "issued": "\n".join(
            f"    row[{k}] = out->{v.name};" for k, v in enumerate(block.outputs, start=1 + len(inputs))
        ),
    }
    return (
        *c_files(text, file),
        *(
            File(f"{file}_{name}", filled(f"planner/linux/{template}", **values).encode("ascii"))
            for name, template in (
                ("linux.c", "host.c"),
                ("opcua.py", "opcua.txt"),
            )  # a .py here would be compiled
        ),
    )
