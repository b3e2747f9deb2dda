"""What lies beside the log, read by other people's programs; and scaling, against exact arithmetic."""

import csv
import io
import struct
from decimal import Decimal
from fractions import Fraction

import can
import canopen
import cantools
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motions import quintic, target

from gen_profile.motion.profile import sample
from gen_profile.spec.reading import preset_spec
from gen_profile.support.errors import ExportError
from gen_profile_exporters.can import frames, scaling, startup
from gen_profile_exporters.can.export.candump import read
from gen_profile_exporters.can.export.exporter import encode, replay
from gen_profile_exporters.can.simulation.drive_dictionary import DriveVariant, dictionary, eds
from gen_profile_exporters.exporter import target_of

MOVE = quintic((0.1, 0.4))
TWO_MOVES = quintic((0.1, 0.4), (1.2, -0.7))
TORQUE = {"feed_forward": "torque", "torque_per_acceleration": 80.0}
BOTH = {"feed_forward": "both", "torque_per_acceleration": 80.0}


def files(profile=MOVE, *names, **options):
    name = options.pop("name", "bay-3")
    found = encode(profile, target(*names, name=name, **options))
    return {file.filename.removeprefix(name): file.content for file in found}


def messages(reader):
    return [
        (round(message.timestamp * 1e6), message.arbitration_id, bytes(message.data)) for message in reader
    ]


class TestTraces:
    @pytest.mark.parametrize("suffix", [".asc", ".blf"])
    def test_python_can_reads_the_same_frames(self, suffix, tmp_path):
        written = files(TWO_MOVES, "bridge", "trolley")
        path = tmp_path / f"bay{suffix}"
        path.write_bytes(written[suffix])
        with can.LogReader(path, relative_timestamp=True) as reader:
            found = messages(reader)
        assert [frame[1:] for frame in found] == [(f.cob_id, f.data) for f in read(written[".log"])]
        np.testing.assert_allclose(
            [frame[0] for frame in found], [f.stamp for f in read(written[".log"])], atol=1
        )

    def test_no_clock_in_any_file(self):
        assert files() == files()
        assert b"1970" in files()[".asc"]


class TestDatabase:
    @pytest.mark.parametrize("options", [{}, {"mode": "ip"}, {"feed_forward": "velocity"}, TORQUE, BOTH])
    @pytest.mark.parametrize("sign", [1, -1])
    def test_cantools_decodes_the_motion(self, options, sign):
        written = files(TWO_MOVES, "bridge", "trolley 2", sign=sign, counts_per_si=20_000.0, **options)
        database = cantools.database.load_string(written[".dbc"].decode("ascii"))
        signal = "InterpolationData" if options.get("mode") == "ip" else "TargetPosition"
        found = {"bridge": [], "trolley_2": []}
        for frame in read(written[".log"]):
            name = database.get_message_by_frame_id(frame.cob_id).name
            values = database.decode_message(name, frame.data)
            if name.endswith("_Setpoint"):
                found[name.removesuffix("_Setpoint")].append(values)
            elif name.endswith("_FeedForward"):
                found[name.removesuffix("_FeedForward")][-1] |= values
        motion = replay(
            written[".log"], target("bridge", "trolley 2", sign=sign, counts_per_si=20_000.0, **options)
        )
        for column, decoded in enumerate(found.values()):
            positions = [values[signal] for values in decoded]
            np.testing.assert_allclose(positions, motion.position[:, column], rtol=0, atol=1e-9)
        if options.get("feed_forward") in {"velocity", "both"}:
            velocity = [values["VelocityOffset"] for values in found["bridge"]]
            np.testing.assert_allclose(velocity, MOVE(motion.times).velocity[:, 0], atol=5e-5)
            np.testing.assert_allclose(velocity, motion.velocity[:, 0], atol=1e-9)
        if options in (TORQUE, BOTH):
            torque = [values["TorqueOffset"] for values in found["bridge"]]
            expected = sign * 8.0 * MOVE(motion.times).acceleration[:, 0]
            np.testing.assert_allclose(torque, expected, atol=0.051)

    def test_feedback_is_decoded(self):
        database = cantools.database.load_string(files()[".dbc"].decode("ascii"))
        decoded = database.decode_message("cart_Feedback", struct.pack("<Hi", 0x1237, -250_000))
        assert decoded == {"Statusword": 0x1237, "ActualPosition": -0.25}

    @pytest.mark.parametrize(
        ("name", "identifier"), [("x", "x"), ("2nd axis", "axis_2nd_axis"), ("µ", "axis__")]
    )
    def test_names_become_identifiers(self, name, identifier):
        database = cantools.database.load_string(files(MOVE, name)[".dbc"].decode("ascii"))
        assert {f"{identifier}_Command", f"{identifier}_Setpoint"} <= {m.name for m in database.messages}


