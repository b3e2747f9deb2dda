"""The picture of a comparison."""

import subprocess
import sys
from itertools import combinations
from xml.etree import ElementTree

import numpy as np
import pytest
from command_line import run_here
from matplotlib import image
from matplotlib.backends.backend_agg import FigureCanvasAgg
from pictures import colours

import gen_profile as gp
from gen_profile.dynamics.evaluation.phrases import number
from gen_profile.methods.shapers.impulses import SHAPERS
from gen_profile.presentation.charts.comparison import comparison_figure
from gen_profile.presentation.charts.curves import motion_figure, spectrum_figure
from gen_profile.presentation.charts.figure import LIMIT, Figure, Line, Panel
from gen_profile.presentation.charts.method_styles import method_styles
from gen_profile.presentation.charts.picture import drawn as draw_side_by_side
from gen_profile.presentation.charts.picture import save
from gen_profile.presentation.charts.plotly_json import figure_json
from gen_profile.spec.reading import preset_spec
from gen_profile.studies.comparison.compare import Comparison, compare
from gen_profile.support.errors import OutputError

pytestmark = pytest.mark.slow

FEW = ("--set", "cost.sway_weight=0", "--set", "robustness={}")


@pytest.fixture(scope="module", params=["paper", "flexible-joint"])
def comparison(request):
    return compare(preset_spec(request.param))


@pytest.fixture(scope="module")
def plain():
    """A comparison of few methods that are solved at once."""
    return compare(preset_spec("paper", FEW[1::2]))


@pytest.mark.parametrize("comparison", ["paper"], indirect=True)
def test_a_bitmap_shows_lines_of_many_colours(comparison, tmp_path):
    gp.plot(comparison, tmp_path / "picture.png")
    pixels = image.imread(tmp_path / "picture.png")
    height, width, _ = pixels.shape
    assert height > 800 and width > 800
    found, counts = colours(tmp_path / "picture.png")
    vivid = (np.ptp(found[:, :3], axis=1) > 80) & (counts > 100)
    assert vivid.sum() >= 5  # one colour per method
    rows_with_ink = (pixels[..., :3].min(axis=2) < 0.9).any(axis=1)
    assert rows_with_ink.mean() > 0.8


@pytest.mark.parametrize("comparison", ["flexible-joint"], indirect=True)
def test_a_vector_picture_is_well_formed_and_names_what_it_shows(comparison, tmp_path):
    gp.plot(comparison, tmp_path / "picture.svg")
    root = ElementTree.parse(tmp_path / "picture.svg").getroot()
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    paths = root.findall(".//{http://www.w3.org/2000/svg}path")
    assert sum(len(path.get("d", "")) > 2000 for path in paths) >= 15  # three curves per method


def test_a_load_with_two_directions_is_drawn_as_a_whole(tmp_path):
    picture = tmp_path / "picture.svg"
    assert run_here("compare", "--preset", "gantry-crane", *FEW, "--plot", picture).code == 0
    text = picture.read_text("utf-8")
    assert "<!-- Worst residual sway of the load over all machines -->" in text
    assert "<!-- Sway of the load, nominal -->" in text
    assert "payload-" not in text


def test_a_notebook_shows_what_a_file_holds_whenever_it_is_drawn(tmp_path, monkeypatch):
    plan = gp.plan(preset_spec("paper", FEW[1::2]))
    monkeypatch.setattr("time.time", lambda: 1e9)
    shown = gp.plot(plan)
    monkeypatch.setattr("time.time", lambda: 1.1e9)
    gp.plot(plan, tmp_path / "picture.svg")
    assert shown._repr_svg_() == (tmp_path / "picture.svg").read_text("utf-8")


DRAWING = """
import matplotlib
matplotlib.use("svg")
from matplotlib import pyplot
pyplot.figure(7)
from pathlib import Path
from numpy import arange
from gen_profile.presentation.charts.figure import Figure, Line, Panel
from gen_profile.presentation.charts.picture import save
from gen_profile.presentation.charts.plotly_json import figure_json
line = Line(name="line", x=arange(2.0), y=arange(2.0))
panel = Panel(title="panel", x_label="x", y_label="y", lines=[line])
save([Figure(caption="caption", panels=[panel])], Path("picture.png"), "salt", "title")
print(matplotlib.get_backend(), pyplot.get_fignums())
"""


def test_a_picture_leaves_what_the_caller_draws_with_as_it_is(tmp_path):
    words = [sys.executable, "-c", DRAWING]
    run = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["svg", "[7]"]
    assert (tmp_path / "picture.png").stat().st_size > 1000


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_pictures_of_one_figure_are_alike_to_the_byte(tmp_path, suffix, monkeypatch):
    line = Line(name="line", x=np.arange(3.0), y=np.arange(3.0))
    figure = Figure(caption="caption", panels=[Panel(title="panel", x_label="x", y_label="y", lines=[line])])
    pictures = []
    for clock in (1e9, 1.1e9):
        monkeypatch.setattr("time.time", lambda clock=clock: clock)
        save([figure], tmp_path / f"picture{suffix}", "salt", "title")
        pictures.append((tmp_path / f"picture{suffix}").read_bytes())
    assert pictures[0] == pictures[1]


