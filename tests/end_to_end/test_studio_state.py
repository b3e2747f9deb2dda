"""What the studio shows belongs to the values of its fields: verdict, files, command line, the fields."""

import io
import json
import shlex
import subprocess
import zipfile
from pathlib import Path

import pytest
from command_line import PROGRAM
from end_to_end.studios import SETTLED, look_at, state, studio
from headless import browser
from selenium.webdriver.common.keys import Keys

pytestmark = pytest.mark.slow

DURATION = 'input[type=range][aria-label="Duration"]'


@pytest.fixture(scope="module")
def page():
    with browser() as window, studio("--preset", "paper") as running:
        window.size(1400, 900)
        running.open(window)
        window.wait(SETTLED.format("passed"))
        yield window
        assert window.complaints() == []


@pytest.fixture(autouse=True)
def _at_a_desk(page):
    page.size(1400, 900)
    look_at(page, "design")


def duration(page, typed):
    """Type a duration, and wait until it is answered."""
    page.find('input[type=number][aria-label="Duration"]').send_keys(
        Keys.CONTROL, "a", Keys.NULL, f"{typed}\n"
    )
    page.wait(f"return document.querySelector('#command').textContent.endsWith('move.duration={typed}')")
    page.wait(SETTLED.format("passed"))


def test_files_of_another_design_are_withdrawn(page):
    outcome = "return document.querySelector('#outcome')"
    look_at(page, "take")
    before = state(page)
    page.find("#make").click()
    page.wait(f"{outcome}.querySelector('a, .bad') !== null")
    made = page.run(f"{outcome}.innerHTML")
    assert "Passed" in made
    duration(page, 3.05)
    assert page.run(f"{outcome}.querySelector('a, .good')") is None
    assert page.find("#outcome").text.startswith("The design or the formats have changed")
    page.find("#language").click()
    assert page.find("#outcome").text.startswith("Der Entwurf oder die Formate")
    page.find("#language").click()
    page.find("#undo").click()
    page.wait(f"return document.querySelector('#command').textContent === {json.dumps(before[0])}")
    assert page.run(f"{outcome}.innerHTML") == made  # it is of this state again
    page.find("#formats input[value=plc]").click()
    assert page.run(f"{outcome}.querySelector('a, .good')") is None
    page.find("#formats input[value=plc]").click()
    page.find("#make").click()
    page.wait(f"{outcome}.querySelector('progress') !== null")
    duration(page, 3.06)  # what is being made is not heard of any more
    assert page.run(f"{outcome}.querySelector('a, .good, progress')") is None
    assert not page.find("#stop").is_displayed()
    page.find("#make").click()
    page.wait(f"{outcome}.querySelector('a, .bad') !== null")
    link = page.find("#outcome a").get_attribute("href")
    manifest = page.run_async(
        """
        const [link, done] = arguments;
        fetch(link).then((answer) => answer.bytes()).then((bytes) => done([...bytes]))""",
        link,
    )
    with zipfile.ZipFile(io.BytesIO(bytes(manifest))) as archive:
        assert json.loads(archive.read("manifest.json"))["spec"]["move"]["duration"] == 3.06
    page.find("#undo").click()
    page.wait(f"return document.querySelector('#command').textContent === {json.dumps(before[0])}")
    page.wait(SETTLED.format("passed"))


def test_no_command_line_stands_beside_a_value_that_does_not_fit(page):
    look_at(page, "take")
    before = state(page)
    page.find('input[type=number][aria-label="Duration"]').send_keys(Keys.CONTROL, "a", Keys.NULL, "-1\n")
    page.wait(SETTLED.format("failed"))
    assert page.find("#command").text == ""
    assert not any(page.find(button).is_enabled() for button in ("#copy", "#spec", "#pin"))
    page.find("#undo").click()
    page.wait(f"return document.querySelector('#command').textContent === {json.dumps(before[0])}")
    page.wait(SETTLED.format("passed"))
    assert all(page.find(button).is_enabled() for button in ("#copy", "#spec", "#pin"))


