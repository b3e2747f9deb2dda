"""Drives of several makers: what their public EDS and DCF files say of them, at the desk and on the bus.

The facts are those of files that are public (docs/can.md has the table); files and drives are made here.
"""

import re

import pytest
from exporters.can.bench import Bench
from exporters.can.test_data_sheet import of
from exporters.motions import quintic, target

from gen_profile.spec.can import DataSheet
from gen_profile.spec.reading import preset_spec, spec_from_dict
from gen_profile.support.errors import ExportError, SpecError
from gen_profile_exporters.can.cia402 import State
from gen_profile_exporters.can.export import exporter
from gen_profile_exporters.can.simulation.drive_dictionary import DriveVariant, eds
from gen_profile_exporters.can.startup import SUBSTITUTES

MOVE = quintic((0.0, 0.3), duration=2.0)
INCREMENTS = (0x00B5_0000, 0x00B5_0300, 0x00B5_5700)
CSP, IP, HOMING, PROFILES = 1 << 7, 1 << 6, 1 << 5, 1 | 1 << 2

EPOS4 = DriveVariant(
    units=(0x00B5_0000, 0x00B4_4700, 0x00C0_0300),
    fixed_units=True,
    encoder=(2048, 1),
    lacks=(0x1006, 0x1019),
    limits={(0x60C2, 1): (0, 100)},
)
EPOS2 = DriveVariant(lacks=(0x1006, 0x1019, 0x605A), fixed_period=(1, -3))
GOLD = DriveVariant(following_error=0)
SIMPLIQ = DriveVariant(modes=IP | HOMING | PROFILES)
SCHUNK = DriveVariant(modes=IP | 0b11, lacks=(0x1006, 0x1019, 0x6007, 0x605A, 0x6084, 0x6085))
FAULHABER = DriveVariant(modes=HOMING | PROFILES, lacks=(0x1006, 0x1019, 0x6007, 0x605A, 0x6065, 0x60C2))
WITHOUT = ("6007h", "605Ah", "6085h")
RPM = {"velocity_unit": "rpm", "acceleration_unit": "rpm/s", "counts_per_revolution": 2048.0}


def sheet_of(make, change=lambda text: text):
    return DataSheet(name="drive.eds", content=change(eds(1, make)).encode())


def lists_of(make, change=lambda text: text, **options):
    """Export for a drive's file; read the start-up list back, by object."""
    files = exporter.encode(MOVE, target(eds=sheet_of(make, change), **options))
    (table,) = [file.content.decode() for file in files if file.filename.endswith(".startup.csv")]
    rows = [line.split(",") for line in table.splitlines()[1:]]
    return {(int(row[1][:4], 16), int(row[2][:2], 16)): row[4] for row in rows}


@pytest.mark.parametrize(
    ("make", "options", "reason"),
    [
        (EPOS4, {}, "counts in rpm/s where the spec has counts/s"),
        (EPOS4, RPM | {"sync_period": 0.101}, "60C2h:01 .* must hold 101"),
        (EPOS2, {"without": ("605Ah",)}, "60C2h:01 .* must hold 4"),
        (GOLD, {}, "does not watch its following error"),
        (SIMPLIQ, {}, "does not know the mode csp"),
        (SCHUNK, {"mode": "ip"}, 'list "6007h", "605Ah", "6085h" in can.without'),
        (FAULHABER, {"mode": "ip"}, "does not know the mode ip"),
    ],
)
def test_quirks_are_refused_at_the_desk_as_on_the_bus(make, options, reason):
    with pytest.raises(ExportError, match=rf"^drive.eds: axis cart: .*{reason}"):
        lists_of(make, **options)
    with Bench(profile=MOVE, make=make, **options) as bench:
        assert re.search(reason, bench.run().reason)


@pytest.mark.parametrize(
    ("make", "options"),
    [
        (EPOS4, RPM),
        (EPOS2, {"without": ("605Ah",), "sync_period": 0.001}),
        (GOLD, {"following_error": 0.02}),
        (SIMPLIQ, {"mode": "ip"}),
        (SCHUNK, {"mode": "ip", "without": WITHOUT}),
    ],
)
def test_quirks_have_a_cure(make, options):
    listed = lists_of(make, **options)
    assert not {index for index, _ in listed} & {*make.lacks}
    with Bench(profile=MOVE, make=make, **options) as bench:
        assert not bench.run().reason
        assert abs(bench.drive.actual - 300_000) <= 1


