"""EDS files in place of drives: what the bus would refuse is refused at the desk, by the same sentences."""

import re

import pytest
from exporters.can.bench import Bench
from exporters.motions import quintic, target

from gen_profile.delivery.designs.design import design
from gen_profile.spec.can import read_data_sheet
from gen_profile.spec.reading import preset_spec, spec_from_dict
from gen_profile.support.errors import ExportError
from gen_profile_exporters.can.export import exporter
from gen_profile_exporters.can.setup.data_sheet import require_fit
from gen_profile_exporters.can.simulation.drive_dictionary import DriveVariant, eds
from gen_profile_exporters.can.streaming.plan import plan_of

MOVE = quintic((0.0, 0.3), duration=2.0)
RPM = DriveVariant(units=(0x00B5_0000, 0x00B4_4700, 0x00C0_0300), fixed_units=True, encoder=(4096, 1))
IN_RPM = {"velocity_unit": "rpm", "acceleration_unit": "rpm/s", "counts_per_revolution": 4096.0}


def tried(folder, make, change=lambda text: text, **options):
    """Try a motion on the file of a drive, changed as a text."""
    goal = target(**options)
    plan = plan_of(exporter.encode(MOVE, goal)[0].content, goal)
    path = folder / "drive.eds"
    path.write_text(change(eds(1, make)), encoding="utf-8")
    require_fit(read_data_sheet(path), plan.demand, goal)


def without(index):
    """Leave an object out, and its subindices."""
    return lambda text: re.sub(rf"(?ms)^\[{index}(sub\w+)?\]\n.*?(?=^\[)", "", text)


def of(index, key, value):
    """Give an object another access, limit or value."""
    return lambda text: re.sub(rf"(?ms)(^\[{index}\]\n)(.*?)(^PDOMapping)", rf"\1\2{key}={value}\n\3", text)


@pytest.mark.parametrize(
    ("make", "options"),
    [
        (DriveVariant(), {}),
        (DriveVariant(own_mapping=True, period_exponent=-4, sync_counter=20), {"sync_period": 0.01}),
        (DriveVariant(), {"mode": "csv", "following_error": 0.02}),
        (RPM, IN_RPM),
    ],
)
def test_drives_that_fit(tmp_path, make, options):
    tried(tmp_path, make, **options)
    with Bench(profile=MOVE, make=make, **options) as bench:
        assert not bench.run().reason


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (without("605A"), "the drive has no 605Ah. Without 605Ah, it must brake"),
        (without("1016"), "the drive has no 1016h"),
        (without("6502"), "the drive has no object 6502h"),
        (of("6085", "HighLimit", "0x10"), "6085h:00 .* must hold"),
    ],
)
def test_what_the_bus_would_refuse(tmp_path, change, reason):
    with pytest.raises(ExportError, match=rf"^drive.eds: axis cart: .*{reason}"):
        tried(tmp_path, DriveVariant(), change)
    sheet = read_data_sheet(tmp_path / "drive.eds")
    if not reason.startswith("6085h"):  # a ramp that is not stated comes from the motion
        with pytest.raises(ExportError, match=rf"^drive.eds: axis cart: .*{reason}"):
            exporter.require_target(target(eds=sheet))


def test_a_stated_ramp_is_held_to_its_limits_before_there_is_a_motion(tmp_path):
    (tmp_path / "drive.eds").write_text(of("6085", "HighLimit", "0x10")(eds(1, DriveVariant())), "utf-8")
    sheet = read_data_sheet(tmp_path / "drive.eds")
    exporter.require_target(target(eds=sheet))
    with pytest.raises(ExportError, match="By the file, 6085h:00 takes 16 at most"):
        exporter.require_target(target(eds=sheet, quick_stop=2.0))


@pytest.mark.parametrize("changed", [{"can.eds": "drive.eds"}, {"can.sync_period": 0.0123457}])
def test_nothing_is_solved_for_drives_that_cannot_follow(tmp_path, changed):
    """A move without any motion within its limits would be refused by another sentence."""
    (tmp_path / "drive.eds").write_text(without("605A")(eds(1, DriveVariant())), "utf-8")
    document = preset_spec("paper").to_dict() | {"limits": {"acceleration": 1e-3}}
    for place, value in changed.items():
        document["can"][place.removeprefix("can.")] = value
    spec = spec_from_dict(document, folder=tmp_path)
    with pytest.raises(ExportError, match=r"605Ah|60C2h"):
        design(spec, ["csv", "can"], tmp_path / "out")


@pytest.mark.parametrize(
    "change", [lambda _: "", lambda _: "[", lambda text: text[:5000], lambda _: "[1000]\nx=1\n"]
)
def test_other_files_are_sentences(tmp_path, change):
    with pytest.raises(ExportError, match=r"drive\.eds"):
        tried(tmp_path, DriveVariant(), change)
