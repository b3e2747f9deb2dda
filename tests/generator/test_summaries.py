"""What a result prints in a terminal and in a notebook: what matters, in a line or a small table."""

from base64 import b64decode

import attrs
import numpy as np
import pytest

import gen_profile as gp
from gen_profile.assurance.certificate.document import Certificate
from gen_profile.assurance.proof.verdict import Proof
from gen_profile.delivery.designs.planner import Deployment
from gen_profile.studies.comparison.robustness import Robustness
from gen_profile.studies.identification.identify import Identification
from gen_profile.studies.identification.measurements import SwingLog
from gen_profile.studies.sweep.run import Sweep
from gen_profile.support.summary import Drawable, Summarised

pytestmark = pytest.mark.slow

PICTURED = {"Spec", "Design", "Plan", "Profile", "Judgement", "Check", "Robustness"}
LONGEST = 400  # characters, of a line that is still read


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    spec = gp.preset_spec("paper")
    made = gp.design(spec, "csv", tmp_path_factory.mktemp("out"))
    judgement = gp.check_artefact(made.folder / "paper.csv", made.spec)
    plan = made.plan
    found = [spec, made, plan, plan.motion, plan.solution, plan.solution.optimum, plan.evaluation]
    found += [judgement, judgement.check, gp.sample(plan.command, 0.01)]
    found += [gp.robustness(spec, "L1", methods="zvd", points=3)]
    found += [plan.motion(np.linspace(0.0, 3.0, 999)), gp.cosimulate(spec, gp.sample(plan.command, 0.01))]
    planner = gp.Planner(gp.preset_spec("bay-crane"))
    found += [planner, planner.hold(1.0, target=3.0)]
    found += [
        SwingLog(
            times=range(999), values=range(999), quantity="angle", load="hook", resolution=0.0, logged=999
        )
    ]
    return {type(one).__name__: one for one in found}


def test_results_are_a_line_and_a_table(results):
    for name, result in results.items():
        assert repr(result).startswith(f"<{name} ") and len(repr(result)) < LONGEST
        table = Summarised._repr_html_(result)
        assert table.startswith("<table>") and table.count("<tr>") == len(result.summary())
        assert isinstance(result, Drawable) == (name in PICTURED), name


def test_a_picture_is_an_image_of_its_own(results):
    before, _, encoded = results["Check"]._repr_html_().partition("data:image/svg+xml;base64,")
    picture = b64decode(encoded.removesuffix('">')).decode()
    assert 'alt="&lt;Check check: passed' in before
    assert "share of the allowed residual sway" in picture and "hook" in picture
    assert "acceleration (m/s² or rad/s²)" in gp.plot(results["Profile"]).svg


def test_where_matplotlib_is_missing_the_table_remains(results, monkeypatch):
    monkeypatch.setattr("gen_profile.support.plugins.find_spec", lambda _: None)
    assert results["Check"]._repr_html_().endswith("</table>")
    with pytest.raises(gp.OutputError, match=r"gen-profile\[data\]"):
        results["Check"].to_pandas()


def test_tables_are_frames_of_pandas(results):
    check, curve, samples = (results[name] for name in ("Check", "Robustness", "SampledProfile"))
    frame = check.to_pandas().set_index("machine")
    assert frame["hook_m"].max() == check.worst[1].residual["hook"]
    assert frame.loc["L1 -20 %", "L1"] == pytest.approx(0.8 * 0.47)
    assert frame["passed"].all()
    assert curve.to_pandas().set_index("L1")["zvd"].tolist() == curve.end_load("zvd").tolist()
    table = samples.to_pandas().set_index("time")
    assert list(table.columns) == ["position", "velocity", "acceleration", "jerk"][: table.shape[1]]
    assert table["position"].iloc[-1] == 0.3 and table.index[1] == 0.01


def test_a_map_s_table_has_a_column_of_each_parameter():
    errors = {"L1": np.array([-0.1, 0.0]), "m2": np.array([0.0, 0.2, 0.3])}
    residual = {"zvd": np.arange(12.0).reshape(2, 3, 2)}
    frame = Robustness(spec=gp.preset_spec("paper"), errors=errors, residual=residual).to_pandas()
    assert frame.query("L1 == 0 and m2 == 0.2")["zvd"].tolist() == [9.0]


def test_they_say_what_came_out(results):
    assert "double-pendulum-crane" in repr(results["Spec"])
    assert "converged" in repr(results["Solution"])
    assert "check: passed" in repr(results["Check"])
    assert "1.955 mm" in repr(results["Plan"])


def test_one_that_failed_says_so(results):
    check = results["Check"]
    strict = attrs.evolve(check, limit=dict.fromkeys(check.limit, 1e-6))
    assert "check: failed" in repr(strict)


def test_a_comparison_names_its_methods():
    comparison = gp.compare(gp.preset_spec("paper"))
    assert len(repr(comparison)) < LONGEST
    assert "gentlest: optimal-beta50" in repr(comparison)
    frame = comparison.to_pandas().set_index("method")
    assert len(frame) == len(comparison.rows)
    assert frame.loc["zvd", "sway_residual_worst_m"] == pytest.approx(0.00188, rel=0.01)


@pytest.mark.parametrize("kind", [Certificate, Deployment, Identification, Proof, Sweep])
def test_results_of_long_work_do_so_too(kind):
    assert issubclass(kind, Summarised)
    assert kind.__repr__ is Summarised.__repr__


def test_names_of_others_are_text_in_a_table():
    class Named(Summarised):
        def summary(self):
            return {"name": "<script>"}

    assert "<script>" not in Named()._repr_html_()


def test_a_spec_may_be_a_path_and_names_one_name(tmp_path, results):
    path = tmp_path / "my.toml"
    path.write_text(
        'name = "mine"\n[plant]\ntype = "double-pendulum-crane"\n[move]\ndistance = 0.3\nduration = 3\n'
    )
    assert gp.evolve_spec(path, move={"duration": 4.0}).move.duration == 4.0
    table = results["Design"].folder / "paper.csv"
    judged = gp.check_artefact(table, path, scale="1.0")
    assert judged.spec == gp.read_spec(path)
