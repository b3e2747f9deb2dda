"""The C compiler that makes an FMU's binary: Zig's from PyPI, or the one that the environment names."""

from __future__ import annotations

import importlib.util
import os
import shlex
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from platform import machine

import attrs

from gen_profile.errors import CosimulationError

ENVIRONMENT_VARIABLE = "GEN_PROFILE_CC"
# contraction to fused multiply-add would make results depend on the processor
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-fvisibility=hidden", "-shared")
# no newer C library than this is needed by what Zig links
_TARGETS = {
    ("linux", "x86_64"): "x86_64-linux-gnu.2.17",
    ("linux", "aarch64"): "aarch64-linux-gnu.2.17",
    ("darwin", "x86_64"): "x86_64-macos.11.0",
    ("darwin", "aarch64"): "aarch64-macos.11.0",
    ("win32", "x86_64"): "x86_64-windows-gnu",
}
_MACHINES = {"amd64": "x86_64", "arm64": "aarch64"}


@attrs.frozen(kw_only=True)
class Compiler:
    """A C compiler and all of its options.

    Attributes
    ----------
    command : tuple of str
        Program and options, without files.
    identity : str
        Names version and options: the same sources and identity give the same binary.
    """

    command: tuple[str, ...]
    identity: str


def find_compiler() -> Compiler:
    """Choose the compiler: `GEN_PROFILE_CC` where that is set, else Zig's.

    Raises
    ------
    CosimulationError
        When there is none for this computer, or the one named does not run.
    """
    named = os.environ.get(ENVIRONMENT_VARIABLE, "").strip()
    return _named_compiler(named) if named else _zig_compiler()


def _named_compiler(text: str) -> Compiler:
    command = (*shlex.split(text), *FLAGS)
    reported = _run((command[0], "--version"), folder=None, environment=None)
    return Compiler(command=command, identity="\n".join((text, *FLAGS, sys.platform, machine(), reported)))


def _zig_compiler() -> Compiler:
    processor = machine().lower()
    target = _TARGETS.get((sys.platform, _MACHINES.get(processor, processor)))
    spec = importlib.util.find_spec("ziglang")
    if target is None or spec is None or not spec.submodule_search_locations:
        raise CosimulationError(
            f"There is no compiler for the plant's FMU on {sys.platform} {processor}. "
            "Install the package ziglang, or name a C compiler in the environment variable "
            f"{ENVIRONMENT_VARIABLE}."
        )
    program = Path(spec.submodule_search_locations[0]) / ("zig.exe" if sys.platform == "win32" else "zig")
    options = ("-target", target, *FLAGS, "-s")
    return Compiler(
        command=(str(program), "cc", *options), identity="\n".join(("ziglang", version("ziglang"), *options))
    )


def compile_library(compiler: Compiler, folder: Path, output: str, zig_cache: Path) -> None:
    """Compile all C files of a folder to one shared library beside them.

    Parameters
    ----------
    compiler : Compiler
    folder : Path
        Files are named relative to it, so that no path of this computer gets into the library.
    output : str
        File name of the library.
    zig_cache : Path
        Where Zig keeps the parts of a C library that it has built.

    Raises
    ------
    CosimulationError
        With the compiler's words.
    """
    sources = sorted(path.name for path in folder.glob("*.c"))
    environment = {
        **os.environ,
        "ZIG_GLOBAL_CACHE_DIR": str(zig_cache),
        "ZIG_LOCAL_CACHE_DIR": str(zig_cache),
    }
    _run((*compiler.command, "-I.", "-o", output, *sources, "-lm"), folder=folder, environment=environment)


def _run(command: tuple[str, ...], folder: Path | None, environment: dict[str, str] | None) -> str:
    try:
        done = subprocess.run(
            command, cwd=folder, env=environment, stdin=subprocess.DEVNULL, capture_output=True, check=False
        )
    except OSError as error:
        raise CosimulationError(
            f"The C compiler {command[0]} does not run: {error.strerror}. "
            f"Reinstall ziglang, or name another in the environment variable {ENVIRONMENT_VARIABLE}."
        ) from error
    words = (done.stdout + done.stderr).decode("utf-8", errors="replace").strip()
    if done.returncode != 0:
        raise CosimulationError(
            f"The C compiler {command[0]} could not build the plant's FMU (exit code {done.returncode}). "
            f"It says:\n{words[-2000:]}"
        )
    return words
