"""What the studio's page says in German of sentences that are written in English."""

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
from gen_profile.presentation.studio.views import SEARCHING, fault
from gen_profile.spec.plausibility import plausibility_warnings
from gen_profile.spec.reading import preset_spec, presets, spec_from_dict
from gen_profile.support.errors import NoMotion, SpecError, Suggestion
from gen_profile.support.phrase import Phrase

WORDS = json.loads((files("gen_profile.presentation.studio") / "assets" / "words.json").read_text("utf-8"))
ENGLISH = re.compile(
    r"\b(the|of|than|and|or|must|be|found|at|is|are|which|only|with|from|to|by|did|state|no|it|that)\b"
)
ENDS = [end.value for end in Status if end != Status.CONVERGED]
PART = re.compile(r"\{\{|\}\}|\{([^{}:!]+)[^}]*\}")  # as in words.js
ROOT = Path(__file__).parents[2]
PACKAGES = ("generator", "exporters", "fmu")
UNFIT = {
    "number": (-1.0, 0.0, 1e3, 1e5, 1e9),
    "interval": (0.95,),
    "pair": ([3.0, 1.0], [-1.0, 1e9]),
    "switch": (True, False),
    "several": (["none"],),
    "text": ("",),
    "choice": (),
}


def german(sentence):
    """Translate as words.js does."""
    if isinstance(sentence, Phrase):
        template, values = WORDS["messages"][sentence.template], sentence.values
        return PART.sub(lambda part: german(values[part[1]]) if part[1] else part[0][0], template)
    return WORDS["texts"].get(sentence, ["", WORDS["messages"].get(sentence, sentence)])[1]


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
def test_every_template_has_a_translation_with_the_same_fields():
    found = set(templates())
    assert len(found) > 100
    for template, file in sorted(found):
        assert template in WORDS["messages"], file
        translated = WORDS["messages"][template]
        assert set(fields(translated)) <= set(fields(template)), template
        english = ENGLISH.search(PART.sub("", translated).removeprefix("at:"))
        assert translated == template or not english, template


def sentences_of(document):
    """What the spec's rules say of a document, without the places."""
    try:
        sentences = plausibility_warnings(spec_from_dict(document))
    except SpecError as error:
        sentences = error.faults
    return {fault(sentence)["sentence"] for sentence in sentences}


SUGGESTED = [
    Suggestion(values={place: 4.5}, spec=None, fraction=fraction, passes=fraction <= 1.0)
    for place in ("move.duration", "limits.jerk")
    for fraction in (0.5, 2.0)
]


@pytest.mark.parametrize(
    "sentence",
    [*NoMotion(WIDER, LONGER, LATER, IN_VAIN, suggestions=SUGGESTED).sentences, SEARCHING, *ENDS],
)
def test_why_there_is_no_motion(sentence):
    assert not ENGLISH.search(german(sentence))


@pytest.mark.parametrize("preset", presets())
def test_a_machine_s_summary(preset):
    summary = preset_spec(preset).machine().summary
    assert german(summary) != summary


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["paper", "gantry-crane", "flexible-joint"])
def test_whatever_rules_say_of_a_knob_s_value(preset):
    start = preset_start(preset)
    spec = spec_from_dict(start.document)
    sentences = set()
    for knob in knobs(spec, start.document, spec):
        usual = (50.0 * knob.value,) if isinstance(knob.value, float) else ()
        for value in (*UNFIT[knob.kind], *knob.choices, *usual):
            changed = value if knob.index is None else [value] * len(spec.axis)
            sentences |= sentences_of(document_of(start, {knob.path: changed}))
    assert len(sentences) > 30
    english = {sentence for sentence in sentences if ENGLISH.search(german(sentence))}
    assert english == set()


def test_every_word_is_there_in_both_languages():
    shown = set()
    for preset in presets():
        document = document_of(preset_start(preset), {})
        spec = spec_from_dict(document)
        for knob in knobs(spec, document, spec):
            shown |= {knob.words, f"group.{knob.group}"} - {"plant", "robustness.uncertain"}
    assert shown - set(WORDS["texts"]) == set()
    assert all(len(texts) == 2 and all(texts) for texts in WORDS["texts"].values())
    page = (files("gen_profile.presentation.studio") / "assets" / "studio.html").read_text("utf-8")
    used = {text.split('"')[0] for key in ('data-text="', 'data-words="') for text in page.split(key)[1:]}
    assert used - set(WORDS["texts"]) == set()