def test_the_period_is_stated_as_the_drive_keeps_it():
    assert lists_of(DriveVariant(period_exponent=-4), sync_period=0.01)[0x60C2, 1] == "100"


def test_limits_of_a_watched_heartbeat_may_be_those_of_its_time():
    listed = lists_of(GOLD, of("1016sub1", "HighLimit", "0xFFFF"), following_error=0.02)
    assert listed[0x1016, 1] == "0x007F0014"
    with pytest.raises(ExportError, match="1016h:01 takes 10 at most"):
        lists_of(GOLD, of("1016sub1", "HighLimit", "0xA"), following_error=0.02)


@pytest.mark.parametrize("index", SUBSTITUTES)
def test_every_substitute_is_stated_and_does(index):
    make, name = DriveVariant(lacks=(index,)), f"{index:04X}h"
    turn = {"modulo": 1.0} if index == 0x607B else {}  # m, more than the move
    with Bench(profile=MOVE, make=make, **turn) as bench:
        assert f'If that will do, list "{name}" in can.without' in bench.run().reason
        assert not bench.drive.was_enabled
    with Bench(profile=MOVE, make=make, without=(name,), **turn) as bench:
        assert not bench.run().reason
        assert abs(bench.drive.actual - 300_000) <= 1


@pytest.mark.parametrize("lacks", [(0x605A,), (0x6085,), (0x6007, 0x605A, 0x6084, 0x6085)])
def test_a_quick_stop_ends_with_power_off(lacks):
    without = tuple(f"{index:04X}h" for index in lacks if index in SUBSTITUTES)
    with Bench(profile=MOVE, make=DriveVariant(lacks=lacks), without=without) as bench:
        bench.at_cycle(200, lambda: bench.streamer.ask_to_stop("enough."))
        assert bench.run().reason == "enough. The axes were stopped."
        assert bench.drive.state is State.SWITCH_ON_DISABLED


def test_a_ramp_that_stands_in_is_as_steep():
    braked = {}
    for lacks, without in (((), ()), ((0x6085,), ("6085h",))):
        with Bench(profile=MOVE, make=DriveVariant(lacks=lacks), without=without) as bench:
            bench.at_cycle(250, lambda bench=bench: bench.streamer.ask_to_stop("enough."))
            bench.run()
            braked[lacks] = bench.drive.actual
    assert braked[()] == pytest.approx(braked[0x6085,], abs=2)


def test_a_fixed_mapping_comes_with_the_key_to_state():
    change = lambda text: re.sub(  # noqa: E731
        r"(?ms)(^\[160[0-3](?:sub\w)?\]\n)(.*?)AccessType=rw", r"\1\2AccessType=const", text
    )
    with pytest.raises(ExportError, match=r"160\dh:\d\d cannot be written. .* can.fixed_pdos.rpdo"):
        lists_of(DriveVariant(own_mapping=True), change)


def test_an_object_that_no_pdo_carries():
    with pytest.raises(ExportError, match="cannot carry 607Ah:00"):
        lists_of(DriveVariant(), lambda text: re.sub(r"(?s)(\[607A\].*?PDOMapping=)0x1", r"\g<1>0x0", text))


def test_the_file_goes_with_the_spec(tmp_path):
    (tmp_path / "drive.eds").write_bytes(sheet_of(SCHUNK).content)
    stated = preset_spec("paper").to_dict()
    stated["can"] |= {"eds": "drive.eds", "without": ["605Ah"]}
    spec = spec_from_dict(stated, tmp_path)
    assert spec.files() == {"drive.eds": sheet_of(SCHUNK).content}
    assert spec_from_dict(spec.to_dict(), tmp_path) == spec
    (tmp_path / "drive.eds").write_bytes(b"another")
    with pytest.raises(SpecError, match=r"can\.eds: .*drive\.eds is another file than was exported for"):
        spec_from_dict(spec.to_dict(), tmp_path)


@pytest.mark.parametrize(
    ("stated", "sentence"),
    [("none.eds", r"none\.eds cannot be read"), (3, "must name an EDS or DCF"), ("", "cannot be read")],
)
def test_no_such_file(tmp_path, stated, sentence):
    document = preset_spec("paper").to_dict()
    document["can"]["eds"] = stated
    with pytest.raises(SpecError, match=rf"^can\.eds: .*{sentence}"):
        spec_from_dict(document, tmp_path)
