"""The studio in a headless Chromium: knobs turned by keys and mouse, and what is then to be seen."""

import json
import random
from pathlib import Path

import numpy as np
import pytest
from end_to_end.simulated_controllers import free_port, serving
from end_to_end.studios import SETTLED, look_at, state, studio
from headless import COLOURS
from headless import browser as start
from selenium.webdriver.common.keys import Keys
from simulated_blocks import exported, poked

from gen_profile.delivery.deployment.s7_sim import SimulatedS7Controller
from gen_profile.delivery.deployment.table import read_table
from gen_profile.dynamics.evaluation.simulation import free_swing
from gen_profile.dynamics.problem.dynamics import parameter_rows
from gen_profile.spec.reading import preset_spec, preset_text

pytestmark = pytest.mark.slow

OWN = Path(__file__).parents[2] / "examples" / "inclined_crane.py"
DURATION = 'input[type=range][aria-label="Duration"]'
DROP = """
    const files = new DataTransfer();
    files.items.add(new File([arguments[0]], 'bay.toml'));
    window.dispatchEvent(new DragEvent('drop', {dataTransfer: files, bubbles: true}))"""
SHOWN = "return document.querySelector('#facts dd').textContent"


@pytest.fixture(scope="module")
def browser():
    with start() as window:
        yield window


@pytest.fixture(scope="module")
def controller(tmp_path_factory):
    """One that runs a motion of this machine, and is watched."""
    table = read_table(exported(tmp_path_factory.mktemp("watched"), "export.plc_layout=samples"))
    simulated = SimulatedS7Controller(table, 7, free_port())
    with serving(simulated) as url:
        yield simulated, ("--watch", table.path, "--to", url, "--db", "7", "--security", "none")


@pytest.fixture(scope="module")
def page(browser, controller):
    with studio("--preset", "paper", *controller[1]) as running:
        browser.size(1400, 900)
        running.open(browser)
        browser.wait(SETTLED.format("passed"))
        yield browser
        assert browser.complaints() == []


@pytest.fixture(autouse=True)
def _at_a_desk(page):
    page.size(1400, 900)
    look_at(page, "design")


VIEWS = ("design", "compare", "drive", "measure", "take", "watch")


def test_every_view_has_a_place_in_the_address_and_fits_it(page):
    headings = """
        const shown = [...document.querySelectorAll('main h2')].filter((head) => head.checkVisibility());
        const headings = shown.map((head) => head.textContent);
        return """
    look_at(page, "watch")
    page.wait(headings + "headings[0].endsWith('.st')")
    seen = {}
    for view in VIEWS:
        look_at(page, view)
        seen[view] = page.run(headings + "headings")
        shown = page.run("return [location.hash.split('/')[0], document.title]")
        assert shown[0] == ("" if view == "design" else f"#{view}") and len(shown[1].split(" · ")) == 3
        assert page.run("return document.querySelectorAll('#places [aria-current=page]').length") == 1
    assert seen["drive"] == ["Drive it yourself"] and seen["measure"] == ["Measured on the machine"]
    assert seen["take"] == ["Take it away"] and seen["watch"] == ["The controller paper.st"]
    assert seen["design"][0] == "The machine"
    assert seen["compare"] == ["Designs", "Robustness", "Spectrum"]
    page.run("history.back()")
    page.wait("return document.body.dataset.show === 'take'")
    page.run("location.reload()")
    page.wait("return document.body.dataset?.show === 'take'")
    page.wait(SETTLED.format("passed"))


