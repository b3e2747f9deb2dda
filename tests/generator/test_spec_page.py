"""docs/spec.md, against the spec's own classes and defaults."""

import re
import tomllib
from pathlib import Path
from typing import get_type_hints

import attrs
import pytest

from gen_profile.spec.model import Spec
from gen_profile.spec.reading import parse_spec, spec_from_dict
from gen_profile.support.errors import SpecError

PAGE = Path(__file__).parents[2] / "docs" / "spec.md"
(BLOCK,) = re.findall(r"^```toml\n(.*?)^```$", PAGE.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)
LINES = BLOCK.splitlines()
OPTIONAL = [number for number, line in enumerate(LINES) if re.match(r"# \[|# [\w.]+ = ", line)]
# fields that a file states in another way, which the page tells instead
OTHERWISE = {
    "plant": {"parameters": "L1", "defaults": "L1"},
    "move": {"shortest": "duration", "bounds": "duration"},
    "check": {"foreign": "fmu", "default": "residual_sway"},
}


def documented():
    """List the keys of every table, those in comments among them; of a key with dots the first part."""
    keys = {}
    table = ""
    for line in LINES:
        if heading := re.match(r"(?:# )?\[(\w+)(?:\.(\w+))?\]", line):
            table = heading[1]
            keys.setdefault(table, set()).update(heading.groups()[1:])
        elif key := re.match(r"(?:# )?(\w+)[\w.]* = ", line):
            keys.setdefault(table, set()).add(key[1])
    return keys


@pytest.mark.parametrize("field", attrs.fields(Spec), ids=lambda field: field.name)
def test_every_key_is_told(field):
    kind = get_type_hints(Spec)[field.name]
    if not attrs.has(kind):
        assert field.name in {*documented(), *documented()[""]}
        return
    other = OTHERWISE.get(field.name, {})
    due = {other.get(inner.name, inner.name) for inner in attrs.fields(kind)}
    assert due <= documented()[field.name]


def test_defaults_are_those_shown():
    document = tomllib.loads(BLOCK)
    stated = {
        "name": document["name"],
        "plant": document["plant"],
        "move": document["move"],
        "robustness": {"uncertain": document["robustness"]["uncertain"]},
        "check": {"residual_sway": document["check"]["residual_sway"]},
    }
    assert spec_from_dict(stated) == parse_spec(BLOCK)


@pytest.mark.parametrize("number", OPTIONAL, ids=lambda number: LINES[number].split("=")[0].strip("# "))
def test_every_optional_key_is_known(number):
    """Some need others beside them, which is another fault."""
    heading = max(at for at in range(number + 1) if re.match(r"(# )?\[", LINES[at]))
    lines = [line.removeprefix("# ") if at in {heading, number} else line for at, line in enumerate(LINES)]
    try:
        parse_spec("\n".join(lines), folder=PAGE.parent)
    except SpecError as error:
        assert not any("unknown key" in fault for fault in error.faults), error
