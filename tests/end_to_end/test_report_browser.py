"""The report in a headless Chromium."""

import pytest
from command_line import run_here
from headless import browser as start


@pytest.fixture(scope="module")
def browser():
    with start() as window:
        yield window


@pytest.fixture(scope="module")
def paper(tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "paper.html"
    assert run_here("report", "--preset", "paper", "--out", path).code == 0
    return path


def test_it_draws_everything_and_complains_of_nothing(browser, paper):
    browser.open(paper)
    assert browser.complaints() == []
    panels = browser.run("return document.querySelectorAll('.plot').length")
    curves = browser.run("""
        return [...document.querySelectorAll('.plot')].map(
            (plot) => plot.querySelectorAll('.scatterlayer path.js-line[d]').length)""")
    assert len(curves) == panels >= 14 and min(curves) >= 1
