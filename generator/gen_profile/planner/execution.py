"""Executing a written planner block: its own text, translated to C, compiled and called cycle by cycle."""

import ctypes
import json
from ctypes import POINTER, c_char_p, c_double, c_int, c_long, c_void_p
from functools import cache, lru_cache
from importlib.metadata import version
from itertools import chain, starmap
from pathlib import Path
from typing import Any

import attrs
import fmpy
import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.planner.interface import ISSUED, STATES, BlockAxis, block_axes
from gen_profile.support.errors import ExportError
from gen_profile.support.strict_json import parse_json
from gen_profile_exporters import st_to_c, st_variables, templates
from gen_profile_exporters.st_to_c import FAULTS, Translation, translate
from gen_profile_exporters.st_variables import StVariable
from gen_profile_fmu.building.build import compile_texts
from gen_profile_fmu.building.cache import cached
from gen_profile_fmu.building.compiler import find_compiler
from gen_profile_fmu.description.fmu_files import digest
from gen_profile_fmu.running.block_run import CalledBlock
from gen_profile_fmu.running.instances import doubles

LOOP = Path(__file__).with_name("block_loop.c").read_text("ascii")  # over cycles
# a block's loops are short: compiled in a sixth less time, it is as quick
SHORT_LOOPS = ("-fno-tree-vectorize", "-fno-tree-slp-vectorize", "-fno-unroll-loops")


class BlockInstance:
    """An instance of a function block.

    Parameters
    ----------
    text : str
        Structured Text, as `gen_profile_exporters.st_to_c` takes it.

    Raises
    ------
    ExportError
        It is no such text, or leaves its arrays or its time when it is called.
    CosimulationError
        There is no C compiler, or no folder to keep the library in.
    """

    def __init__(self, text: str) -> None:
        self._text = text
        self._translation, self._library = _loaded(text)
        self._memory = ctypes.create_string_buffer(self._library.instance_size())
        self._library.instance_init(self._memory)

    @property
    def inputs(self) -> dict[str, float]:
        """Initial values of the inputs, by name."""
        return block_inputs(self._text)

    @property
    def outputs(self) -> list[str]:
        """Names of the outputs."""
        return [v.name for v in self._translation.outputs]

    @property
    def axes(self) -> tuple[BlockAxis, ...]:
        """Those that it plans; raises ExportError where it is no planner block."""
        return block_axes(self._text)

    def called(self) -> CalledBlock:
        """Give a fresh instance to a loop that is compiled, too.

        Raises
        ------
        ExportError
            The text is no planner block's.
        """
        names = self.outputs
        axes = [[axis.of(name) for name in ISSUED] for axis in self.axes]
        if missing := [name for name in (*chain(*axes), *STATES) if name not in names]:
            raise ExportError(f"The function block has no output {missing[0]}, so it is no planner block.")
        memory = ctypes.create_string_buffer(len(self._memory))
        self._library.instance_init(memory)
        play = ctypes.cast(self._library.instance_play, c_void_p).value or 0
        return CalledBlock(play=play, memory=memory, outputs=names, axes=axes, states=STATES)

    def call(self, inputs: Array) -> Array:
        """Call the block once for every row of inputs.

        Parameters
        ----------
        inputs : (cycles, inputs) array
            In the order of `inputs`; truth values as 0 and 1.

        Returns
        -------
        (cycles, outputs) array
        """
        given = np.ascontiguousarray(inputs, dtype=np.float64)
        issued = np.empty((len(given), len(self._translation.outputs)))
        play = self._library.instance_play
        require_sound(play(self._memory, doubles(given), len(given), doubles(issued)))
        return issued


def block_inputs(text: str) -> dict[str, float]:
    """Read initial values of a block's inputs by name, without compiling it; raises as `BlockInstance`."""
    return {v.name: v.start for v in translated(text).inputs}


def require_sound(fault: int) -> None:
    """Refuse what a block did that no block of ours does.

    Parameters
    ----------
    fault : int
        Its place in `FAULTS`.

    Raises
    ------
    ExportError
    """
    if fault:
        raise ExportError(f"The function block {FAULTS[fault]}; its text was altered.")


@lru_cache(maxsize=4)
def translated(text: str) -> Translation:
    """Translate a block, which takes half a second, or find its translation in the cache.

    Raises
    ------
    ExportError
        It is no text that `translate` takes.
    CosimulationError
        There is no folder to keep it in.
    """
    file = "block.json"
    key = digest(text.encode("utf-8", "surrogatepass"), *_translator())[:32]
    entry = cached(f"translation-{key}", lambda _: {file: json.dumps(translate(text)).encode("ascii")})
    name, *sections, header, source = parse_json((entry / file).read_bytes())
    inputs, outputs = (
        tuple(one._replace(initial=tuple(one.initial)) for one in starmap(StVariable, section))
        for section in sections
    )
    return Translation(name, inputs, outputs, header, source)


@cache
def _translator() -> tuple[bytes, ...]:
    """Give all that a translation is made by, so that none outlives a change of it."""
    modules: tuple[Any, ...] = (st_to_c, st_variables, templates)  # perhaps in an archive
    code = (module.__loader__.get_data(module.__file__) for module in modules)
    texts = (templates.FOLDER / name for name in st_to_c.TEXTS)
    return version("lark").encode("ascii"), *code, *(path.read_bytes() for path in texts)


@lru_cache(maxsize=4)
def _loaded(text: str) -> tuple[Translation, ctypes.CDLL]:
    translation = translated(text)
    return translation, _compiled(translation)


def _compiled(translation: Translation) -> ctypes.CDLL:
    """Compile a block with a loop over cycles, or find it in the cache, and load it."""
    block, library = translation.name, f"block{fmpy.sharedLibraryExtension}"
    taken = "".join(f"        fb->{v.name} = *inputs++;\n" for v in translation.inputs)
    given = "".join(f"        *outputs++ = fb->{v.name};\n" for v in translation.outputs)
    loop = LOOP.replace("BLOCK", block).replace("TAKEN", taken).replace("GIVEN", given)
    texts = {f"{block}.h": translation.header, f"{block}.c": translation.source, "loop.c": loop}
    found = find_compiler()
    compiler = attrs.evolve(found, command=(*found.command, *SHORT_LOOPS))

    def make(cache: Path) -> dict[str, bytes]:
        return {library: compile_texts(texts, "loop.c", compiler, library, cache)}

    parts = (part.encode("utf-8") for part in (compiler.identity, *SHORT_LOOPS, *texts.values()))
    loaded = ctypes.CDLL(str(cached(f"block-{digest(*parts)[:32]}", make) / library))
    loaded.instance_size.restype = c_long
    loaded.instance_init.argtypes = [c_char_p]
    loaded.instance_play.argtypes = [c_void_p, POINTER(c_double), c_long, POINTER(c_double)]
    loaded.instance_init.restype = None
    loaded.instance_play.restype = c_int
    return loaded