def test_a_view_is_shared_with_its_state(page):
    field = page.find('input[type=number][aria-label="Duration"]')
    field.send_keys(Keys.CONTROL, "a", Keys.NULL, "2.95\n")
    page.wait("return location.hash.length > 9")
    look_at(page, "compare")
    name, _, state = page.run("return location.hash").partition("/")
    assert name == "#compare" and state
    assert page.run("return document.querySelector('#places a[data-view=drive]').hash") == f"#drive/{state}"
    assert page.run("return document.querySelector('#places a[data-view=design]').hash") == f"#{state}"
    page.run("location.reload()")
    page.wait("return document.querySelector('#command')?.textContent.endsWith('move.duration=2.95')")
    assert page.run("return document.body.dataset.show") == "compare"
    look_at(page, "design")
    page.find('input[type=number][aria-label="Duration"]').send_keys(Keys.CONTROL, "a", Keys.NULL, "3\n")
    page.wait("return document.querySelector('#command').textContent.endsWith('move.duration=3')")
    page.wait(SETTLED.format("passed"))
    page.wait("return document.querySelectorAll('#designs tbody tr').length > 5")


def test_sliders_stop_at_round_values_and_always_move(page):
    slider, field = page.find(DURATION), page.find('input[type=number][aria-label="Duration"]')
    for key in (Keys.ARROW_RIGHT, Keys.ARROW_LEFT):
        for _ in range(4):
            before = field.get_attribute("value")
            slider.send_keys(key)
            page.wait("return arguments[0].value !== arguments[1]", field, before)
            value = float(field.get_attribute("value"))
            assert value == float(f"{value:.3g}") and (value > float(before)) == (key == Keys.ARROW_RIGHT)
    stops = page.run("""
        const mine = {least: 0, span: [-24.144, 24.144], factor: 1000};
        return [...Array(30).keys()].map((at) => knobs.scale(mine).value(at * 37) * 1000);""")
    assert all(round(stop, 6) % 100 == 0 for stop in stops)


def test_numbers_are_told_as_they_are_read(page):
    texts = page.run("""
        const speak = (language, act) => { document.documentElement.lang = language; return act(); };
        const all = () => [numbers.millimetres(7.995e-8), numbers.millimetres(1.61549), numbers.short(0.0272),
            numbers.sentence('needs 1.142 (jerk = 4.5, travel = [0.1, 2.5])'), numbers.ticks(2.76, 3.24)];
        const told = [speak('en', all), speak('de', all)];
        document.documentElement.lang = 'en';
        return told;""")
    assert texts[0] == [
        "< 0.001",
        "1.615",
        "0.0272",
        "needs 1.142 (jerk = 4.5, travel = [0.1, 2.5])",
        [2.8, 2.9, 3, 3.1, 3.2],
    ]
    assert texts[1][:4] == ["< 0,001", "1,615", "0,0272", "needs 1,142 (jerk = 4.5, travel = [0.1, 2.5])"]


def test_designs_have_names_that_lie_on_nothing_and_an_axis_with_several_places(page):
    look_at(page, "compare")
    page.wait("return document.querySelectorAll('#designs tbody tr').length > 5")
    for over in ("acceleration", "duration", "sway"):
        page.run(
            """
            const over = document.querySelector('#over');
            over.value = arguments[0];
            over.dispatchEvent(new Event('change'))""",
            over,
        )
        boxes = page.run("""
            const boxes = [...document.querySelectorAll('.point text')].map((text) => text.getBBox());
            return boxes.map(({x, y, width, height}) => [x, y + 2, x + width, y + height - 3]);""")
        assert len(boxes) >= 5
        for place, (left, top, right, bottom) in enumerate(boxes):
            for other in boxes[:place]:
                assert right <= other[0] or other[2] <= left or bottom <= other[1] or other[3] <= top
        ticks = page.run("return document.querySelectorAll('#pareto svg > text').length")
        assert ticks >= 2 + 3 + 3  # both names, and places of both axes
    badges = page.run("return [...document.querySelectorAll('.badge')].map((badge) => badge.textContent)")
    assert badges == ["least sway on the way", "least acceleration"]  # all take as long


def test_a_limit_beyond_all_designs_is_not_drawn_at_the_edge(page):
    look_at(page, "compare")
    page.wait("return document.querySelectorAll('#designs tbody tr').length > 5")
    found = page.run("""
        return [0.001, 0.004].map((residual) => {
            const own = {method: 'own', duration: 3.0, acceleration: 0.3, sway: 0.02, residual};
            designs.show(null, own, [], {limit: 0.003, phrase: (word) => word});
            return document.querySelectorAll('#pareto .limit').length;
        })""")
    assert found == [0, 1]


