"""The table [check]: ranges, draws and the path of the setpoints."""

import pytest

from gen_profile.dynamics.evaluation.scenarios import further_scenarios, scenarios
from gen_profile.plants.registry import find_plant
from gen_profile.spec.reading import preset_spec, spec_from_dict
from gen_profile.support.errors import SpecError


def test_the_check_tries_the_ranges_of_the_design_unless_it_has_its_own():
    assert preset_spec("paper").checked_ranges() == {"L1": pytest.approx((0.376, 0.564))}
    own = preset_spec("paper", ["check.uncertain={m2=0.5}", "check.spans={c2=[0.0, 0.01]}"])
    assert own.checked_ranges() == {"m2": pytest.approx((0.1015, 0.3045)), "c2": (0.0, 0.01)}
    assert own.robustness.uncertain == {"L1": 0.2}
    assert preset_spec("paper", ["check.uncertain={}"]).checked_ranges() == {}


def test_all_of_it_survives_being_written_down():
    spec = preset_spec(
        "paper",
        [
            "check.uncertain={L1=0.1}",
            "check.spans={c1=[0.0, 0.01]}",
            "check.samples=7",
            "check.seed=3",
            "check.path={quantum=1e-5, between='hold', lag=[0.01, 0.02], latency=0.1, jitter=0.01, lost=0.1}",
        ],
    )
    assert spec_from_dict(spec.to_dict()) == spec
    assert spec.check.path.faulty and spec.check.path.alters_setpoints


@pytest.mark.parametrize(
    ("override", "sentence"),
    [
        ("check.uncertain=0.2", "check.uncertain: must be a table such as"),
        ("check.uncertain={L3=0.2}", "check.uncertain.L3: unknown parameter"),
        ("check.uncertain={c1=0.2}", "check.uncertain.c1: its value is 0, .* state check.spans"),
        ("check.uncertain={L1=2.0}", "check.uncertain.L1: must be greater than 0 and at most 0.9"),
        ("check.spans=1", "check.spans: must be a table such as"),
        ("check.spans={L3=[1, 2]}", "check.spans.L3: unknown parameter"),
        ("check.spans={L1=[2, 1]}", "check.spans.L1: must be two rising numbers from .* m"),
        ("check.spans={L1=[-2, 1]}", "check.spans.L1: must be two rising numbers"),
        ("check.spans={L1=1}", "check.spans.L1: must be two rising numbers"),
        ("check.spans={L1=['a', 1]}", "check.spans.L1: must be two rising numbers"),
        ("check.samples=-1", "check.samples: must be at least 0"),
        ("check.samples=1.5", "check.samples: must be a whole number"),
        ("check.seed=-1", "check.seed: must be at least 0"),
        ("check.sample=1", "check.sample: unknown key; did you mean 'samples'"),
        ("check.path=1", "check.path: "),
        ("check.path={lag=[0.2, 0.1]}", "check.path.lag: must be two rising times"),
        ("check.path={lag=[-0.2, 0.1]}", "check.path.lag.*: must be at least 0"),
        ("check.path={lag=0.1}", "check.path.lag: must be an array of 2 numbers"),
        ("check.path={between='hold'}", "check.path.between: .* takes a drive with a lag"),
        ("check.path={between='wait'}", "check.path.between: unknown value"),
        ("check.path={lost=0.7}", "check.path.lost: must be .* at most 0.5"),
        ("check.path={jiter=0.7}", "check.path.jiter: unknown key; did you mean 'jitter'"),
    ],
)
def test_faults_are_sentences(override, sentence):
    with pytest.raises(SpecError, match=sentence) as fault:
        preset_spec("paper", [override])
    assert len(str(fault.value).splitlines()) == 1


def test_a_lagging_actuator_may_hold():
    hold = ["check.path={between='hold'}", "actuator.type=first-order", "actuator.tau=0.05"]
    assert preset_spec("paper", hold).check.path.between == "hold"


def chain(masses):
    """A machine with two parameters per mass."""
    plant = find_plant(f"mass-spring-chain-{masses}")
    names = [parameter.name for parameter in plant.parameters if parameter.nominal > 0.0]
    return plant.type, names


def test_more_corners_than_a_thousand_are_refused():
    type_, names = chain(6)
    ranges = dict.fromkeys(names[:10], 0.1)
    document = {"plant": {"type": type_}, "move": {"distance": 1.0, "duration": 9.0}}
    spec = spec_from_dict({**document, "check": {"uncertain": ranges}})
    machines = scenarios(spec)
    corners = [row for row in further_scenarios(spec, machines) if row.group == "corners"]
    assert len(machines) == 1 + 2 + 20
    everything = {tuple(row.parameters.values()) for row in (*machines, *corners)}
    assert len(everything) == len(machines) + len(corners) == 1 + 2**10 + 20
    assert [row.row for row in (*machines, *corners)] == list(range(len(everything)))
    ranges[names[10]] = 0.1
    with pytest.raises(
        SpecError, match=r"check.uncertain: 11 parameters have 2\^11 corners; name at most 10"
    ):
        spec_from_dict({**document, "check": {"uncertain": ranges}})


@pytest.mark.parametrize("table", ["robustness", "check"])
@pytest.mark.parametrize(("value", "share", "end"), [(0.02, 0.9, "0.002"), (190.0, 0.1, "209")])
def test_ranges_that_the_machine_cannot_have_are_refused(table, value, share, end):
    overrides = [f"plant.L1={value}", "robustness={}", f"{table}.uncertain={{L1={share}}}"]
    sentence = rf"^{table}\.uncertain\.L1: reaches {end}, and the machine takes 0\.01 to 200 m\.$"
    with pytest.raises(SpecError, match=sentence):
        preset_spec("paper", overrides)


def test_names_tell_values_where_a_share_says_nothing():
    spec = preset_spec("paper", ["check.spans={c2=[0.0, 0.01]}", "check.path={lag=[0.0, 0.02]}"])
    machines = scenarios(spec)
    assert machines[1].name == "L1 +20 %, c2 0.01"
    names = [row.name for row in further_scenarios(spec, machines)]
    assert names[1] == "L1 +20 %, c2 0.01, lag 0 s" and names[-1] == "c2 0, lag 0.02 s"
