"""docs/troubleshooting.md, against the closed lists of codes in the program and in the blocks' headers."""

import re
from pathlib import Path

import pytest

from gen_profile.support.errors import Code

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "troubleshooting.md").read_text("utf-8")
BLOCKS = ROOT / "exporters" / "gen_profile_exporters"
TABLES = [
    dict(re.findall(r"^\| `?(\w+)`? \| .+? \| (.+) \|$", table, flags=re.MULTILINE))
    for table in re.findall(r"^\| (?:code|`nErrorId`|`nPromise`) \|.*\n(?:\|.*\n)+", PAGE, flags=re.MULTILINE)
]


def numbers(header, variable):
    """List the numbers that a block's header explains: at the beginning of a line, or after a semicolon."""
    _, _, rest = header.partition(f"{variable}: ")
    explained = re.split(r"\n    \w|\n\*\)", rest)[0]
    return set(re.findall(r"(?:^|\n\s+|; )(\d+) (?=[a-z{])", explained, flags=re.IGNORECASE)) - {"0"}


PLAYBACK, PLAYBACK_WRAPPER = (
    (BLOCKS / "playback" / "text" / name).read_text("utf-8") for name in ("block.st", "axis_wrapper.st")
)
PLANNER, PLANNER_WRAPPER = (
    (BLOCKS / "planner" / name).read_text("utf-8") for name in ("blocks/interface.st", "axis_wrapper.st")
)
WRAPPERS = numbers(PLAYBACK_WRAPPER, "nErrorId")
LISTED = [
    {code.value for code in Code},
    numbers(PLAYBACK, "nErrorId") | {"6"},  # of a library alone, explained where profiles are selected
    WRAPPERS,
    numbers(PLANNER, "nErrorId"),
    numbers(PLANNER_WRAPPER, "nErrorId") - WRAPPERS,
    numbers(PLANNER, "nPromise"),
]


@pytest.mark.parametrize(("table", "listed"), list(zip(TABLES, LISTED, strict=True)))
def test_every_code_has_a_cure(table, listed):
    cured = {word for word in table if not set(word) <= {"-"}}
    assert cured - {"code", "nErrorId", "nPromise"} == listed
    assert all(table.values())
