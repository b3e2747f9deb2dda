"""One template language, and the white space that it leaves."""

import re

import jinja2
import pytest

from gen_profile_exporters.templates import FOLDER, filled, left_open

TEXTS = [
    path
    for suffix in ("st", "c", "h", "xml", "txt")
    for path in FOLDER.rglob(f"*.{suffix}")
    if path.parent.name != "blocks"
]


@pytest.fixture
def template(tmp_path):
    def written(text, name="some.st"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return written


def test_a_statement_on_a_line_of_its_own_leaves_no_trace(template):
    path = template("a\n    {% for name in names %}\n    {{ name }}\n    {% endfor %}\n\nb\n")
    assert filled(path, names=["x", "y"]) == "a\n    x\n    y\n\nb\n"
    assert filled(path, names=[]) == "a\n\nb\n"


def test_a_value_that_is_missing_is_an_error(template):
    with pytest.raises(jinja2.UndefinedError, match="'position' is undefined"):
        filled(template("{{ position }}"), velocity=0.0)


def test_what_others_wrote_ends_no_element_of_a_page(template):
    assert filled(template("{{ name }}", "page.html"), name="<b>") == "&lt;b&gt;"
    assert filled(template("{{ name }}"), name="a < b") == "a < b"


def test_what_stays_open_stands_by_its_name(template):
    assert left_open(str(template("{{ position }} of {{ axis }}")), axis="x") == "@position of x"


def test_no_text_has_another_notation():
    for path in TEXTS:
        assert not re.findall(r"(?m)^@\w+|\$\w+|^% *[A-Z]\w+", path.read_text("utf-8")), path
