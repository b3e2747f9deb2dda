"""The pages for people: their fenced blocks, and running those of one page as a reader would."""

from __future__ import annotations

import math
import os
import re
import shlex
import subprocess
import sys
import sysconfig
import tomllib
from pathlib import Path
from typing import Any

import attrs
from command_line import PROGRAM, run_here

from gen_profile.spec.reading import spec_from_dict
from gen_profile.support.errors import SpecError

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCK = re.compile(r'^```(\w*)(?: title="([^"\n]+)")?\n(.*?)^```$', re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"\d+(?:\.\d+)?")
NO_BUS = "no-such-bus"


@attrs.frozen
class Block:
    """A fenced block. Its title names the file that it is, or says where its commands can be given."""

    language: str
    title: str
    text: str


def blocks(page: Path, *languages: str) -> list[Block]:
    """List a page's blocks, of some languages or all."""
    found = (Block(*parts) for parts in BLOCK.findall(page.read_text("utf-8")))
    return [block for block in found if not languages or block.language in languages]


def run(block: Block, scope: dict[str, Any]) -> None:
    """Do with a block, in the folder of now, what a reader does; scripts of one page share their names."""
    match block:
        case Block(language="sh", title="with a drive on can0" | "with the bus vcan0"):
            for command in _commands(block.text):
                # all that comes before the bus is reached; how punctual this machine is now is another matter
                words = [NO_BUS if word in {"can0", "vcan0"} else word for word in command]
                outcome = run_here(*(word for word in words[1:] if word not in {"&", "--self-test"}))
                assert outcome.code in {2, 6} and NO_BUS in outcome.err, (
                    f"{shlex.join(command)}\n{outcome.err}"
                )
        case Block(language="sh", title=""):
            scope["printed"] = _run_commands(block.text)
        case Block(language="text", title="it prints"):
            missing = [line for line in block.text.splitlines() if not _is_printed(line, scope["printed"])]
            assert not missing, f"{missing}\n{scope['printed']}"
        case Block(language="python", title=""):
            exec(block.text, scope)
        case Block(language="toml", title=""):
            _require_known_keys(block.text)
        case Block(language="toml" | "csv", title=name):
            Path(name).write_text(block.text, "utf-8")
        case Block(language="c"):
            _compile(block.text)
        case Block(language="st") if (
            '"' in block.text
        ):  # SCL, in which blocks of other makers are called, too
            (wrapper,) = Path().rglob("*_velocity.scl")
            called = " ".join(re.findall(r'(?s)"Crane"\((.*?)\);', block.text))
            declared = wrapper.read_text("utf-8")
            assert [name for name in re.findall(r"(\w+) :=", called) if f"{name} : " not in declared] == []
        case Block(language="st"):
            wrappers = "".join(path.read_text("utf-8") for path in Path().rglob("*_Axis.TcPOU"))
            named = set(re.findall(r"(\w+) :=", block.text)) - {"Axis"}
            assert [name for name in named if f"{name} :" not in wrappers] == []
        case _:
            # what is printed, drawn or for another system; `run_here` holds documents to their page
            assert block.language in {"text", "json", "mermaid", "powershell"} or block.title in {
                "on several computers",
                "on the controller",
                "without Python",
            }


def _require_known_keys(text: str) -> None:
    """Hold a part of a spec, which says no machine or move perhaps, to the keys that there are."""
    part = tomllib.loads(text)
    try:
        spec_from_dict(part, folder=ROOT / "examples")
    except SpecError as error:
        assert not [fault for fault in error.faults if "unknown key" in fault], error


def _compile(text: str) -> None:
    """Compile lines in C that call the block whose files are in this folder, without a warning."""
    (header,) = Path().rglob("*.h")
    own = "void wait_for_the_next_cycle(void); void send(double, double, double);"
    own += "extern double where_the_axis_stands;"
    Path("page.c").write_text(
        f'#include "{header.as_posix()}"\n{own}\nvoid guide(void) {{\n{text}}}\n', "utf-8"
    )
    compiler = [sys.executable, "-m", "ziglang", "cc", "-Wall", "-Wextra", "-Werror", "-c", "page.c"]
    done = subprocess.run(compiler, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()


def _commands(text: str) -> list[list[str]]:
    """Split lines into words as a shell does; operators are words of their own."""
    lexer = (
        shlex.shlex(line, posix=True, punctuation_chars=True)
        for line in text.replace("\\\n", " ").splitlines()
    )
    split = []
    for words in lexer:
        words.whitespace_split = True
        split.append(list(words))
    return [words for words in split if words]


def _is_printed(line: str, printed: str) -> bool:
    """Look for a line of a page: numbers to 1 % or two units of the last digit, anything for ``…``."""
    pattern = f"({NUMBER.pattern})".join(re.escape(part).replace("…", ".*") for part in NUMBER.split(line))
    shown = NUMBER.findall(line)
    found = re.finditer(f"^{pattern}$", printed, re.MULTILINE)
    return any(all(map(_is_about, shown, match.groups())) for match in found)


def _is_about(shown: str, found: str) -> bool:
    unit = 10.0 ** -len(shown.partition(".")[2])
    return math.isclose(float(shown), float(found), rel_tol=0.01, abs_tol=2.0 * unit if "." in shown else 0.0)


def _run_commands(text: str) -> str:
    """Run this program's commands in this process, which is quicker, and other blocks in a shell.

    Returns what they print.
    A comment ``exit code N`` says how the command on its line or on the next one is to end, if not in 0.
    """
    if not all(_is_plain(command) for command in _commands(text)):
        scripts = sysconfig.get_path("scripts")  # where a package has a minisign that does nothing
        path = os.pathsep.join(one for one in os.environ["PATH"].split(os.pathsep) if one != scripts)
        program = f"shopt -s expand_aliases\nalias gen-profile={shlex.quote(str(PROGRAM))}"
        python = f'python() {{ {shlex.quote(sys.executable)} "$@"; }}'
        done = subprocess.run(
            ["bash", "-euc", f"{program}\n{python}\n{text}"],
            env={**os.environ, "PATH": path},
            capture_output=True,
            check=False,
        )
        assert done.returncode == 0, f"{text}\n{done.stderr.decode()}"
        return done.stdout.decode()
    printed = ""
    code = 0
    for line in text.replace("\\\n", " ").splitlines():
        expected = re.search(r"# exit code (\d)", line)
        code = int(expected[1]) if expected else code
        for command in _commands(line):
            outcome = run_here(*command[1:])
            assert outcome.code == code, f"{line}\n{outcome.err}"
            printed += outcome.out
            code = 0
    return printed


def _is_plain(command: list[str]) -> bool:
    return command[0] == "gen-profile" and not any(set(word) <= set("();<>|&") for word in command)
