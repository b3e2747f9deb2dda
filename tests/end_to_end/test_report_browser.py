"""The report in a headless Chromium: what a reader sees of it, and what strangers' texts cannot do in it."""

import csv
import io
import re

import numpy as np
import pytest
from command_line import run_here
from headless import COLOURS
from headless import browser as start

from gen_profile.presentation.charts.figure import INK, Bars, Figure, Line, Map, Panel, Style
from gen_profile.presentation.report.content import (
    Listing,
    Page,
    Section,
    Share,
    Table,
    TableRow,
    Terms,
    Verdict,
)
from gen_profile.presentation.report.page import render
from gen_profile.spec.reading import preset_spec, presets

pytestmark = pytest.mark.slow

DRAWN = "path.js-line[d], .barlayer .point path"
CURVES = f"""
    return [...document.querySelectorAll('.plot')].map((plot) => plot.querySelectorAll('{DRAWN}').length)"""
TITLES = "return [...document.querySelectorAll('.panel h3')].map((title) => title.textContent)"
LOADS = """
    return [...document.querySelectorAll('.actor svg')].map(
        (svg) => [...svg.children].map((shape) => shape.outerHTML).join())"""
SEEK = """
    const slider = document.querySelector('.time');
    slider.value = arguments[0] * slider.max;
    slider.dispatchEvent(new Event('input'));"""


@pytest.fixture(scope="module")
def browser():
    with start() as window:
        yield window


@pytest.fixture(autouse=True)
def _content(browser):
    """Whatever a test does, nothing in the page fails."""
    yield
    assert browser.complaints() == []