OPTIONS = {
    "following_error": 0.01,
    "quick_stop": 0.5,
    "travel": {"cart": (-0.5, 0.5)},
    "encoder": (65536, 1),
    "gear": (3, 1),
    "feed": (400_000, 1),
    "timeout": 0.05,
}


class TestVelocities:
    @pytest.mark.parametrize("sign", [1, -1])
    def test_cantools_decodes_them(self, sign):
        moves, names = quintic((0.0, 0.4), (0.0, -0.7)), ("bridge", "trolley")
        options = {"mode": "csv", "sign": sign, "counts_per_si": 20_000.0}
        written = files(moves, *names, **options)
        database = cantools.database.load_string(written[".dbc"].decode("ascii"))
        found = [
            database.decode_message(frame.cob_id, frame.data)["TargetVelocity"]
            for frame in read(written[".log"])
            if frame.cob_id == 0x302
        ]
        times = (np.arange(len(found)) + 0.5) * 0.004
        np.testing.assert_allclose(found[:-1], moves(times).velocity[:-1, 1], atol=2e-4)
        assert found[-1] == 0.0

    @given(
        st.floats(-5.0, 5.0),
        st.floats(0.5, 8.0),
        st.floats(10.0, 1e6),
        st.sampled_from([0.001, 0.002, 0.004, 0.025]),
    )
    @settings(max_examples=12, deadline=None)
    @pytest.mark.slow
    def test_nothing_adds_up(self, distance, duration, counts_per_si, period):
        """However coarse the counts, the axes are led to within what one count/s makes in a period."""
        profile = quintic((0.0, distance), duration=duration)
        bus = target(mode="csv", counts_per_si=counts_per_si, sync_period=period, bitrate=1_000_000)
        motion = replay(encode(profile, bus)[0].content, bus)
        planned = sample(profile, period).position
        np.testing.assert_allclose(motion.position, planned, atol=0.51 * period / counts_per_si, rtol=1e-12)
        assert motion.resolution == pytest.approx([period / counts_per_si])

    def test_velocities_beyond_32_bits_are_refused(self):
        with pytest.raises(ExportError, match=r"axis cart, velocity: .* outside 32 bits"):
            files(quintic((0.0, 0.9), duration=0.1), mode="csv", counts_per_si=2e9)


class TestOthersDecode:
    """Random configurations, decoded by cantools with our DBC and by canopen with our mappings."""

    @pytest.mark.slow
    @given(
        st.lists(st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)), min_size=1, max_size=4),
        st.sampled_from([{}, {"mode": "ip"}, {"feed_forward": "velocity"}, TORQUE, BOTH]),
        st.integers(1, 120),
        st.sampled_from([-1, 1]),
        st.floats(100.0, 1e6),
        st.sampled_from([0.004, 0.01, 0.025]),
    )
    @settings(max_examples=30, deadline=None)
    def test_the_same_setpoints(self, moves, options, node, sign, counts_per_si, period):
        names = [f"axis{number}" for number in range(len(moves))]
        options = {**options, "node": node, "sign": sign, "counts_per_si": counts_per_si}
        bus = target(*names, sync_period=period, **options)
        written = files(quintic(*moves, duration=0.5), *names, sync_period=period, **options)
        planned = sample(quintic(*moves, duration=0.5), period).position
        database = cantools.database.load_string(written[".dbc"].decode("ascii"))
        nodes = {node + n: set_up(node + n, written[f".node{node + n}.cdcf"]) for n in range(len(moves))}
        cycle = 0
        for frame in read(written[".log"]):
            if frame.cob_id == frames.SYNC:
                cycle += 1
                continue
            number, column = divmod(frame.cob_id - node - 0x100, 0x100)
            signals = database.decode_message(frame.cob_id, frame.data, scaling=False)
            if number == 2:
                exact = round(Fraction(planned[cycle, column]) * scaling.exact(sign * counts_per_si))
                assert next(iter(signals.values())) == exact
            mapped = nodes[node + column].rpdo[number]
            assert mapped.cob_id == frame.cob_id
            mapped.data = bytearray(frame.data)
            assert [variable.raw for variable in mapped] == list(signals.values())
        assert cycle == len(planned)
        assert frames.cycle_bits(bus) < frames.MOST_LOAD * round(bus.can.bitrate * period)


