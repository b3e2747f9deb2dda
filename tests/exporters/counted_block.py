"""A planner block in C that counts its floating-point operations, built quickly."""

import ctypes
import subprocess
import tempfile
from functools import cache
from pathlib import Path

import numpy as np
from exporters.st_interpreter import block_of

from gen_profile.planner.execution import translated
from gen_profile_fmu.building.cache import cached
from gen_profile_fmu.description.fmu_files import digest

DOUBLES = ctypes.POINTER(ctypes.c_double)


@cache
def compile_counting(text):
    """The library of a block, its inputs with their initial values, and its outputs."""
    translation = translated(text)
    name = translation.name
    taken = "".join(f"fb->{v.name} = *in++; " for v in translation.inputs)
    given = "".join(f"*out++ = fb->{v.name}; " for v in translation.outputs)
    loop = f"""\
#define COUNT_OPERATIONS
#include "{name}.c"
long size(void) {{ return sizeof({name}); }}
void begin({name} *fb) {{ {name}_init(fb); }}
void play({name} *fb, const double *in, long cycles, double *out) {{
    while (cycles-- > 0) {{
        {taken}
        {name}_operations = 0;
        {name}_step(fb);
        {given}
        *out++ = (double){name}_operations;
    }}
}}
"""
    files = {f"{name}.h": translation.header, f"{name}.c": translation.source, "loop.c": loop}
    key = digest(*(content.encode("ascii") for content in files.values()))[:32]
    entry = cached(f"counted-{key}", lambda _: {"loop.so": _compiled(files)})
    library = ctypes.CDLL(str(entry / "loop.so"))
    library.size.restype = ctypes.c_long
    initial = {v.name: float({"true": 1, "false": 0}.get(v.initial[0], v.initial[0])) if v.initial else 0.0
               for v in translation.inputs}  # fmt: skip
    return library, initial, [v.name for v in translation.outputs] + ["operations"]


def _compiled(files):
    """Compile without optimisation, which takes gcc five times as long as these tests then run."""
    with tempfile.TemporaryDirectory() as folder:
        for file, content in files.items():
            Path(folder, file).write_text(content)
        options = ["-std=c99", "-O0", "-ffp-contract=off", "-shared", "-fPIC", "-o", "loop.so"]
        subprocess.run(["gcc", *options, "loop.c", "-lm"], cwd=folder, check=True)
        return Path(folder, "loop.so").read_bytes()


class CountedBlock:
    """An instance of such a library, given inputs by name."""

    def __init__(self, compiled, **inputs):
        self.library, initial, self.outputs = compiled
        self.inputs = initial | {"bEnable": 1.0} | inputs
        self.memory = ctypes.create_string_buffer(self.library.size())
        self.library.begin(self.memory)

    def hold(self, cycles, **inputs):
        """Hold inputs and give the outputs of every cycle by name; where bExecute is given, it is an edge."""
        was_high = self.inputs["bExecute"] and inputs.get("bExecute") and cycles > 1
        self.inputs |= {"bExecute": 0.0} | inputs
        rows = np.tile(list(self.inputs.values()), (cycles, 1))
        rows[: int(bool(was_high)), list(self.inputs).index("bExecute")] = 0.0
        return self._played(rows)

    def play_on(self, cycles):
        """Hold all inputs as they are, bExecute too."""
        return self._played(np.tile(list(self.inputs.values()), (cycles, 1)))

    def step(self):
        """Call it once with all inputs as they are; its outputs by name, as numbers of Python."""
        given = (ctypes.c_double * len(self.inputs))(*self.inputs.values())
        issued = (ctypes.c_double * len(self.outputs))()
        self.library.play(self.memory, given, ctypes.c_long(1), issued)
        return dict(zip(self.outputs, issued, strict=True))

    def _played(self, rows):
        cycles = len(rows)
        issued = np.empty((cycles, len(self.outputs)))
        self.library.play(
            self.memory, rows.ctypes.data_as(DOUBLES), ctypes.c_long(cycles), issued.ctypes.data_as(DOUBLES)
        )
        return dict(zip(self.outputs, issued.T, strict=True))


def require_interpreted(text, block, orders):
    """Hold what a block issues, bit for bit, to an interpreter that also refuses indices out of bounds.

    Orders are cycles and the inputs that change from there on. Gives the outputs of the last cycle.
    """
    oracle = block_of(text)
    for cycles, given in orders:
        for number in range(cycles):
            out = block.hold(1, **(given if number == 0 else {}))
            due = oracle.call(**{k: bool(v) if k[0] == "b" else v for k, v in block.inputs.items()})
            shown = {name: value[0] for name, value in out.items() if name != "operations"}
            assert {name: float(due[name.lower()]) for name in shown} == shown
    return shown