def test_cards_that_wait_say_so(page):
    page.run("location.reload()")
    page.wait("return document.querySelector('.waiting')?.textContent")
    assert page.run("return document.querySelectorAll('.waiting').length") == 6
    page.wait(SETTLED.format("passed"))
    page.wait("return document.querySelectorAll('#designs tbody tr').length > 5")
    look_at(page, "compare")
    left = "return [...document.querySelectorAll('.waiting')].filter((one) => one.checkVisibility()).length"
    page.wait(f"{left} === 0")


def test_on_a_phone_nothing_of_the_plan_covers_a_drive(page):
    page.size(390, 844, mobile=True)
    look_at(page, "drive")
    assert not page.run("return document.querySelector('.machine').checkVisibility()")
    assert not page.run("return document.querySelector('#panel').checkVisibility()")
    assert page.run("return document.querySelector('#drive').getBoundingClientRect().top") < 120


def test_a_knob_turned_by_a_key_is_solved_and_drawn(page):
    before = page.run(
        "return [...document.querySelectorAll('.strip polyline')].map((line) => line.outerHTML)"
    )
    assert len(before) == 3
    page.find(DURATION).send_keys(Keys.ARROW_RIGHT * 5)
    page.wait("return performance.getEntriesByName('picture').length > 0")
    page.wait("return document.querySelector('#command').textContent.includes('move.duration=3.0')")
    after = page.run("return [...document.querySelectorAll('.strip polyline')].map((line) => line.outerHTML)")
    assert all(one != other for one, other in zip(before, after, strict=True))


def test_the_end_of_the_move_is_dragged_and_undone_in_one_step(page):
    page.run("document.querySelector('#sway').scrollIntoView({block: 'center'})")
    x, y, second = page.run("""
        const over = document.querySelector('#sway .u-over'), box = over.getBoundingClientRect();
        const y = box.top + box.height / 2;
        for (let x = box.right - 1; x > box.left; x--) {
            over.dispatchEvent(new PointerEvent('pointermove', {clientX: x, clientY: y}));
            if (over.style.cursor === 'ew-resize') return [x, y, (x - box.left) / 2.9];
        }""")
    before = state(page)
    page.drag((x, y), (x - 0.5 * second, y))
    page.wait("return /move.duration=2.[3-6]/.test(document.querySelector('#command').textContent)")
    page.wait("return document.querySelector('#pill').matches('.passed, .failed')")
    page.find("#undo").click()
    page.wait(f"return document.querySelector('#command').textContent === {json.dumps(before[0])}")
    page.wait(SETTLED.format("passed"))
    assert state(page) == before


def test_designs_are_pinned_and_taken(page):
    look_at(page, "compare")
    page.wait("return document.querySelectorAll('#designs tbody tr').length > 5")
    page.find("#pin").click()
    page.wait("return document.querySelector('.point.pinned') !== null")
    page.run("""
        const rows = [...document.querySelectorAll('#designs tr')];
        rows.find((row) => row.textContent.startsWith('zvd')).querySelector('button').click()""")
    page.wait("return document.querySelector('#command').textContent.includes('solver.method=zvd')")
    page.find("#undo").click()
    page.wait("return !document.querySelector('#command').textContent.includes('zvd')")


@pytest.mark.parametrize(("width", "language"), [(1400, "de"), (820, "de"), (390, "de"), (390, "en")])
def test_nothing_is_wider_than_the_screen(page, width, language):
    page.size(width, 844, mobile=width < 500)
    if language == "de":
        page.find("#language").click()
    for view in VIEWS:
        look_at(page, view)
        page.wait(f"return document.documentElement.scrollWidth <= {width}")
    if language == "de":
        page.find("#language").click()