def set_up(number, concise_dcf):
    """Set a node of canopen up as a manager does with our list."""
    node = canopen.LocalNode(number, dictionary(number, DriveVariant()))
    for index, sub, data in concise(concise_dcf):
        if index != 0x1017:  # would start a heartbeat
            node.set_data(index, sub, data)
    node.associate_network(canopen.Network())
    node.rpdo[2].read()
    node.rpdo[3].read()
    return node


class TestStartup:
    def test_a_drives_own_dictionary_takes_every_entry(self):
        # canopen's types and lengths of the standard's objects, not ours
        node = set_up(1, files(**OPTIONS)[".node1.cdcf"])
        values = {
            (0x60C2, 1): 4, (0x60C2, 2): -3, (0x6060, 0): 8, (0x6065, 0): 10_000, (0x6085, 0): 500_000,
            (0x607D, 1): -500_000, (0x607D, 2): 500_000, (0x608F, 1): 65536, (0x6091, 1): 3,
            (0x6092, 1): 400_000, (0x1016, 1): 0x007F_0032, (0x1401, 5): 50, (0x6007, 0): 3, (0x605A, 0): 2,
            (0x1601, 0): 1, (0x1601, 1): 0x607A_0020, (0x1A00, 2): 0x6064_0020, (0x1400, 1): 0x201,
        }  # fmt: skip
        for (index, sub), value in values.items():
            variable = node.object_dictionary.get_variable(index, sub)
            assert variable.decode_raw(node.get_data(index, sub)) == value, f"{index:04X}h:{sub}"

    @pytest.mark.parametrize(("options", "cob_id", "kind"), [(TORQUE, 0x8000_0401, 255), (BOTH, 0x401, 1)])
    def test_a_third_rpdo_is_on_where_it_is_needed(self, options, cob_id, kind):
        node = set_up(1, files(**options)[".node1.cdcf"])
        parameters = [node.object_dictionary.get_variable(0x1402, sub) for sub in (1, 2)]
        found = [variable.decode_raw(node.get_data(0x1402, variable.subindex)) for variable in parameters]
        assert found == [cob_id, kind]

    def test_table_and_concise_dcf_say_the_same(self):
        written = files(**OPTIONS)
        head, *rows = csv.reader(written[".startup.csv"].decode("utf-8").splitlines())
        assert head == ["node", "object", "subindex", "bits", "value", "meaning"]
        table = []
        for row in rows:
            node, index, sub, bits, value, _ = row
            length = int(bits) // 8
            data = (int(value, 0) & (1 << int(bits)) - 1).to_bytes(length, "little")
            table.append((int(index.rstrip("h"), 16), int(sub.rstrip("h"), 16), data))
            assert node == "1"
        assert table == concise(written[".node1.cdcf"])

    def test_every_axis_has_its_list(self):
        written = files(TWO_MOVES, "bridge", "trolley", node=5)
        assert {".node5.cdcf", ".node6.cdcf"} <= written.keys()

    def test_quick_stop_brakes_twice_as_hard_as_the_motion(self):
        entries = {(i, s): d for i, s, d in concise(files()[".node1.cdcf"])}
        greatest = np.abs(MOVE(np.linspace(0, 1, 1001)).acceleration).max()
        assert int.from_bytes(entries[0x6085, 0], "little") == pytest.approx(2e6 * greatest, rel=0.01)

    def test_a_hasty_time_out_is_refused(self):
        with pytest.raises(
            ExportError, match=r"can\.timeout: 0\.005 s are less than two cycles .* set 0\.008 s"
        ):
            files(timeout=0.005)

    def test_eds_is_read_by_canopen(self):
        written = eds(7, DriveVariant(), "axis.eds")
        file = io.StringIO(written)
        file.name = "axis.eds"
        found, own = canopen.import_od(file, 7), dictionary(7, DriveVariant())
        for index, entry in own.items():
            for sub in getattr(entry, "subindices", [0]):
                ours, theirs = own.get_variable(index, sub), found.get_variable(index, sub)
                assert (theirs.data_type, theirs.default) == (ours.data_type, ours.default)
        assert found.device_information.allowed_baudrates >= {125_000, 250_000, 500_000, 1_000_000}
        assert found.device_information.order_code
        assert "FileName=axis.eds\n" in written
        assert "=0x-" not in written


