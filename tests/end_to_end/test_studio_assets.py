"""Parts of the studio's page by themselves, in a headless Chromium whose own language has decimal points."""

from importlib.resources import files

import pytest
from headless import browser
from selenium.webdriver.common.keys import Keys

pytestmark = pytest.mark.slow

ASSETS = files("gen_profile.presentation.studio") / "assets"
SCRIPTS = "uPlot/uPlot.iife.min.js", "numbers.js", "curves.js"


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "page.html"
    scripts = "".join(f"<script>{(ASSETS / name).read_text('utf-8')}</script>" for name in SCRIPTS)
    grid = "display: grid; grid-template-columns: repeat(auto-fit, minmax(300px, 1fr))"
    path.write_text(
        f"<html lang='de' data-drawn='true'><meta charset='utf-8'><input type='number' step='any'>"
        f"<div id='view'><div id='host' style='{grid}'></div></div>{scripts}",
        "utf-8",
    )
    with browser() as window:
        window.open(path, width=1000)
        yield window
        assert window.complaints() == []


@pytest.mark.parametrize(
    ("typed", "value"), [("3,5", "3.5"), ("3.5", "3.5"), (",5", ".5"), ("-12,25", "-12.25"), ("35", "35")]
)
def test_a_decimal_comma_is_one(page, typed, value):
    field = page.find("input")
    field.send_keys(Keys.CONTROL, "a")
    field.send_keys(Keys.NULL, typed)
    assert field.get_attribute("value") == value  # 35 where the comma is left out


def test_a_decimal_comma_that_is_pasted_is_one(page):
    field = page.find("input")
    page.run(
        """
        const pasted = new DataTransfer();
        pasted.setData('text', '7,25');
        arguments[0].select();
        arguments[0].dispatchEvent(new ClipboardEvent('paste', {clipboardData: pasted, bubbles: true}));""",
        field,
    )
    assert field.get_attribute("value") == "7.25"


def test_charts_that_come_together_share_the_width(page):
    beside = page.run_async("""
        const curve = {name: 'one', y: [0, 1], colour: '#000', width: 1, dash: 'solid'};
        const panel = {
            title: 't', x_label: 'x', y_label: 'y', x: [0, 1], curves: [curve], levels: [], bands: []};
        const options = {phrase: (text) => text, language: 'de'};
        curves.draw(document.querySelector('#host'), [panel, panel], options);
        Promise.resolve().then(() => {
            const drawn = [...document.querySelectorAll('figure')];
            arguments[0](drawn.map((one) => [one.querySelector('canvas').clientWidth, one.clientWidth]));
        });""")
    assert all(0 < chart <= place < 600 for chart, place in beside)  # the first one lay under the second