@pytest.mark.parametrize(("scheme", "rules"), [("light", ()), ("dark", COLOURS)])
def test_it_is_accessible(page, scheme, rules):
    """By the rules of axe-core, which look at names, roles, contrast and order."""
    page.wait("return document.querySelectorAll('#designs tbody tr').length > 5")
    page.wait("return document.querySelector('[aria-busy=true]') === null")
    with page.emulated(scheme):
        for view in VIEWS:
            look_at(page, view)
            assert page.violations(*rules) == []


def test_every_knob_leads_to_its_line_in_the_manual(page):
    found = page.run_async("""
        const links = [...document.querySelectorAll('.knob')].map((knob) => knob.querySelector('a.help'));
        const line = (shown, link) => shown.getElementById(link.hash.slice(1))?.textContent;
        fetch('help/spec').then((answer) => answer.text()).then((text) => {
            const shown = new DOMParser().parseFromString(text, 'text/html');
            arguments[0](links.map((link) => link && [link.ariaLabel, line(shown, link)]));
        });""")
    assert len(found) > 50 and all(link and link[1] for link in found)
    assert ["Help: Duration", "duration = 3.0"] in [[name, line[:14]] for name, line in found]


def test_an_axis_is_set_free_and_held_again():
    with studio("--preset", "gantry-crane") as running, start() as window:
        running.open(window)
        window.wait("return document.querySelector('.knob.several input') !== null")
        command = "document.querySelector('#command').textContent"
        for free in ("true", "false"):
            window.find(".knob.several input").click()
            window.wait(f'return {command}.includes(`move.free=["x"]`) === {free}')
        assert window.violations() == []
        assert window.complaints() == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_page_of_the_manual_is_accessible(scheme):
    with studio("--preset", "paper") as running, start() as window:
        running.open(window)
        window.visit(f"{running.address}help/spec#limits.velocity")
        with window.emulated(scheme):
            assert window.run("return document.querySelector(':target').textContent").startswith("# velocity")
            assert window.violations() == []
        assert window.complaints() == []


def test_it_is_accessible_on_a_phone(page):
    page.size(390, 844, mobile=True)
    for view in VIEWS:
        look_at(page, view)
        assert page.violations(colours=False) == []  # which are those of a desk


def test_a_log_that_is_chosen_tells_parameters_that_are_taken(page, tmp_path):
    look_at(page, "measure")
    times = np.arange(0.0, 6.0, 0.03)
    spec = preset_spec("paper")
    longer = parameter_rows(spec.machine(), [{**spec.plant.parameters, "L1": 0.52}])
    start = np.array([[0.1, 0.1, 0.0, 0.0]])
    swung = free_swing(spec.machine(), longer, q_a=[0.3], starts=start, times=times)[1][0, :, 0]
    table = np.stack(
        [times, np.degrees(swung) + np.random.default_rng(0).normal(0.0, 0.05, len(times))], axis=1
    )
    np.savetxt(tmp_path / "stop.csv", table, delimiter=",", header="time_s,hook_angle_deg", comments="")
    page.find("#file").send_keys(str(tmp_path / "stop.csv"))
    page.wait("return document.querySelector('#tells button, #tells .bad') !== null")
    assert page.violations() == []
    page.run("document.querySelector('#field').scrollIntoView({block: 'start'})")
    assert page.run("""
        const field = document.querySelector('#field');
        const at = field.querySelector('h2').getBoundingClientRect();
        return field.contains(document.elementFromPoint(at.left + 4, at.top + 4))""")  # nothing lies above it
    page.find("#tells button").click()
    page.wait("return /plant.L1=0.5[12]/.test(document.querySelector('#command').textContent)")
    assert page.run("return document.querySelectorAll('#logged canvas').length") == 3
    page.find("#language").click()
    page.find("#reading .after input").send_keys(Keys.CONTROL, "a", Keys.NULL, "0,5", Keys.TAB)
    built_anew = """
        for (const use of ['move', 'swing']) document.querySelector(`input[name=use][value=${use}]`).click();
        return document.querySelector('#reading .after input').value"""
    assert page.run(built_anew) == "0,5"
    page.find("#language").click()
    (tmp_path / "bay.toml").write_text(preset_text("paper").replace('"paper"', '"bay 9"', 1), "utf-8")
    page.find("#undo").click()
    page.find("#file").send_keys(str(tmp_path / "bay.toml"))
    page.wait("return document.querySelector('#name').textContent === 'bay 9'")
    page.find("#undo").click()
    page.wait("return document.querySelector('#name').textContent === 'paper'")
    page.find("#forget").click()