def concise(content):
    """Read a concise DCF as CiA 302-3 lays it out."""
    (count,) = struct.unpack_from("<I", content)
    entries, at = [], 4
    for _ in range(count):
        index, sub, size = struct.unpack_from("<HBI", content, at)
        entries.append((index, sub, content[at + 7 : at + 7 + size]))
        at += 7 + size
    assert at == len(content)
    return entries


class TestScaling:
    @given(
        st.lists(st.floats(-2000, 2000), min_size=1, max_size=50),
        st.fractions(min_value=Fraction(1, 1000), max_value=10**6),
    )
    def test_counts_are_exact(self, values, ratio):
        found = scaling.exact_counts(np.array(values), ratio)
        assert found.tolist() == [round(Fraction(value) * ratio) for value in values]

    def test_ties_go_to_the_even_count(self):
        halves = np.arange(-50_000, 50_000) + 0.5
        found = scaling.exact_counts(halves / 1024.0, Fraction(1024))
        assert found.tolist() == [round(Fraction(int(2 * half), 2)) for half in halves]

    def test_a_hundred_thousand_setpoints(self):
        values = np.linspace(-1.0, 1.0, 100_000)
        found = scaling.exact_counts(values, scaling.exact(1234567.89))
        ratio = Fraction(Decimal("1234567.89"))
        assert found.tolist() == [round(Fraction(value) * ratio) for value in values.tolist()]

    def test_far_outside_is_refused(self):
        with pytest.raises(ExportError, match="far outside 32 bits"):
            scaling.exact_counts(np.array([1e9]), Fraction(10**6))

    def test_a_travel_that_a_drive_would_take_for_another_is_refused(self):
        """3000 m of 1 µm are −1 294 967 296 to a drive: its upper end would lie below its lower one."""
        assert files(travel={"cart": (-2147.0, 2147.0)})
        sentence = r"can\.travel\.cart: -3000 to 3000 are -3000000000 to 3000000000 counts, more than 32 bits"
        with pytest.raises(ExportError, match=sentence):
            files(travel={"cart": (-3000.0, 3000.0)})
        with pytest.raises(ExportError, match=r"axis cart: it lies far outside 32 bits; lower axis\.counts"):
            files(counts_per_si=1e15)

    def test_an_entry_that_its_bits_do_not_hold_is_refused(self):
        with pytest.raises(ExportError, match=r"6085h:00, deceleration .*: 5000000000 does not fit 32 bits"):
            files(quick_stop=5000.0)

    def test_the_drives_increments_must_fit(self):
        assert files(encoder=(65536, 1), gear=(3, 1), feed=(1000, 1))
        with pytest.raises(ExportError, match=r"axis cart, in the drive's increments: .* outside 32 bits"):
            files(encoder=(2**24, 1), gear=(3, 1), feed=(1000, 1))

    def test_the_travel_is_kept(self):
        with pytest.raises(
            ExportError, match=r"can\.travel\.cart: the motion leaves the travel at 0\.\d+ s \(0\.3"
        ):
            files(travel={"cart": (0.0, 0.35)})

    def test_the_torque_must_fit(self):
        with pytest.raises(
            ExportError, match=r"axis cart, torque: \d+ counts .* 16 bits .*; lower can\.torque_per_acc"
        ):
            files(feed_forward="torque", torque_per_acceleration=50_000.0)

    @pytest.mark.parametrize("preset", ["paper", "gantry-crane"])
    def test_presets_fit(self, preset):
        found = target_of(preset_spec(preset))
        assert frames.nodes(found) == tuple(range(1, 1 + len(found.axes)))
        assert startup.timeout_ms(found.can) == 20


@given(
    st.integers(1, 30),
    st.sampled_from(["none", "velocity", "torque", "both"]),
    st.sampled_from([125_000, 10**6]),
)
def test_bus_load_is_that_of_the_longest_frames(axes, feed_forward, bitrate):
    bus = target(
        *[f"axis{n}" for n in range(axes)],
        bitrate=bitrate,
        feed_forward=feed_forward,
        torque_per_acceleration=1.0,
    )
    data = {"none": [4], "velocity": [8], "torque": [6], "both": [8, 2]}[feed_forward]
    bits = 55 + axes * (sum(55 + 10 * n for n in data) + 115)  # (55 + 10 n) bits, and one SYNC of none
    assert frames.cycle_bits(bus) == bits
