"""Pages for people: their links lead somewhere, and the options in their commands are options of these."""

import re
from pathlib import Path

from command_line import COMMANDS, cli

from gen_profile.plants.registry import find_plant, plant_types
from gen_profile_exporters.registry import BUILT_IN

ROOT = Path(__file__).parents[2]
DOCS = sorted((ROOT / "docs").glob("*.md"))
PAGES = [*ROOT.glob("*.md"), *DOCS]
BRIEF = {"glossary"}  # a table that needs no introduction
OF_THE_GROUP = {"--help", "--version"}


def test_links_lead_somewhere():
    links = {page: re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text("utf-8")) for page in PAGES}
    assert sum(map(len, links.values())) > 200
    assert [(p.name, to) for p, all_ in links.items() for to in all_ if not (p.parent / to).exists()] == []


def test_a_page_begins_with_what_it_is_for():
    for page in DOCS:
        box = page.read_text("utf-8").split("\n\n")[1].replace("\n> ", " ")
        assert page.stem in BRIEF or re.fullmatch(
            r"> \*\*What it is for:\*\* .+\. \*\*When to read it:\*\* .+\. \*\*Example:\*\* .+\.", box
        ), page.name


def test_every_format_is_on_its_page():
    page = (ROOT / "docs" / "formats.md").read_text("utf-8")
    rows = re.findall(r"^\| (`.*?) \| (`.*?) \|", page, re.M)
    for name, form in BUILT_IN.items():
        (files,) = (files for names, files in rows if f"`{name}`" in names)
        assert form.suffix in files, name


def commands_on(page):
    """List what follows ``gen-profile`` in code, continued lines joined, up to the command's end."""
    text = page.read_text("utf-8").replace("\\\n", " ")
    return [line.split() for line in re.findall(r"(?<![\w-])gen-profile ((?:[\w-]|\S*/)[^\n`#|&;]*)", text)]


def test_options_are_those_of_the_command():
    wrong = []
    for words in (words for page in PAGES for words in commands_on(page)):
        own = getattr(cli.commands.get(words[0]), "default", "")
        names = (words[0], " ".join(words[:2]), f"{words[0]} {own}", cli.default)
        command = next(COMMANDS[name] for name in names if name in COMMANDS)
        known = {option for parameter in command.params for option in parameter.opts} | OF_THE_GROUP
        asked = {word.partition("=")[0] for word in words if re.match(r"--[a-z-]+(=|$)", word)}
        wrong += [(words, option) for option in asked - known]
    assert wrong == []


def test_every_coordinate_that_swings_is_explained():
    """Their signs and what they count from decide whether a swinging start is taken away or doubled."""
    page = (ROOT / "docs" / "machines.md").read_text("utf-8")
    section = page.partition("**Signs.**")[2].partition("\n\n**")[0]
    rows = dict(re.findall(r"^\| `(.+?)` \| (.+) \|$", section, re.MULTILINE))
    for type_ in plant_types():
        row = rows[re.sub(r"-\d+$", "-N", type_)].replace("`dN`", "`d2`")
        assert re.findall(r"`(\w+)`", row) == [free.name for free in find_plant(type_).unactuated]
