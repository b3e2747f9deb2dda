"""What the studio's page says in German of sentences that are written in English.

``python tests/generator/test_studio_words.py`` lists those that it says in English still.
"""

import ast
import json
import re
from importlib.resources import files
from pathlib import Path

import pytest

from gen_profile.methods.solvers.solution import LATER, LONGER, WIDER, Status
from gen_profile.methods.solvers.suggestions import IN_VAIN
from gen_profile.presentation.studio.knobs import knobs
from gen_profile.presentation.studio.state import document_of, preset_start
from gen_profile.presentation.studio.views import SEARCHING
from gen_profile.spec.reading import preset_spec, presets, spec_from_dict
from gen_profile.support.errors import NoMotion

WORDS = json.loads((files("gen_profile.presentation.studio") / "assets" / "words.json").read_text("utf-8"))
ENGLISH = re.compile(
    r"\b(the|of|than|and|or|must|be|found|at|is|are|which|only|with|from|to|by|did|state|no|it|that)\b"
)
ENDS = [end.value for end in Status if end != Status.CONVERGED]
PART = re.compile(r"\{\{|\}\}|\{([^{}:!]+)[^}]*\}")  # as in words.js
ROOT = Path(__file__).parents[2]
PACKAGES = ("generator", "exporters", "fmu")


def untranslated():
    """List what has no German yet, which the page shows in English: what a translator adds to words.json."""
    stated = [preset_spec(preset).machine().summary for preset in presets()]
    summaries = {getattr(one, "template", one) for one in stated}
    no_motion = {str(one) for one in NoMotion(WIDER, LONGER, LATER, IN_VAIN).sentences}
    known = {*WORDS["messages"], *WORDS["texts"]}
    messages = {template for template, _ in templates()} | summaries | no_motion | {SEARCHING, *ENDS}
    return sorted(messages - known) + sorted(key for key, texts in WORDS["texts"].items() if not texts[1:])


def templates():
    """Find every template in the code, and where it is."""
    for file in (file for package in PACKAGES for file in (ROOT / package).rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            match node:
                case ast.Call(func=ast.Name(id="Phrase" | "Words"), args=[first, *_]):
                    said = first
                case ast.Call(
                    func=ast.Attribute(attr="add") | ast.Name(id="_odd"),
                    args=[_, first, *_],
                    keywords=[ast.keyword(), *_],
                ):
                    said = first
                case ast.Raise(exc=ast.Call(args=[first], keywords=[ast.keyword(), *_])):
                    said = first
                case ast.Assign(targets=[ast.Name(id="template" | "PLACED")]):
                    said = node.value
                case _:
                    continue
            parts = (said.body, said.orelse) if isinstance(said, ast.IfExp) else (said,)
            yield from ((part.value, file.name) for part in parts if isinstance(part, ast.Constant))


def fields(template):
    return sorted(part[1] for part in PART.finditer(template) if part[1])


@pytest.mark.slow
def test_translations_have_the_fields_of_their_templates():
    found = {template for template, _ in templates()}
    assert len(found) > 100 and found & set(WORDS["messages"])
    for template in found & set(WORDS["messages"]):
        translated = WORDS["messages"][template]
        assert set(fields(translated)) <= set(fields(template)), template
        english = ENGLISH.search(PART.sub("", translated).removeprefix("at:"))
        assert translated == template or not english, template


def test_every_word_is_there_in_english():
    shown = set()
    for preset in presets():
        document = document_of(preset_start(preset), {})
        spec = spec_from_dict(document)
        for knob in knobs(spec, document, spec):
            shown |= {knob.words, f"group.{knob.group}"} - {"plant", "robustness.uncertain"}
    assert shown - set(WORDS["texts"]) == set()
    assert all(len(texts) in (1, 2) and all(texts) for texts in WORDS["texts"].values())
    page = (files("gen_profile.presentation.studio") / "assets" / "studio.html").read_text("utf-8")
    used = {text.split('"')[0] for key in ('data-text="', 'data-words="') for text in page.split(key)[1:]}
    assert used - set(WORDS["texts"]) == set()


if __name__ == "__main__":
    print("\n".join(untranslated()))
