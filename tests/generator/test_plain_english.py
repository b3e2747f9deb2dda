"""Words that engineers do not use stay out of code, docs and tests, once they were replaced."""

import io
import re
import tokenize
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDERS = ("generator", "fmu", "exporters", "recheck", "tests", "examples", "docs")
KINDS = {".py", ".c", ".h", ".st", ".js", ".html", ".json", ".toml", ".md", ".ipynb"}
PROSE = re.compile(
    r"\b(lest|who(?:m)?ever|nobody|somebody|anybody|beware|hardly\s+meant|doubtful|say\s+it"
    r"|mend(?:s|ed|ing)?|vouch\w*|surrender\w*|in\s+vain|for\s+ever"
    r"|(?:is|are|was|were|be|been|being)\s+(?:[#*/]+\s+)?told)\b",
    re.IGNORECASE,
)
NAMES = set(
    re.findall(
        r"\w+",
        "told untold felt eased lowers beware doubts unrest UNREST EARTH MEANINGS ALIKE CALM LOOK "
        "Desk QuestionLine leave_off begins missed enough turned bends",
    )
)

BLOCK_NAMES = re.compile(r"\b[abcfn](?:Surrender|Vain|Vouched|Gone)\b")
LEFT_OUT = re.compile(r"/uPlot/")  # others' text


def texts():
    pages = [*ROOT.glob("*.md"), *(file for folder in FOLDERS for file in (ROOT / folder).rglob("*.*"))]
    found = {
        file: file.read_text("utf-8") for file in pages if file.suffix in KINDS and file != Path(__file__)
    }
    return {file: text for file, text in found.items() if not LEFT_OUT.search(file.as_posix())}


def test_prose_is_plain():
    files = texts()
    assert len(files) > 600
    found = [
        f"{file.relative_to(ROOT)}:{text.count(chr(10), 0, one.start()) + 1}: {one[0]}"
        for file, text in files.items()
        for one in PROSE.finditer(text)
    ]
    assert found == []


def test_blocks_have_names_that_say_what_they_hold():
    blocks = {file: text for file, text in texts().items() if file.suffix == ".st"}
    assert blocks
    assert {file.name: found for file, text in blocks.items() if (found := BLOCK_NAMES.findall(text))} == {}


@pytest.mark.slow
def test_names_say_what_they_hold():
    found = {
        (str(file.relative_to(ROOT)), token.string)
        for file, text in texts().items()
        if file.suffix == ".py" and not NAMES.isdisjoint(re.findall(r"\w+", text))
        for token in tokenize.generate_tokens(io.StringIO(text).readline)
        if token.type == tokenize.NAME and token.string in NAMES
    }
    assert found == set()


@pytest.mark.parametrize(
    "text", ["lest it moves", "as the block is\n    # told", "Whoever", "Say it.", "it is mended"]
)
def test_that_test_sees_words(text):
    assert PROSE.search(text)