def test_a_program_runs_only_by_a_deliberate_act(page, tmp_path):
    ran = tmp_path / "ran"
    (tmp_path / "machine.py").write_text(
        f"open({str(ran)!r}, 'w').close()\n{OWN.read_text('utf-8')}", "utf-8"
    )
    own = f"plant.file = '{tmp_path}/machine.py'\nmove = {{distance = 1.0, duration = 6.0}}\n"
    opened = "return document.querySelector('#consent').open"
    for refusal in (Keys.ENTER, Keys.ESCAPE, Keys.SPACE):
        page.run(DROP, own)
        page.wait(opened)
        assert str(tmp_path) in page.find("#programs").text
        assert page.find("#refuse") == page.driver.switch_to.active_element
        assert not page.find("#agree").is_enabled()
        page.driver.switch_to.active_element.send_keys(refusal)
        page.wait("return !document.querySelector('#consent').open")
        page.wait("return document.querySelector('#answer').textContent.startsWith('Nothing was run')")
        page.wait("return document.querySelector('#pill').classList.contains('failed')")
        page.find("#undo").click()
        page.wait(SETTLED.format("passed"))
    assert not ran.exists()
    page.run(DROP, own)
    page.wait(opened)
    page.find("#trust").click()
    page.find("#agree").click()
    page.wait(
        SETTLED.format("passed") + " && document.querySelector('#command').textContent.includes('bay.toml')"
    )
    assert ran.exists()
    page.find("#undo").click()
    page.wait("return !document.querySelector('#command').textContent.includes('bay.toml')")
    page.wait(SETTLED.format("passed"))


def test_the_question_whether_a_program_may_run_is_accessible(page):
    page.run(DROP, "plant.file = '/machine.py'\nmove = {distance = 1.0, duration = 6.0}\n")
    page.wait("return document.querySelector('#consent').open")
    try:
        assert page.violations() == []
    finally:
        page.find("#refuse").click()
        page.find("#undo").click()
        page.wait(SETTLED.format("passed"))


def test_a_planner_block_is_driven_by_hand(page):
    look_at(page, "drive")
    page.find("#begin").click()
    page.wait("return document.querySelector('#undriven.bad') !== null")
    assert "limits.velocity" in page.find("#undriven").text
    page.find("#undriven button").click()  # takes limits that the motion keeps
    page.wait("return document.querySelector('#promise.passed:not([hidden])') !== null")
    page.wait("return document.querySelector('#command').textContent.includes('limits.travel=')")
    page.find("#leave").click()
    page.find("#undo").click()
    limits = "velocity = 0.5\nacceleration = 1.0\njerk = 20.0\ntravel = [-1.0, 1.0]\n"
    text = preset_text("paper").replace("cycle_time = 0.001", "cycle_time = 0.01")
    page.run(DROP, f"{text}\n[limits]\n{limits}")
    page.wait("return document.querySelector('#command').textContent.includes('bay.toml')")
    page.find("#begin").click()
    page.wait("return document.querySelector('#promise.passed:not([hidden])') !== null")
    page.run("document.querySelector('#drive .stage').scrollIntoView({block: 'center'})")
    x, y, width = page.run("""
        const box = document.querySelector('#drive svg').getBoundingClientRect();
        return [box.left + box.width / 2, box.top + box.height / 2, box.width]""")
    page.drag((x, y), (x + 0.25 * width, y))
    page.wait("return Number(document.querySelectorAll('#helm input')[1].value) > 0.3")
    page.wait("return parseFloat(document.querySelector('#driven dd').textContent) > 0.3")
    assert page.run("return document.querySelectorAll('#minute canvas').length") == 3
    low, high = page.run("return document.querySelectorAll('#driven dd')[2].textContent").split(" … ")
    assert -1.0 <= float(low) <= float(high.removesuffix(" m")) <= 1.0
    assert page.run("return document.querySelector('#drive .envelope').getAttribute('d')").startswith("M")
    look_at(page, "design")  # meanwhile time stands still
    look_at(page, "drive")
    try:
        assert page.violations() == []
    finally:
        page.find("#halt").click()
        page.wait("return document.querySelectorAll('#driven dd')[1].textContent.startsWith('0.000')")
        page.find("#leave").click()
        page.find("#undo").click()
        page.wait("return !document.querySelector('#command').textContent.includes('bay.toml')")


