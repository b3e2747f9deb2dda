import subprocess

import can
import numpy as np
import pytest
from motions import quintic, target
from system_parts import program

from gen_profile.motion.profile import sample
from gen_profile.support.errors import ExportError
from gen_profile_exporters.can import frames
from gen_profile_exporters.can.export import exporter

MOVE = quintic((0.1, 0.4))
TWO_MOVES = quintic((0.1, 0.4), (1.2, -0.7))


def encoded(profile=MOVE, *names, **options):
    file, *_ = exporter.encode(profile, target(*names, **options))
    return file.content


def lines_of(content):
    return content.decode("ascii").splitlines()


def replayed(lines, *names, **options):
    return exporter.replay(("\n".join(lines) + "\n").encode("ascii"), target(*names, **options))


class TestEncode:
    def test_frames_of_one_period(self):
        lines = lines_of(encoded(TWO_MOVES, "bridge", "trolley", node=5))
        assert lines[:4] == [
            "(0000000000.000000) can0 305#A0860100",
            "(0000000000.000000) can0 306#804F1200",
            "(0000000000.000000) can0 080#",
            "(0000000000.004000) can0 305#A0860100",
        ]
        assert lines[-3:] == [
            "(0000000001.000000) can0 305#801A0600",
            "(0000000001.000000) can0 306#A051F5FF",
            "(0000000001.000000) can0 080#",
        ]
        assert len(lines) == 3 * 251

    def test_stamps_are_exact(self):
        lines = lines_of(encoded(quintic((0, 0.1), duration=3.0), sync_period=0.001, bitrate=1_000_000))
        stamps = [line[1:18] for line in lines[1::2]]
        assert stamps == [f"{k // 1000:010d}.{k % 1000:03d}000" for k in range(3001)]

    def test_sign_turns_the_counts(self):
        content = encoded(sign=-1)
        assert lines_of(content)[0].endswith("301#6079FEFF")
        assert exporter.replay(content, target(sign=-1)).position[0, 0] == 0.1

    def test_python_can_reads_the_same(self, tmp_path):
        path = tmp_path / "bay-3.log"
        path.write_bytes(encoded(TWO_MOVES, "bridge", "trolley"))
        with can.LogReader(path) as reader:
            messages = list(reader)
        expected = np.rint(1e6 * sample(TWO_MOVES, 0.004).position).astype("<i4")
        assert len(messages) == 3 * len(expected)
        for cycle, setpoints in enumerate(expected):
            frames = messages[3 * cycle : 3 * cycle + 3]
            assert [frame.arbitration_id for frame in frames] == [0x301, 0x302, 0x080]
            assert [bytes(frame.data) for frame in frames] == [*(value.tobytes() for value in setpoints), b""]
            assert all(abs(frame.timestamp - 0.004 * cycle) < 1e-9 for frame in frames)
            assert not any(frame.is_extended_id or frame.is_remote_frame or frame.is_fd for frame in frames)

    def test_can_utils_read_the_same(self, tmp_path):
        log2asc = program("log2asc", "can-utils")
        path = tmp_path / "bay-3.log"
        path.write_bytes(encoded(TWO_MOVES, "bridge", "trolley"))
        output = subprocess.run(
            [log2asc, "-I", str(path), "can0"], check=True, capture_output=True, text=True
        )
        found = [line.split()[2:] for line in output.stdout.splitlines() if " Rx " in line]
        expected = []
        for setpoints in np.rint(1e6 * sample(TWO_MOVES, 0.004).position).astype("<i4"):
            for cob_id, value in zip(("301", "302"), setpoints, strict=True):
                expected.append([cob_id, "Rx", "d", "4", *(f"{byte:02X}" for byte in value.tobytes())])
            expected.append(["80", "Rx", "d", "0"])
        assert found == expected

    def test_counts_beyond_32_bits_are_refused(self):
        with pytest.raises(ExportError, match=r"axis cart: -214\d+ counts at .* outside 32 bits"):
            encoded(quintic((0.0, 3000.0)), sign=-1)

    def test_node_ids_end(self):
        assert exporter.encode(TWO_MOVES, target("x", "y", node=125))
        with pytest.raises(
            ExportError, match=r"can\.node: 2 axes from node 126 on exceed the last node id 126"
        ):
            encoded(TWO_MOVES, "x", "y", node=126)

    @pytest.mark.parametrize("period", [0.00333, 0.0000125, 1 / 3, 0.256])
    def test_periods_that_no_drive_can_be_set_to_are_refused(self, period):
        with pytest.raises(ExportError, match=r"can\.sync_period: drives cannot be set .* \(60C2h"):
            encoded(sync_period=period)

    @pytest.mark.parametrize("period", [0.001, 0.0025, 0.255, 0.5, 1.0])
    def test_periods_that_drives_can_be_set_to_are_taken(self, period):
        motion = exporter.replay(encoded(sync_period=period), target(sync_period=period))
        assert motion.cycle_time == period

    def test_refuses_more_samples_than_fit(self):
        with pytest.raises(ExportError, match=r"can\.sync_period: 2000001 samples"):
            encoded(quintic((0, 1), duration=2000.0), sync_period=0.001)