@pytest.fixture(scope="module")
def paper(tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "paper.html"
    assert run_here("report", "--preset", "paper", "--out", path).code == 0
    return path


@pytest.fixture(scope="module")
def brief(tmp_path_factory):
    """The same without other methods, which take seconds to draw."""
    path = tmp_path_factory.mktemp("report") / "brief.html"
    assert run_here("report", "--preset", "paper", "--no-compare", "--out", path).code == 0
    return path


@pytest.fixture
def shown(browser, paper):
    """The page as it was loaded, for tests that change nothing in it: to draw it takes seconds."""
    if not browser.run("return window.untouched === true"):
        browser.open(paper)
        browser.run("window.untouched = true")
    return browser


def curves(browser, panel):
    """What a panel's curves show, by name: x and y as Plotly holds them."""
    found = browser.run(
        """
        const titles = [...document.querySelectorAll('.panel h3')].map((title) => title.textContent);
        const plot = document.querySelectorAll('.plot')[titles.indexOf(arguments[0])];
        return plot.calcdata.map((points) => [points[0].trace.meta, points.map((p) => [p.x, p.y])]);""",
        panel,
    )
    return {name: np.array(points).T for name, points in found}


def test_it_draws_everything_and_complains_of_nothing(shown):
    drawn = shown.run(CURVES)
    assert len(drawn) >= 14 and min(drawn) >= 1
    assert shown.run(TITLES).count("Jerk of cart") == 2  # of the design, and of all methods


def test_the_verdict_comes_first(shown):
    words = shown.find("header").text.splitlines()
    assert words[0] == "paper"
    assert words[2].startswith("PASSED. After the move the hook sways by 2.193 mm at most (L1 −20 %)")


def test_bars_of_one_column_can_be_compared(shown):
    ends = shown.run("""
        return [...document.querySelectorAll('table')].map((table) => [...table.querySelectorAll('.bar')]
            .map((bar) => Math.round(bar.getBoundingClientRect().left)));""")
    assert {len(set(column)) for column in ends if len(column) > 1} == {1}


def test_it_shows_the_paper_s_figures_2_to_5(shown):
    """Their four methods in each; peaks as in the paper's tables 1 and 2 (docs/paper.md)."""
    four = {"nzv", "zvd", "optimal-beta0", "optimal-beta50"}
    second = ("Velocity of cart", "Acceleration of cart")
    third, fourth, fifth = (
        "Spectrum of the acceleration of cart",
        "Sway of the payload, nominal",
        "Sway of the payload, L1 +20\N{NO-BREAK SPACE}%",
    )
    left_out = fifth.replace("+", "−")
    visible = shown.run(
        """
        return Object.fromEntries([...document.querySelectorAll('.panel')].slice(-10).map((panel) => [
            panel.querySelector('h3').textContent,
            panel.querySelector('.plot').data.filter((curve) => curve.visible).map((curve) => curve.meta),
        ]))"""
    )
    assert all(four <= set(visible[title]) for title in (*second, third, fourth, fifth))
    nominal, perturbed, shorter = curves(shown, fourth), curves(shown, fifth), curves(shown, left_out)
    transient = {"nzv": 27.22, "zvd": 28.78, "optimal-beta0": 29.41, "optimal-beta50": 19.36}
    residual = {"nzv": 8.743, "zvd": 1.629, "optimal-beta0": 1.774, "optimal-beta50": 1.463}
    other_sign = {"nzv": 6.976, "zvd": 1.882, "optimal-beta0": 2.155, "optimal-beta50": 1.954}
    for method in four:
        time, sway = nominal[method]
        assert np.abs(sway).max() == pytest.approx(transient[method], rel=2e-3)
        assert np.abs(sway[time > 3.0]).max() < 0.02
        for curve, peaks in ((perturbed, residual), (shorter, other_sign)):
            time, sway = curve[method]
            assert np.abs(sway[time > 3.0]).max() == pytest.approx(peaks[method], rel=0.02)


def test_no_axis_counts_in_prefixes_beside_its_unit(shown):
    """“20n” of a share, or “6µ” in metres, is no figure of a plot's label."""
    every = "[...document.querySelectorAll('.plot:not(:has(.barlayer .trace)) .ytick text')]"
    ticks = shown.run(f"return {every}.map((tick) => tick.textContent)")
    assert any("×10" in tick for tick in ticks)  # the Hamiltonian's
    assert [tick for tick in ticks if re.search("[a-zA-Zµμ]", tick)] == []


@pytest.mark.parametrize(
    ("width", "scheme", "rules"), [(1280, "light", ()), (1280, "dark", COLOURS), (390, "light", ())]
)
def test_it_is_accessible(browser, paper, width, scheme, rules):
    """By the rules of axe-core; all that is folded is open, and curves are hidden by their buttons."""
    with browser.emulated(scheme):
        browser.open(paper, width=width, mobile=width < 500)
        assert browser.violations(*rules) == []
        browser.visit("about:blank")  # or all would be drawn again in the other colours


def test_the_animation_plays_in_real_time(browser, brief):
    browser.open(brief)
    before = browser.run(LOADS)
    browser.find(".play").click()
    clock = np.array(
        browser.run_async(
            """
            const [done] = arguments, slider = document.querySelector('.time'), seen = [];
            const look = (now) => {
                seen.push([now / 1000, Number(slider.value)]);
                if (seen.length < 30) requestAnimationFrame(look); else done(seen);
            };
            requestAnimationFrame(look);"""
        )
    )
    steps = np.diff(clock, axis=0)
    assert (steps[:, 1] > 0.0).all()
    np.testing.assert_allclose(steps[1:, 1].sum(), steps[1:, 0].sum(), rtol=1e-2)
    after = browser.run(LOADS)
    assert len(after) == 3 and all(one != other for one, other in zip(before, after, strict=True))
    browser.find(".play").click()
    still = browser.run("return document.querySelector('.time').value")
    browser.run_async("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")
    assert browser.run("return document.querySelector('.time').value") == still


def test_the_slider_sets_the_time_and_larger_sway_is_drawn_larger(browser, brief):
    """The nominal load leaves the plumb line by its sway, on the scale of the way that its trolley goes."""
    browser.open(brief)

    def places():
        return browser.run(
            """
            const svg = document.querySelector('.actor svg');
            const middle = (rect) => ['x', 'width'].map((key) => Number(rect.getAttribute(key)));
            return [...svg.querySelectorAll('rect')].map(middle).map(([x, width]) => x + width / 2);"""
        )

    browser.run(SEEK, 0.0)
    start, hanging = places()
    assert hanging == pytest.approx(start, abs=0.5)
    browser.run(SEEK, 1.0)
    end, hanging = places()
    assert hanging == pytest.approx(end, abs=0.5)
    assert "arrived" in browser.find(".clock").text
    browser.run(SEEK, 0.1)  # 0.7 s
    swing = float(re.search(r"\+([0-9.]+) mm", browser.find(".actor h3 span").text)[1])
    assert swing == pytest.approx(19.35, abs=0.05)
    scale = (end - start) / 300.0
    trolley, load = places()
    assert trolley - load == pytest.approx(scale * swing, rel=0.05)
    browser.run(
        "const s = document.querySelector('.scale'); s.value = '5'; s.dispatchEvent(new Event('change'))"
    )
    trolley, load = places()
    assert trolley - load == pytest.approx(5.0 * scale * swing, rel=0.05)


def test_panels_zoom_together_and_a_legend_hides_a_curve_everywhere(browser, paper):
    browser.open(paper)
    browser.run_async(
        "Plotly.relayout(document.querySelector('.plot'), {'xaxis.range': [1, 2]}).then(() => arguments[0]())"
    )
    browser.wait(
        """
        const ranges = [...document.querySelectorAll('figure')[0].querySelectorAll('.plot')].map(
            (plot) => plot._fullLayout.xaxis.range);
        return ranges.length === 4 && ranges.every(([low, high]) => low === 1 && high === 2)"""
    )
    before = browser.run(CURVES)
    browser.run("document.querySelectorAll('figure')[2].querySelectorAll('.legend button')[1].click()")
    browser.wait(
        "return document.querySelectorAll('figure')[2].querySelectorAll('.plot')[1]"
        f".querySelectorAll('{DRAWN}').length === 2"
    )
    after = browser.run(CURVES)
    assert [old - new for old, new in zip(before, after, strict=True) if old != new] == [1, 1]


def test_two_uncertain_parameters_have_a_map(browser, tmp_path):
    """Every place on it is the share that the same machine takes of its limit, where it is checked alone."""
    ranges = "robustness.uncertain={L1=0.2, m2=0.1}"
    page = tmp_path / "page.html"
    paper = ("--preset", "paper")
    assert run_here("report", *paper, "--set", ranges, "--no-compare", "--out", page).code in {0, 4}
    both = ("--parameter", "m2", "--parameter", "L1", "--method", "optimal-beta50")
    found = run_here("robustness", *paper, "--set", ranges, *both, "--json").document
    (method,) = found["methods"]
    shares = np.array(
        [np.array(peaks) / found["limits_m"][load] for load, peaks in method["residual_peaks_m"].items()]
    ).max(axis=0)
    for width, mobile in ((1280, False), (390, True)):
        browser.open(page, width=width, mobile=mobile)
        assert browser.run("return document.documentElement.scrollWidth") == width
        assert browser.run(TITLES).count("optimal-beta50 over m2 and L1") == 1
        drawn = browser.run(
            """
            const plot = [...document.querySelectorAll('.plot')].find((p) => p.querySelector('.contourfill'));
            const [colours, limit] = plot.data;
            return [colours.x, colours.y, colours.z, plot.querySelectorAll('.contourfill path').length,
                    limit.contours.start, plot.querySelectorAll('.contourlevel path').length]"""
        )
        x, y = (100.0 * np.array(found["errors"][name]) for name in ("m2", "L1"))
        np.testing.assert_allclose(drawn[0], x, atol=1e-3)
        np.testing.assert_allclose(drawn[1], y, atol=1e-3)
        np.testing.assert_allclose(np.array(drawn[2]).T, 100.0 * shares, rtol=1e-3, atol=1e-2)
        assert drawn[3] > 5 and drawn[4] == 100.0 and drawn[5] >= 1


def test_on_a_phone_nothing_is_wider_than_the_screen(browser, paper):
    browser.open(paper, width=360, mobile=True)
    assert browser.run("return document.documentElement.scrollWidth") == 360
    assert (
        browser.run("return Math.max(...[...document.querySelectorAll('.plot')].map((p) => p.offsetWidth))")
        <= 360
    )
    assert (
        browser.run("return document.querySelector('.plot')._fullLayout.dragmode") is False
    )  # a finger scrolls


def test_on_a_phone_every_cell_of_a_table_is_on_the_screen(browser, paper):
    browser.open(paper, width=390, mobile=True)
    cut = """
        return [...document.querySelectorAll('td')].filter((cell) => cell.textContent).filter((cell) => {
            const box = cell.getBoundingClientRect();
            return box.left < 0 || box.right > 390 || cell.scrollWidth > cell.clientWidth + 1;
        }).map((cell) => cell.textContent)"""
    assert browser.run(cut) == []


def test_in_the_dark_words_and_curves_stand_out_and_paper_stays_white(browser, brief):
    def shades():
        return browser.run(
            """
            const plot = document.querySelector('.plot')._fullLayout;
            return [getComputedStyle(document.body).backgroundColor, plot.paper_bgcolor, plot.font.color]"""
        )

    dark = ["rgb(20, 25, 30)", "#14191e", "#e3e8ed"]
    with browser.emulated("dark"):
        browser.open(brief)
        assert shades() == dark
        browser.run("dispatchEvent(new Event('beforeprint'))")
        browser.wait("return document.querySelector('.plot')._fullLayout.paper_bgcolor === '#fff'")
        assert browser.run("return [...document.querySelectorAll('details')].every((part) => part.open)")
        browser.run("dispatchEvent(new Event('afterprint'))")
        browser.wait("return document.querySelector('.plot')._fullLayout.paper_bgcolor === '#14191e'")
    browser.wait("return document.querySelector('.plot')._fullLayout.paper_bgcolor === '#fff'")


def test_on_paper_plots_fit_their_places_and_on_screen_again_afterwards(browser, paper):
    browser.open(paper)
    fits = """
        return [...document.querySelectorAll('.plot')].every((plot) => {
            const svg = plot.querySelector('.main-svg').getBoundingClientRect();
            const box = plot.getBoundingClientRect();
            return Math.abs(svg.width - box.width) < 2 && Math.abs(svg.height - box.height) < 2;
        })"""
    browser.run("dispatchEvent(new Event('beforeprint'))")
    with browser.on_paper():
        browser.wait(fits)
        assert browser.run("return document.querySelector('.plot').offsetWidth") == pytest.approx(340, abs=2)
        assert browser.run("return getComputedStyle(document.querySelector('nav')).display") == "none"
    browser.run("dispatchEvent(new Event('afterprint'))")
    browser.wait(fits)
    pdf = browser.pdf()
    assert pdf.startswith(b"%PDF") and pdf.count(b"/Type /Page\n") >= 4


@pytest.mark.parametrize(
    "preset", sorted({preset_spec(name).plant.type: name for name in presets()}.values())
)
def test_every_machine_moves_on_a_phone_too(browser, tmp_path, preset):
    page = tmp_path / "report.html"
    assert run_here("report", "--preset", preset, "--no-compare", "--out", page).code == 0
    browser.open(page, width=390, mobile=True)
    assert min(browser.run(CURVES)) >= 1
    assert browser.run("return document.documentElement.scrollWidth") == 390
    browser.run(SEEK, 0.0)
    before = browser.run(LOADS)
    browser.run(SEEK, 0.15)
    assert all(one != other for one, other in zip(before, browser.run(LOADS), strict=True))
    assert "NaN" not in "".join(browser.run(LOADS))


HOSTILE = (
    "<script>window.bitten=1</script>",
    "</script><script>window.bitten=2</script>",
    "<img src=x onerror=window.bitten=3>",
    '"><svg onload=window.bitten=4>',
    "<!--<script>",
    "]]></style><style>body{display:none}",
    '<a href="javascript:window.bitten=5" style="position:fixed;inset:0">click</a>',
    "{{ 7 * 7 }}{% raw %}\u2028\u2029\x00",
)
TICKS = ".xaxislayer-above, .gridlayer, .ticks"  # as many as there is room for beside names of bars
TAGS = f"""
    const elements = [...document.querySelectorAll('*')].filter((element) => !element.closest('{TICKS}'));
    return elements.map((element) => element.tagName).join(' ')"""


def section(text):
    """Every kind of block, with a text in every place that there is."""
    lines = [Line(name=name, x=np.arange(3.0), y=np.arange(3.0)) for name in (text, f"{text} again")]
    panel = Panel(title=text, x_label=text, y_label=text, lines=lines)
    grid = {"x": np.arange(3.0), "y": np.arange(3.0), "values": np.eye(3), "limit": 0.5, "frame": (1.0, 1.0)}
    coloured = Map(title=text, x_label=text, y_label=text, unit=text, **grid)
    rows = {"values": np.ones(2), "names": (text, f"{text} again"), "texts": (text, text), "limit": 1.0}
    bars = Bars(title=text, x_label=text, styles=(Style(colour=INK),) * 2, **rows)
    blocks = [
        Terms(rows=[(text, text)]),
        Table(head=(text, text), rows=[TableRow(cells=(text, Share(0.5)), mark="own")], code=True),
        Figure(caption=text, panels=[panel, coloured, bars]),
        Listing(title=text, text=text),
    ]
    return Section(title=text, words=(text,), blocks=blocks)


def page(texts):
    every = " ".join(texts)
    return Page(
        title=every,
        subtitle=every,
        verdicts=[Verdict(word=text, passed=None, sentences=(text, text)) for text in texts],
        facts=[(text, text) for text in texts],
        sections=[section(text) for text in texts],
        colophon=every,
    )


def test_a_hostile_text_is_a_text_wherever_it_stands(browser, tmp_path):
    tags = []
    for name, texts in (("plain", ["harmless"] * len(HOSTILE)), ("hostile", HOSTILE)):
        (tmp_path / f"{name}.html").write_bytes(render(page(texts)))
        browser.open(tmp_path / f"{name}.html")
        tags.append(browser.run(TAGS))
    assert tags[0] == tags[1]
    assert browser.run("return window.bitten === undefined")
    listed = browser.run("return [...document.querySelectorAll('pre')].map((text) => text.textContent)")
    assert listed == [text.replace("\x00", "") for text in HOSTILE]
    assert not browser.run(
        "return [...document.querySelectorAll('a')].some((link) => link.protocol === 'javascript:')"
    )


def test_even_what_escapes_its_place_is_not_run(browser, tmp_path):
    """The policy in the page's head refuses what the page did not bring itself."""
    content = render(page(["harmless"])).replace(
        b"<main>", b"<main><script>window.bitten=1</script><img src=x onerror=window.bitten=2>"
    )
    (tmp_path / "broken.html").write_bytes(content)
    browser.open(tmp_path / "broken.html")
    assert any("Content Security Policy" in complaint for complaint in browser.complaints())
    assert browser.run("return window.bitten === undefined")


def test_a_hostile_log_and_a_hostile_machine_are_inert(browser, tmp_path, request):
    """A column's name, the log's own name, and the words of a machine's file."""
    machine = (request.config.rootpath / "examples/inclined_crane.py").read_text("utf-8")
    bite = "<img src=x onerror=window.bitten=1>"
    (tmp_path / "evil.py").write_text(machine.replace("a load below a trolley", f"{bite}</script>"), "utf-8")
    (tmp_path / "evil.toml").write_text(
        '[plant]\nfile = "evil.py"\n[move]\ndistance = 1.0\nduration = 6.0\n', "utf-8"
    )
    log = io.StringIO()
    table = csv.writer(log)
    table.writerow(["time_s", "position_m", bite, "</script><script>window.bitten=2</script>"])
    table.writerows([0.05 * k, min(k / 120.0, 1.0), 1, 2] for k in range(200))
    name = "<img src=x onerror=window.bitten=3>.csv"
    (tmp_path / name).write_text(log.getvalue(), "utf-8")
    words = ("report", tmp_path / "evil.toml", "--measured", tmp_path / name, "--out", tmp_path / "page.html")
    assert run_here(*words, "--no-compare").code == 0
    browser.open(tmp_path / "page.html")
    assert browser.run("return window.bitten === undefined && document.querySelector('img') === null")
    text = browser.find("body").text
    assert bite in text and name in text
