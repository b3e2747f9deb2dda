"""The manual in the studio: every knob has its line there, and no link leads nowhere."""

from collections import Counter
from functools import cache

import pytest
from lxml import html

from gen_profile.presentation.studio import manual
from gen_profile.presentation.studio.knobs import knobs
from gen_profile.presentation.studio.state import preset_start
from gen_profile.spec.reading import preset_spec, presets


@cache
def shown_as(name):
    return html.document_fromstring(manual.page(name))


@pytest.mark.parametrize("preset", presets())
def test_every_knob_has_its_own_line(preset):
    spec = preset_spec(preset)
    lines = shown_as("spec").xpath("//pre//*[@id]")
    ids = {line.get("id"): line.text_content() for line in lines}
    listed = knobs(spec, preset_start(preset).document, spec)
    assert len(listed) > 50
    for knob in listed:
        page, _, anchor = manual.help_on(knob.words).partition("#")
        assert (page, anchor) == ("help/spec", knob.words)
        assert anchor.rpartition(".")[2] in ids[anchor]


def test_a_key_without_a_line_leads_to_its_table():
    assert manual.help_on("can.no_such_key") == "help/spec#can"
    assert manual.help_on("nothing.at.all") == "help/spec"


@pytest.mark.parametrize("name", manual.pages())
def test_links_lead_somewhere_and_nothing_is_of_elsewhere(name):
    shown = shown_as(name)
    for link in shown.xpath("//main//a/@href"):
        page, _, anchor = link.partition("#")
        assert not anchor or shown_as(page or name).get_element_by_id(anchor) is not None, link
    for picture in shown.xpath("//img/@src"):
        assert manual.picture(picture.removesuffix(".png")).startswith(b"\x89PNG")
    assert not shown.xpath("//script | //style | //@style")
    assert [one for one, many in Counter(shown.xpath("//@id")).items() if many > 1] == []
    assert shown.xpath("count(//h1)") == 1


def test_what_is_no_page():
    for name in ("nothing", "../README", "..", "", "/etc/passwd"):
        assert manual.page(name) is None
        assert manual.picture(name) is None