def test_a_controller_is_watched_and_what_is_not_as_proved_is_told(page, controller):
    stands = "return [...document.querySelectorAll('#stands dd')].map((one) => one.textContent)"
    look_at(page, "watch")
    page.wait("return document.querySelector('#proved.passed') !== null")
    assert page.run(stands)[0] == "idle"
    controller[0].memory[0] = 1
    page.wait("return document.querySelector('#stands dd').textContent === 'arrived'")
    assert page.run(stands) == ["arrived", "1", "3.00 / 3.00 s", "1.00", "0.3 m", "0 m/s", "0 m/s²"]
    assert page.run("return document.querySelectorAll('#course canvas').length") == 2
    poked(controller[0].block, read_table(controller[1][1]).values, random.Random(3))
    page.wait("return document.querySelector('#proved.failed') !== null")
    page.find("#language").click()
    page.wait("return document.querySelector('#proved').textContent === 'Nicht wie bewiesen'")
    shown = [page.run(stands)[0], page.find("#unproved").text]
    page.find("#language").click()
    assert shown[0] == "angekommen" and shown[1].startswith("Die Steuerung findet die Prüfsumme")


def test_it_speaks_german_of_what_is_shown(page):
    page.find('input[type=number][aria-label="Duration"]').send_keys(Keys.CONTROL, "a", Keys.NULL, "3.1\n")
    page.wait("return document.querySelector('#command').textContent.endsWith('move.duration=3.1')")
    page.find("#language").click()
    page.wait("return document.documentElement.lang === 'de'")
    words = page.find("#panel").text
    assert "Dauer" in words and "Duration" not in words
    boxes = page.run("return [...document.querySelectorAll('#formats input')].map((box) => box.value)")
    assert len(boxes) == len(set(boxes))
    page.find('input[inputmode=decimal][aria-label="Weg"]').send_keys(Keys.CONTROL, "a", Keys.NULL, "0.2\n")
    page.wait("return document.querySelector('#command').textContent.includes('move.distance=')")
    assert "move.duration=3.1" in state(page)[0]
    page.find("#undo").click()
    page.find("#undo").click()
    page.find("#language").click()


def test_what_cannot_be_offers_its_cure_as_a_button(page):
    page.run("document.querySelector('[data-group=limits]').open = true")
    box = page.find('[data-group=limits] .knob input[type="checkbox"]')
    box.click()  # takes what the motion needs now, and a little more
    field = page.find('[data-group=limits] input[type=number][aria-label="Velocity"]')
    page.wait("return Number(document.querySelector('[data-group=limits] input[type=number]').value) > 0.1")
    field.send_keys(Keys.CONTROL, "a", Keys.NULL, "0.05\n")
    page.wait(SETTLED.format("failed"))
    page.wait("return document.querySelector('#cures button') !== null")
    faded = "['#margins', '#designs'].map((part) => getComputedStyle(document.querySelector(part)).opacity)"
    assert page.run(f"return {faded}") == ["0.35", "0.35"]
    page.find("#cures button").click()
    page.wait(SETTLED.format("passed"))
    page.wait(f"return {faded}.join() === '1,1'")  # the designs after their next comparison
    assert page.run("return document.querySelectorAll('#reasons li').length") == 0
