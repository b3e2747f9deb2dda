"""What a page and a terminal say of histories after which nothing is promised."""

import attrs
import pytest

from gen_profile.assurance.proof.check import BlockJudgement
from gen_profile.assurance.proof.histories import Histories
from gen_profile.assurance.proof.numbering import CORNERS, Numbering
from gen_profile.assurance.proof.verdict import JudgedHistory, Proof
from gen_profile.cli.words import block_judgement
from gen_profile.presentation.report.planner import _facts, _limits, _ranking, _verdict
from gen_profile.spec.reading import preset_spec

SPEC = preset_spec("bay-crane")
SWAY = {"hook": 0.5, "payload": 0.753}


@pytest.fixture(scope="module")
def proof():
    """Of one history, after which the load is left swinging."""
    histories = Histories.of(SPEC)
    (choices,) = Numbering.of(histories, 1, 0).drawn
    one = JudgedHistory(
        number=0,
        group=CORNERS,
        history=histories.history(choices),
        cycles=5000,
        rests_after=3.0,
        promise=False,
        residual=SWAY,
        on_the_way=SWAY,
        limits=dict.fromkeys(("velocity", "acceleration", "jerk"), 1.0) | {"beyond_travel_m": 0.0},
        faults=(),
    )
    limit = dict.fromkeys(SWAY, 0.05)
    few = {"seed": 0, "count": 200, "parents": (), "by_fmpy": (), "apart": 0.0}
    return Proof(limit=limit, error_bound=1e-6, judged=(one,), **few)


def test_a_row_without_a_promise_says_so(proof):
    promised = attrs.evolve(proof.worst, number=1, promise=True, residual=dict.fromkeys(SWAY, 0.01))
    both = attrs.evolve(proof, judged=(proof.worst, promised))
    kept, left = _ranking(SPEC, both).rows
    assert left.cells[-2:] == ["payload 753 mm, and nothing is promised", "not judged"]
    assert kept.cells[-2] == "hook 10 mm"
    assert [one["promise"] for one in both.to_dict()["next_worst"]] == [False]


def test_where_nothing_is_promised_at_all_no_sway_is_said_to_be_allowed(proof, tmp_path):
    """The page said that 753 mm were left at most, and 50 mm allowed, or could not be made."""
    verdict = _verdict(proof, tmp_path / "bay.st")
    assert verdict.sentences[0] == "No residual sway is judged."
    assert verdict.sentences[2].startswith("In 1 of 1 the block promises nothing at the end")
    facts = dict(_facts(proof))
    assert facts["Residual sway of the payload, worst"] == "753 mm, and nothing is promised"
    assert facts["Share of its limit"] == "not judged"
    assert len(_limits(SPEC, proof).rows) == 3


@pytest.mark.parametrize("history", [None, 0])
def test_the_terminal_says_so_too(proof, tmp_path, history):
    judged = BlockJudgement(
        path=tmp_path / "bay.st", text="", spec=SPEC, check=proof, manifest="matches", history=history
    )
    assert "hook 500 mm, payload 753 mm, and nothing is promised" in block_judgement(judged)
