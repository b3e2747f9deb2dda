"""The manual's pages as the studio shows them: rendered from Markdown, with an anchor at every key of a spec.

A wheel holds the pages beside the package; a checkout has them in its folder ``docs``. A key's anchor stands
at its line in the TOML of ``spec.md``, whose comments say what it means.
"""

import re
from collections.abc import Iterator, Sequence
from functools import cache
from html import escape
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from markdown_it import MarkdownIt
from markdown_it.renderer import RendererHTML
from markdown_it.token import Token
from markdown_it.utils import OptionsDict

KEYS = "spec"  # the page that has every key
ELSEWHERE = {"api"}  # which Sphinx alone can make of docstrings
_TABLE = re.compile(r"(?:# )?\[([\w.]+)\]")
_KEY = re.compile(r'(?:# )?([\w."]+) = ')
_PAGE = re.compile(r"([\w-]+)\.md(#[\w-]+)?|(#[\w-]+)", re.ASCII)


def folder() -> Traversable:
    """Find the pages."""
    shipped = resources.files("gen_profile") / "docs"
    return shipped if shipped.is_dir() else Path(__file__).parents[4] / "docs"


@cache
def pages() -> tuple[str, ...]:
    """List the pages by name, sorted."""
    files = (Path(file.name) for file in folder().iterdir() if file.is_file())
    return tuple(sorted(file.stem for file in files if file.suffix == ".md" and file.stem not in ELSEWHERE))


def picture(name: str) -> bytes | None:
    """Read a picture of a page; None where there is none."""
    file = folder() / f"{name}.png"
    return file.read_bytes() if re.fullmatch(r"[\w-]+", name, re.ASCII) and file.is_file() else None


@cache
def page(name: str) -> str | None:
    """Render a page as a document by itself; None where there is none."""
    if name not in pages():
        return None
    text = (folder() / f"{name}.md").read_text("utf-8")
    title = escape(_title(text))
    body = _markdown().render(text).replace("<th></th>", "<td></td>")  # Markdown has no table without a head
    listed = "".join(f'<li><a href="{other}">{escape(other)}</a></li>' for other in pages())
    return (
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{title}</title>\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n<link rel="icon" href="data:,">\n'
        '<link rel="stylesheet" href="../manual.css">\n</head>\n<body>\n'
        f'<nav aria-label="Pages"><details><summary>Pages</summary><ul>{listed}</ul></details></nav>\n'
        f"<main>\n{body}</main>\n</body>\n</html>\n"
    )


@cache
def anchors() -> frozenset[str]:
    """List the keys and tables that ``spec.md`` has an anchor for."""
    tokens = _markdown().parse((folder() / f"{KEYS}.md").read_text("utf-8"))
    blocks = [token.content for token in tokens if token.type == "fence" and token.info == "toml"]
    known = set[str]()
    return frozenset(key for block in blocks for key, _ in _keyed(block, known) if key)


def help_on(key: str) -> str:
    """Tell where a key is explained: at its line, or at that of the table that it is in."""
    place = key
    while place and place not in anchors():
        place = place.rpartition(".")[0]
    return f"help/{KEYS}#{place}" if place else f"help/{KEYS}"


def _keyed(block: str, known: set[str]) -> Iterator[tuple[str, str]]:
    """List lines of TOML, each with the key that it is the first on its page to state, or nothing."""
    table = ""
    for line in block.splitlines(keepends=True):
        key = ""
        if found := _TABLE.match(line):
            key = table = found[1]
        elif found := _KEY.match(line):
            key = f"{table}.{found[1]}".removeprefix(".")
        yield ("" if key in known else key), line
        known.add(key)


def _title(text: str) -> str:
    return next(line.removeprefix("# ") for line in text.splitlines() if line.startswith("# "))


@cache
def _markdown() -> MarkdownIt:
    made = MarkdownIt("commonmark", {"html": False}).enable("table")
    made.add_render_rule("heading_open", _heading)
    made.add_render_rule("link_open", _link)
    made.add_render_rule("fence", _fence)
    made.add_render_rule("code_block", _fence)
    for cell in ("th_open", "td_open"):
        made.add_render_rule(cell, _cell)
    made.add_render_rule("table_open", lambda *_: '<div class="table" tabindex="0"><table>\n')
    made.add_render_rule("table_close", lambda *_: "</table></div>\n")
    return made


def _heading(
    self: RendererHTML, tokens: Sequence[Token], at: int, options: OptionsDict, env: dict[str, Any]
) -> str:
    """Give a heading the anchor that GitHub gives it."""
    words = tokens[at + 1].content.lower()
    anchor = re.sub(r"[^\w\- ]", "", re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", words)).replace(" ", "-")
    return f'<{tokens[at].tag} id="{anchor}">'


def _link(
    self: RendererHTML, tokens: Sequence[Token], at: int, options: OptionsDict, env: dict[str, Any]
) -> str:
    """Lead to another page of the manual; what lies elsewhere may be out of reach, and is named only."""
    found = _PAGE.fullmatch(str(tokens[at].attrGet("href")))
    if found is None or (found[1] and found[1] not in pages()):
        return "<a>"
    return f'<a href="{found[3] or found[1] + (found[2] or "")}">'


def _fence(
    self: RendererHTML, tokens: Sequence[Token], at: int, options: OptionsDict, env: dict[str, Any]
) -> str:
    """Show a program, or TOML with an anchor at each of its keys."""
    token, text = tokens[at], escape(tokens[at].content, quote=False)
    if token.info == "toml":
        text = "".join(
            f'<span id="{key}">{escape(line, quote=False)}</span>' if key else escape(line, quote=False)
            for key, line in _keyed(token.content, env.setdefault("keys", set()))
        )
    return f'<pre tabindex="0"><code>{text}</code></pre>\n'


def _cell(
    self: RendererHTML, tokens: Sequence[Token], at: int, options: OptionsDict, env: dict[str, Any]
) -> str:
    """Leave out the style of its alignment, which the page's policy refuses."""
    return f"<{tokens[at].tag}>"
