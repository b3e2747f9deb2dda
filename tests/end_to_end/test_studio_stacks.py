"""Stacks in the studio, dragged and moved by keys in a headless Chromium."""

import pytest
import tomlkit
from end_to_end.studios import SETTLED, studio
from generator.quay import quay
from headless import browser
from selenium.webdriver.common.keys import Keys

pytestmark = pytest.mark.slow

TOPS = "return [...document.querySelectorAll('#side .top')].map((top) => Number(top.ariaValueNow))"
FRONT = "return document.querySelector('#side .front').innerHTML"
BOX = "return document.querySelectorAll('#side .top')[2].getBoundingClientRect().toJSON()"


def test_a_stack_is_dragged_and_the_way_follows(tmp_path):
    spec = tmp_path / "quay.toml"
    spec.write_text(tomlkit.dumps(quay().to_dict()), "utf-8")
    with browser() as window, studio(spec) as running:
        window.size(1400, 1400)
        running.open(window)
        window.wait(SETTLED.format("passed"))
        before, way, box = (window.run(script) for script in (TOPS, FRONT, BOX))
        middle = (box["x"] + box["width"] / 2.0, box["y"] + box["height"] / 2.0)
        window.drag(middle, (middle[0], middle[1] + 40.0))
        window.wait("return !document.querySelector('#undo').disabled")  # the hand has let go
        after = window.run(TOPS)
        assert after[2] < before[2] - 1.0 and after[:2] + after[3:] == before[:2] + before[3:]
        window.wait(f"{FRONT} !== arguments[0]", way)
        window.wait(SETTLED.format("passed"))
        command = "return document.querySelector('#command').textContent"
        window.wait(f"{command}.includes('path.stacks.2=[25, 27.5, {after[2]:g}]')")
        window.find("#side .stack").send_keys(Keys.SHIFT, Keys.ARROW_LEFT)
        window.wait(f"{command}.includes('path.stacks.0=[19, 21.5, 10.4]')")
        window.wait(SETTLED.format("passed"))
        window.find("#undo").click()
        window.find("#undo").click()
        was = ",".join(f"{height:g}" for height in before)
        window.wait(f"{TOPS.replace('[', 'String([', 1)}) === arguments[0]", was)
        window.wait(f"{FRONT} === arguments[0] && !document.body.matches('.busy, .stale')", way)
        assert window.violations() == [] and window.complaints() == []