class TestBusLoad:
    @pytest.mark.parametrize(("data_bytes", "bits"), [(0, 55), (1, 65), (4, 95), (6, 115), (8, 135)])
    def test_longest_frames(self, data_bytes, bits):
        # Davis et al., table of worst-case lengths: (55 + 10 n) bits for an 11-bit identifier.
        assert frames.frame_bits(data_bytes) == bits

    def test_a_full_bus_is_refused_with_the_period_that_fits(self):
        # 55 + 95 + 115 bits at 500 kbit/s are 0.53 ms; 70 % of the period is 0.757 ms.
        with pytest.raises(
            ExportError, match=r": 1 axis every 0\.0005 s.* by 106% \(limit 70%\); set 0\.00076 s or more"
        ):
            encoded(sync_period=0.0005)
        assert encoded(sync_period=0.00076)

    def test_more_axes_load_more(self):
        axes = [f"axis{number}" for number in range(3)]
        moves = quintic(*[(0, 0.1)] * 3)
        assert exporter.encode(moves, target(*axes, sync_period=0.001, bitrate=1_000_000))
        with pytest.raises(ExportError, match=r"3 axes every 0\.001 s.* set 0\.002 s or more"):
            encoded(moves, *axes, sync_period=0.001, bitrate=500_000)


class TestReplay:
    def test_resolution_is_one_count(self):
        motion = exporter.replay(encoded(counts_per_si=-20000.0), target(counts_per_si=-20000.0))
        np.testing.assert_array_equal(motion.resolution, [5e-5])
        assert motion.velocity is None

    def test_takes_carriage_returns_and_any_channel_and_start(self):
        lines = lines_of(encoded())
        moved = [line.replace("can0", "vcan7").replace("(000000000", "(173000000") for line in lines]
        reference = exporter.replay(encoded(), target())
        assert replayed(moved).payload_hash() == reference.payload_hash()
        content = encoded().replace(b"\n", b"\r\n")
        assert exporter.replay(content, target()).payload_hash() == reference.payload_hash()

    def test_a_log_that_ends_early_plays_short(self):
        assert len(replayed(lines_of(encoded())[:20]).position) == 10

    @pytest.mark.parametrize(
        ("row", "line", "message"),
        [
            (0, "nonsense", r"line 1: 'nonsense' is no frame"),
            (
                4,
                "(0000000000.008000) can0 301#A08601",
                r"line 5: setpoint 301h with 3 data bytes instead of 4",
            ),
            (4, "(0000000000.008000) can0 301#A086010000", r"line 5: setpoint 301h with 5 data bytes"),
            (4, "(0000000000.008000) can0 301##0A0860100", r"line 5: .* is no frame"),
            (4, "(0000000000.008000) can0 301#R", r"line 5: .* is no frame"),
            (4, "(0000000000.008000) can0 00000301#A0860100", r"line 5: .* is no frame"),
            (
                4,
                "(0000000000.008000) can0 302#A0860100",
                r"line 5: frame 302h is none of this target's \(301h, 080h\)",
            ),
            (4, "(0000000000.003000) can0 301#A0860100", r"line 5: the stamp falls"),
            (
                4,
                "(0000000000.008000) can1 301#A0860100",
                r"line 5: frame 301h is on the channel can1 instead",
            ),
            (4, "(0000000000.008000) can0 080#", r"line 5: SYNC without a setpoint 301h"),
            (5, "(0000000000.008000) can0 301#A0860100", r"line 6: second setpoint 301h before a SYNC"),
            (
                5,
                "(0000000000.008001) can0 080#",
                r"line 6: SYNC 4001 µs after the one before, where 4000 µs lie",
            ),
            (5, "(0000000000.008000) can0 080#01", r"line 6: SYNC with data"),
        ],
    )
    def test_refuses_other_frames(self, row, line, message):
        lines = lines_of(encoded())
        lines[row] = line
        with pytest.raises(ExportError, match=message):
            replayed(lines)

    def test_refuses_missing_frames(self):
        lines = lines_of(encoded())
        with pytest.raises(ExportError, match="line 2: second setpoint"):
            replayed([lines[0], *lines[2:]])
        with pytest.raises(ExportError, match="line 6: SYNC 8000 µs after"):
            replayed(lines[:4] + lines[6:])
        with pytest.raises(ExportError, match="ends without a SYNC"):
            replayed(lines[:-1])

    def test_refuses_truncated_text(self):
        with pytest.raises(ExportError, match="line 502: the CAN log breaks off"):
            exporter.replay(encoded()[:-1], target())

    def test_refuses_too_few_syncs(self):
        with pytest.raises(ExportError, match="holds 1 SYNCs"):
            replayed(lines_of(encoded())[:2])
        with pytest.raises(ExportError, match="holds 0 SYNCs"):
            exporter.replay(b"", target())

    def test_refuses_syncs_without_time_between(self):
        lines = [line.replace("0.004000", "0.000000") for line in lines_of(encoded())[:4]]
        with pytest.raises(ExportError, match="line 4: a cycle time of 0 s lies outside"):
            replayed(lines)

    def test_refuses_a_log_for_other_nodes(self):
        with pytest.raises(ExportError, match="line 1: frame 301h is none of this target's"):
            exporter.replay(encoded(), target(node=2))

    def test_refuses_positions_beyond_doubles(self):
        with pytest.raises(ExportError, match="too large to convert"):
            exporter.replay(encoded(counts_per_si=10.0), target(counts_per_si=1e-320))