def test_a_field_shows_the_value_of_its_slider_after_undo_in_it(page):
    field, slider = page.find('input[type=number][aria-label="Duration"]'), page.find(DURATION)
    before = state(page)
    duration(page, 2.95)
    field.send_keys(Keys.CONTROL, "z")
    page.wait(f"return document.querySelector('#command').textContent === {json.dumps(before[0])}")
    page.wait("return arguments[0].value === '3'", field)
    assert slider.get_attribute("aria-valuetext") == "3 s"
    field.send_keys(Keys.CONTROL, "a", Keys.NULL, Keys.BACKSPACE, Keys.ENTER)
    assert field.get_attribute("value") == "3"  # the one that is judged
    assert state(page) == before
    page.wait(SETTLED.format("passed"))


def test_fields_have_a_decimal_comma_in_german(page):
    before = state(page)
    duration(page, 2.95)
    page.find("#language").click()
    try:
        field = page.find('input[inputmode=decimal][aria-label="Dauer"]')
        assert field.get_attribute("value") == "2,95"
        field.send_keys(Keys.CONTROL, "a", Keys.NULL, "2,9\n")
        page.wait("return document.querySelector('#command').textContent.endsWith('move.duration=2.9')")
        page.wait("return arguments[0].value === '2,9'", field)
    finally:
        page.find("#language").click()
    for _ in range(2):
        page.find("#undo").click()
    page.wait(f"return document.querySelector('#command').textContent === {json.dumps(before[0])}")
    page.wait(SETTLED.format("passed"))


def test_no_figure_is_torn_on_paper(page):
    page.size(695, 1016)  # of A4 within its margins
    for view in ("design", "compare"):
        look_at(page, view)
        with page.on_paper():
            torn = page.run("""
                const seen = [...document.querySelectorAll('#view figure, #view .actor, #view tr')];
                return seen.filter((one) => getComputedStyle(one).breakInside !== 'avoid').length;""")
            wide = page.run("return document.documentElement.scrollWidth")
            places = page.run("""
                return ['.bar', '.verdict', '.machine'].map(
                    (one) => getComputedStyle(document.querySelector(one)).position);""")
            assert torn == 0 and wide <= 695 and set(places) == {"static"}
            assert not page.find("#panel").is_displayed()


def test_undo_redo_and_the_address_bring_a_state_back(page):
    page.find('input[type=number][aria-label="Duration"]').send_keys(Keys.CONTROL, "a", Keys.NULL, "2.9\n")
    page.wait("return document.querySelector('#command').textContent.endsWith('move.duration=2.9')")
    changed = state(page)
    page.find("#undo").click()
    page.wait("return !document.querySelector('#command').textContent.endsWith('move.duration=2.9')")
    page.find("#redo").click()
    page.wait("return document.querySelector('#command').textContent.endsWith('move.duration=2.9')")
    assert state(page) == changed
    page.run("location.reload()")
    page.wait("return document.querySelector('#command')?.textContent.endsWith('move.duration=2.9')")
    page.wait(SETTLED.format("passed"))
    assert state(page) == changed


def test_the_full_check_gives_the_files_that_the_command_line_makes(page, tmp_path):
    look_at(page, "take")
    page.run("document.querySelector('#formats').scrollIntoView()")
    page.find("#formats input[value=plc]").click()
    page.find("#make").click()
    page.wait("return document.querySelector('#outcome a, #outcome .bad') !== null")
    link = page.find("#outcome a").get_attribute("href")
    content = page.run_async(
        """
        const [link, done] = arguments;
        fetch(link).then((answer) => answer.bytes()).then((bytes) => done([...bytes]))""",
        link,
    )
    command = shlex.split(page.find("#command").text)
    subprocess.run([PROGRAM, *command[1:], "--out", tmp_path / "same"], check=True, capture_output=True)
    with zipfile.ZipFile(io.BytesIO(bytes(content))) as archive:
        made = {name: archive.read(name) for name in archive.namelist()}
    assert made == {path.name: path.read_bytes() for path in (tmp_path / "same").iterdir()}
    assert {Path(name).suffix for name in made} == {".csv", ".st", ".json"}
    page.find("#formats input[value=plc]").click()
    assert "--export" not in page.find("#command").text
