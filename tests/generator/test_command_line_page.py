"""docs/command-line.md, against click's own tree of commands and the tree of errors."""

import re

import click
import pytest
from command_line import COMMANDS
from json_page import PAGE, documented, require_documented

from gen_profile.cli import outcome
from gen_profile.support.errors import GenProfileError

TEXT = PAGE.read_text("utf-8")
SHARED = {"spec_path", "preset", "overrides", "as_json", "debug"}  # told once, at the page's top


def section(heading):
    _, _, rest = TEXT.partition(f"\n## {heading}\n")
    return re.split(r"^## ", rest, flags=re.MULTILINE)[0]


def usage(name, command):
    context = click.Context(command, info_name=f"gen-profile {name}")
    return f"`{' '.join([context.info_name, *command.collect_usage_pieces(context)])}`"


def row(option):
    name, _ = option.get_help_record(click.Context(click.Command("any")))
    cells = (name, option.help)
    return "| `{}` | {} |".format(*(cell.replace("|", r"\|").replace("<", r"\<") for cell in cells))


def rows(text):
    return [line for line in text.splitlines() if line.startswith("| `-")]


def test_every_command_has_its_section():
    headings = re.findall(r"^## (`gen-profile .*)$", TEXT, flags=re.MULTILINE)
    assert sorted(headings) == sorted(usage(name, command) for name, command in COMMANDS.items())


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_option_is_told_as_help_tells_it(name):
    command = COMMANDS[name]
    own = [p for p in command.params if isinstance(p, click.Option) and p.name not in SHARED]
    assert rows(section(usage(name, command))) == [row(option) for option in own]
    assert {"as_json", "debug"} <= {p.name for p in command.params}


def test_shared_options_are_told_once():
    top = rows(section("What many commands take"))
    taken = {p.name: p for p in COMMANDS["design"].params if isinstance(p, click.Option)}
    for name in SHARED - {"spec_path"}:
        assert row(taken[name]) in top


def test_every_exit_code_is_told():
    codes = {int(code) for code in re.findall(r"^\| (\d+) \|", section("Exit codes"), flags=re.MULTILINE)}
    kinds = [GenProfileError, *GenProfileError.__subclasses__()]
    assert codes == {0, *(kind.exit_code for kind in kinds), outcome.INTERRUPTED}


def test_every_command_s_document_is_told():
    assert all(documented()[name] for name in COMMANDS)


@pytest.mark.parametrize(
    ("document", "fault"),
    [
        ({"presets": {"paper": "text"}, "more": 1}, r"presets\.more is not told"),
        ({}, r"presets\.presets is described, but not there"),
        ({"presets": {"paper": {"deep": 1}}}, r"presets\.presets\.paper has keys that are not told"),
        ({"error": {"type": "SpecError"}}, r"presets\.error\.message is described, but not there"),
    ],
)
def test_keys_that_differ_are_found(document, fault):
    require_documented("presets", {"presets": {"paper": "text"}})
    with pytest.raises(AssertionError, match=fault):
        require_documented("presets", document)