def test_panels_of_a_figure_beside_another_take_up_its_width():
    """They stood side by side in a fifth of the width, as those of a gantry's two loads."""
    line = Line(name="line", x=np.arange(3.0), y=np.arange(3.0))
    panel = Panel(title="panel", x_label="x", y_label="y", lines=[line])
    picture = draw_side_by_side([Figure("motion", [panel] * 4), Figure("sway", [panel] * 2)], "title")
    motion, sway = (part.axes for part in picture.subfigs)
    assert [axis.get_subplotspec().get_geometry()[:2] for axis in motion] == [(2, 2)] * 4
    assert [axis.get_subplotspec().get_geometry()[:2] for axis in sway] == [(2, 1)] * 2


@pytest.mark.parametrize("name", ["picture.xyz", "picture"])
def test_a_picture_of_unknown_kind_is_refused_before_the_work(tmp_path, name):
    outcome = run_here("compare", "--plot", tmp_path / name)
    assert (outcome.code, len(outcome.err.splitlines())) == (2, 1)
    assert outcome.errors == [f"Error: --plot {tmp_path / name}: name a file that ends in .png, .svg, .pdf."]


@pytest.mark.parametrize(
    ("words", "option"),
    [
        (("compare",), "--plot"),
        (("check", "paper.csv"), "--csv"),
        (("report",), "--out"),
        (("fmu", "plant"), "--out"),
        (("library", "swept"), "--out"),
        (("identify",), "--out"),
        (("stream", "paper.log"), "--log"),
        (("drive-sim",), "--eds"),
        (("presets", "paper"), "--out"),
    ],
)
def test_a_folder_that_is_not_there_is_told_before_the_work(tmp_path, words, option):
    path = tmp_path / "new" / "deep" / "file.html"
    outcome = run_here(*words, option, path)
    sentence = f"Error: {option} {path}: there is no folder {path.parent}; make it, or name another one."
    assert (outcome.code, outcome.err.splitlines()) == (2, [sentence])
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    ("command", "option", "name"),
    [
        ("compare", "--plot", "picture.png"),
        ("robustness", "--plot", "picture.png"),
        ("robustness", "--csv", "table.csv"),
        ("report", "--out", "page.html"),
    ],
)
def test_what_cannot_be_written_is_refused_before_the_work(tmp_path, command, option, name):
    (tmp_path / "file").write_text("no folder", "utf-8")
    outcome = run_here(command, option, tmp_path / "file" / name)
    assert (outcome.code, len(outcome.err.splitlines())) == (2, 1)
    assert outcome.errors[0].startswith(f"Error: Cannot write to the folder {tmp_path / 'file'}: ")


@pytest.fixture(scope="module")
def drawn(comparison):
    """The figure of a comparison, laid out as it would be in a file."""
    figure = draw_side_by_side([comparison_figure(comparison)], "title")
    FigureCanvasAgg(figure).draw()
    return comparison, figure


def test_legends_and_panels_do_not_overlap(drawn):
    _, figure = drawn
    boxes = [axis.get_tightbbox() for axis in figure.axes]
    (legend,) = figure.subfigs[0].legends
    assert not any(legend.get_window_extent().overlaps(box) for box in boxes)
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
    assert not any(axis.get_legend() for axis in figure.axes)


def test_every_bar_is_told_beside_it_and_not_on_it(drawn):
    comparison, figure = drawn
    axis = figure.axes[-1]
    assert len(axis.texts) == len(axis.patches) == len(comparison.rows)
    for text, bar, row in zip(axis.texts, axis.patches, comparison.rows, strict=True):
        worst = 1e3 * row.figures["sway_residual_worst_m"]
        assert text.get_text().endswith(f" {number(worst)}")
        assert ("▸" in text.get_text()) == (worst > axis.get_xlim()[1])
        ends = min(bar.get_window_extent().x1, axis.bbox.x1)
        assert text.get_window_extent().x0 >= ends - 1.0


def test_limits_are_drawn_where_curves_come_near():
    limits = {"velocity": 0.5, "acceleration": 90.0, "sway": 0.2}
    figure = comparison_figure(compare(preset_spec("paper", FEW[1::2], limits=limits)))
    levels = {panel.title: [level.value for level in panel.levels] for panel in figure.panels[:-1]}
    assert levels["Velocity of cart"] == [0.5]  # no motion goes back
    assert levels["Acceleration of cart"] == []  # far off
    assert 200.0 not in levels["Sway of the payload, nominal"]
    picture = draw_side_by_side([figure], "title")
    velocity = picture.axes[1]
    assert [line.get_ydata()[0] for line in velocity.get_lines() if line.get_color() == LIMIT] == [0.5]
    assert velocity.get_ylim()[1] > 0.5


def test_what_hardly_moves_is_not_drawn_large():
    held = preset_spec("gantry-crane", ["move.distance=[8.0, 0.0]", "solver.method=zv"], robustness={})
    plan = gp.plan(held)
    spans = {panel.title: panel.span for panel in motion_figure(plan.spec, plan.evaluation).panels}
    assert (spans["Position of x"], spans["Jerk of x"]) == (None, None)
    assert (spans["Position of y"], spans["Jerk of y"]) == ((-1.0, 1.0), (-1e-3, 1e-3))


