from gen_profile.spec.reading import parse_spec, preset_spec
from gen_profile_exporters.exporter import target_of


def test_the_target_is_what_the_spec_says():
    spec = preset_spec("paper", ["axis.unit=mm", "axis.sign=-1", "export.cycle_time=0.002", "can.node=7"])
    target = target_of(spec)
    assert (target.name, target.cycle_time, target.can.node) == (spec.name, 0.002, 7)
    (axis,) = target.axes
    assert (axis.name, axis.unit, axis.factor, axis.counts_per_si) == ("cart", "mm", -1e3, -1e6)


def test_targets_are_values():
    text = '[plant]\ntype = "double-pendulum-crane"\n[move]\ndistance = 0.3\nduration = 3.0\n'
    assert target_of(parse_spec(text)) == target_of(parse_spec(text))
