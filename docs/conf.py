"""Sphinx's settings: the README and the pages of this folder, as they stand, become a site.

sphinx-build -W -c docs . build/site
"""

import re
from importlib.metadata import version as installed_version
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.util.typing import ExtensionMetadata

import gen_profile

NAVIGATION = {
    "Tutorials": "tutorial-crane over-stacks tutorial-tia tutorial-logix tutorial-research tutorial-drive",
    "How to": (
        "standalone machines plc sweeps planner planner-sensor planner-history soft-plc deploy can fmu studio"
        " report python troubleshooting"
    ),
    "Examples": "/examples/README",
    "Reference": "command-line spec formats api glossary",
    "Explanation": "check certificate shapers solvers planner-algorithm planner-proof paper architecture",
    "Project": "/CHANGELOG /CONTRIBUTING /SECURITY",
}

CORRECTIONS = {
    'class="caption" role="heading"': 'class="caption" role="heading" aria-level="2"',
    '<aside class="sidebar-drawer"': '<aside aria-label="Pages" class="sidebar-drawer"',
    '<aside class="toc-drawer': '<aside aria-label="Sections" class="toc-drawer',
    '<th class="head"><p></p></th>': "<td></td>",  # Markdown has no table without a head
    "<pre>": '<pre tabindex="0">',  # which scrolls
    '<div class="table-wrapper': '<div tabindex="0" class="table-wrapper',
}

# a browser reads no other page of a folder for a script, so results found there have no excerpts
OFFLINE = ("SHOW_SEARCH_SUMMARY: true", 'SHOW_SEARCH_SUMMARY: location.protocol !== "file:"')

project = "gen-profile"
author = "the gen-profile contributors"
copyright = f"{author}, Apache-2.0"  # noqa: A001
version = release = installed_version("gen-profile")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_copybutton"]
root_doc = "README"
include_patterns = ["*.md", "docs/*.md", "examples/*.md"]
suppress_warnings = ["ref.python"]  # words for shapes, such as (samples, axes), are names of attributes, too
smartquotes = False  # `--json` is no dash

myst_heading_anchors = 4  # as GitHub names them
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # docstrings tell types, shapes and units
autodoc_preserve_defaults = True

html_theme = "furo"
html_title = f"{project} {version}"
html_copy_source = False
html_theme_options = {"footer_icons": []}


def add_navigation(_: Sphinx, page: str, source: list[str]) -> None:
    """Append the site's tree of pages to the README, which does without it elsewhere."""
    if page == root_doc:
        for caption, names in NAVIGATION.items():
            pages = "\n".join(name if name.startswith("/") else f"/docs/{name}" for name in names.split())
            source[0] += f"\n```{{toctree}}\n:hidden:\n:caption: {caption}\n\n{pages}\n```\n"


def show_titles(_: Sphinx, __: str, source: list[str]) -> None:
    """Show a block's title, which tells where it goes; there are no colours for CSV and Structured Text."""
    source[0] = source[0].replace("```csv", "```text").replace("```st\n", "```text\n")
    source[0] = re.sub(
        r'^```(\w+) title="(.+)"$', r"```{code-block} \1\n:caption: \2\n", source[0], flags=re.MULTILINE
    )


def insert_docstrings(_: Sphinx, page: str, source: list[str]) -> None:
    """Put each public name's docstring where the page lists the name."""
    if page == "docs/api":
        source[0] = re.sub(r"^(`\w+`,?\s)+$", _docstrings, source[0] + "\n", flags=re.MULTILINE)


def _docstrings(names: re.Match[str]) -> str:
    directives = "\n".join(_directive(name) for name in re.findall(r"\w+", names[0]))
    return f"```{{eval-rst}}\n{directives}\n```\n"


def _directive(name: str) -> str:
    kind = type(getattr(gen_profile, name))
    if kind is not type:
        return f".. autofunction:: gen_profile.{name}\n"
    return f".. autoclass:: gen_profile.{name}\n   :members:\n"


def leave_out_fields(_: Sphinx, __: str, ___: str, value: object, *____: object) -> tuple[str, None] | None:
    """Show no list of fields with their defaults, which the class's docstring tells better."""
    return ("", None) if hasattr(value, "__attrs_attrs__") else None


def mend_pages(app: Sphinx, error: Exception | None) -> None:
    """Correct what axe finds wrong in the theme, and lead from the folder's own address to the README."""
    if error is None and app.builder.format == "html":
        for page in Path(app.outdir).rglob("*.html"):
            text = page.read_text("utf-8")
            for wrong, right in CORRECTIONS.items():
                text = text.replace(wrong, right)
            page.write_text(text, "utf-8")
        options = Path(app.outdir, "_static", "documentation_options.js")
        options.write_text(options.read_text("utf-8").replace(*OFFLINE), "utf-8")
        entrance = f'<meta http-equiv="refresh" content="0; url={root_doc}.html">'
        Path(app.outdir, "index.html").write_text(
            f"<!doctype html><title>{project}</title>{entrance}", "utf-8"
        )


def setup(app: Sphinx) -> ExtensionMetadata:
    """Have Sphinx call these."""
    for change in (add_navigation, show_titles, insert_docstrings):
        app.connect("source-read", change)
    app.connect("autodoc-process-signature", leave_out_fields)
    app.connect("build-finished", mend_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