def test_figures_and_spectra_are_of_an_axis_that_moves():
    changes = ["move.distance=[0.0, 4.0]", "solver.method=zv"]
    lag = {"type": "first-order", "tau": 0.05}
    plan = gp.plan(preset_spec("gantry-crane", changes, robustness={}, actuator=lag))
    (spectrum,) = spectrum_figure(plan.spec, plan.evaluation).panels
    assert (spectrum.title, spectrum.lines[0].y.max() > 0.1) == ("Spectrum of the acceleration of y", True)
    names = ("acceleration_max_m_per_s2", "acceleration_rms_m_per_s2", "command_acceleration_max_m_per_s2")
    assert min(plan.figures[name] for name in names) > 0.1


def test_few_curves_are_drawn_each_in_a_colour_of_its_own_unless_all_are_asked_for(plain):
    def curves(**how):
        axis = draw_side_by_side([comparison_figure(plain, **how)], "title").axes[0]
        return {line.get_label(): line.get_color() for line in axis.get_lines()}

    few = curves()
    assert {"nzv", "zvd"} | {advice.method for advice in plain.recommended.values()} <= set(few)
    assert len(few) == len(set(few.values())) <= 6
    assert set(curves(every=True)) == {row.method for row in plain.rows}


def test_each_bar_has_a_colour_or_a_hatch_of_its_own_on_paper_and_on_pages(plain):
    figure = comparison_figure(plain)
    (bars,) = draw_side_by_side([figure], "title").axes[-1].containers
    marker = figure_json(figure)["panels"][-1]["data"][0]["marker"]
    looks = {(bar.get_facecolor(), bar.get_hatch()) for bar in bars}
    pages = set(zip(marker["color"], marker["pattern"]["shape"], strict=True))
    assert len(looks) == len(pages) == len(plain.rows) > len(set(marker["color"]))


def test_numerical_error_is_no_figure_of_a_bar(plain):
    bars = comparison_figure(plain).panels[-1]
    assert len(bars.texts) > 5 and not any("e-" in text for text in bars.texts)


def test_sway_is_drawn_on_the_nominal_machine_and_at_both_ends_of_the_ranges(drawn):
    """As the paper's figures 4 and 5, and with the sign that the paper leaves out."""
    comparison, figure = drawn
    name, share = next(iter(comparison.spec.robustness.uncertain.items()))
    titles = [axis.get_title().replace("\N{NO-BREAK SPACE}", " ") for axis in figure.axes[5:8]]
    ends = [f"{name} {sign}{100 * share:g} %" for sign in "+−"]
    load = comparison.spec.machine().end_load_name
    assert titles == [f"Sway of the {load}, {who}" for who in ("nominal", *ends)]
    machines = [comparison.rows[0].evaluation.machines[index].parameters[name] for index in (0, 1, 2)]
    assert machines[2] < machines[0] < machines[1]


def test_one_method_s_spikes_do_not_flatten_the_others(drawn):
    """3hump-ei leaves the flexible joint's base move so little time that it jerks 200 times as much."""
    _, figure = drawn
    for axis in figure.axes[1:4]:
        peaks = [np.abs(line.get_ydata()).max() for line in axis.get_lines()]
        assert max(np.abs(axis.get_ylim())) <= 10.501 * np.median(peaks)
        assert sum(peak <= axis.get_ylim()[1] for peak in peaks) >= len(peaks) - 2


def test_every_method_has_a_look_of_its_own_whoever_else_takes_part():
    optimal = ("optimal", *(f"optimal-{kind}" for kind in ("beta0", "beta20", "beta50", "range", "order2")))
    methods = [*SHAPERS, *optimal, "optimal-order1", "optimal-beta7"]
    styles = method_styles(methods)
    assert len({(style.colour, style.dash) for style in styles.values()}) == len(methods)
    assert {style.dash for method, style in styles.items() if method.startswith("optimal")} == {"solid"}
    assert all(method_styles([method])[method] == style for method, style in styles.items())


def test_where_no_method_has_a_motion_there_is_nothing_to_draw(tmp_path):
    nothing = Comparison(
        spec=preset_spec("paper"), rows=(), left_out={}, too_slow={}, efficient=frozenset(), recommended={}
    )
    with pytest.raises(OutputError, match="no method has a motion for this move"):
        gp.plot(nothing, tmp_path / "picture.png")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_a_line_of_any_length_keeps_its_points(count):
    """As a proof's picture of promptness has where few commands were compared."""
    points = np.array([0.0, 0.1, 0.2])[:count]
    line = Line(name="line", x=points, y=points)
    figure = Figure(caption="caption", panels=[Panel(title="panel", x_label="x", y_label="y", lines=[line])])
    (trace,) = figure_json(figure)["panels"][0]["data"]
    shown = trace["x"] if "x" in trace else [trace["x0"] + trace["dx"] * number for number in range(count)]
    assert shown == pytest.approx(points.tolist()) and trace["y"] == shown
