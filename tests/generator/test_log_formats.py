"""Exports of engineering tools with all their lines, as they are, and as they come through clumsy hands.

Headers are those of public manuals and files: TwinCAT Scope (export in csv), TIA Portal (trace), CODESYS.
"""

import math

import numpy as np
import pytest

from gen_profile.spec.reading import preset_spec
from gen_profile.studies.identification.identify import read_swing
from gen_profile.studies.identification.log_clock import seconds_of
from gen_profile.support.errors import OutputError

SPEC = preset_spec("single-pendulum-crane")
TIMES = np.arange(0.0, 20.0, 0.05)
ANGLES = 0.06 * np.exp(-0.004 * TIMES) * np.cos(1.36 * TIMES)
FILETIME = 134296445010620000  # 100 ns since 1601
CHANNEL = {  # of TwinCAT Scope, a line each
    "SymbolComment": "",
    "Data-Type": "REAL64",
    "SampleTime[ms]": "50",
    "VariableSize": "8",
    "SymbolBased": "True",
    "IndexGroup": "16448",
    "IndexOffset": "608",
    "SymbolName": "MAIN.fAngle",
    "NetID": "5.1.2.3.1.1",
    "Port": "851",
    "Offset": "0",
    "ScaleFactor": "1",
    "BitMask": "0xffffffffffffffff",
    "Unit": "",
    "Unit ScaleFactor": "1",
    "Unit Offset": "0",
}


def scope(times, keys=CHANNEL, between="\t", comma=",", channels=3):
    head = [f"Name{between}YT Scope Project", f"File{between}C:\\scope\\crane.svdx"]
    head += [
        f"Starttime of export{between}{FILETIME}{between}Montag, 27. Juli 2026{between}23:59:50.062",
        "",
        "",
    ]
    head += [between.join([f"Name{between}{name}" for name in ("fAngle", "fPos", "fM")[:channels]])]
    head += [between.join([f"{key}{between}{CHANNEL[key]}"] * channels) for key in keys]
    values = ([f"{angle:.8f}", "3.0000", f"{math.sin(k):.4f}"] for k, angle in enumerate(ANGLES))
    rows = [
        between.join(f"{time}{between}{value.replace('.', comma)}" for value in row[:channels])
        for time, row in zip(times, values, strict=True)
    ]
    return "\r\n".join([*head, "", *rows, "EOF"])


def trace(end="", between=";", comma=","):
    """TIA Portal's trace, with a remark that holds a date above, and rows that are counted."""
    head = ['"Trace: Kran"', '"Aufzeichnung: 27.07.2026 23:59:50"', ""]
    head += [between.join(['"Messpunkt"', '"Zeit [ms]"', '"""DB1"".fAngle"', '"""DB1"".fPos"'])]
    rows = (
        between.join([f"{k}", f"{1e3 * t:.3f}", f"{a:.8E}", "3.0"]).replace(".", comma)
        for k, (t, a) in enumerate(zip(TIMES, ANGLES, strict=True))
    )
    return "".join(f"{line}{end}\r\n" for line in [*head, *rows])


def with_times(times):
    rows = "".join(f"{time}\t{a:.8f}\t3.0\n" for time, a in zip(times, ANGLES, strict=True))
    return f"Time\tPLC_PRG.fAngle\tPLC_PRG.fPos\n{rows}"


MILLISECONDS = [f"{1e3 * t:.0f}" for t in TIMES]
EXPORTS = {
    "Scope": scope(MILLISECONDS),
    "Scope, one channel": scope(MILLISECONDS, channels=1),
    "Scope, full time stamps": scope([f"{FILETIME + round(1e7 * t)}" for t in TIMES]),
    "Scope, names only, with points": scope(MILLISECONDS, (), ",", "."),
    "Scope, semicolons": scope(MILLISECONDS, between=";"),
    "TIA Portal": trace(),
    "TIA Portal, each line ended by a semicolon": trace(";"),
    "TIA Portal, in English": trace(between=",", comma="."),
    "times as IEC literals": with_times(f"T#{k // 20}s{50 * (k % 20)}ms" for k in range(len(TIMES))),
}
HANDS = {
    "as it is": lambda text: text.encode(),
    "with a byte order mark": lambda text: text.encode("utf-8-sig"),
    "UTF-16": lambda text: text.encode("utf-16"),
    "line ends mixed": lambda text: "".join(
        line + ("\r\n", "\n", "\r")[k % 3] for k, line in enumerate(text.splitlines())
    ).encode(),
    "blank lines": lambda text: "\n\n".join(text.splitlines()).encode(),
    "cut off": lambda text: text.encode()[: len(text) * 4 // 5],
}


@pytest.mark.parametrize("hand", HANDS.values(), ids=HANDS)
@pytest.mark.parametrize("text", EXPORTS.values(), ids=EXPORTS)
def test_exports_are_read_as_they_come(tmp_path, text, hand):
    (tmp_path / "log.csv").write_bytes(hand(text))
    log = read_swing(tmp_path / "log.csv", SPEC)
    assert len(log.times) >= 300
    assert np.isin(log.times.round(6), TIMES.round(6)).all()
    assert log.values[:-1] == pytest.approx(np.interp(log.times[:-1], TIMES, ANGLES), abs=1e-8)


@pytest.mark.parametrize("name", [*EXPORTS][:3] + [*EXPORTS][4:7])
def test_decimals_between_commas_are_refused_with_the_cure(tmp_path, name):
    text = EXPORTS[name].translate(str.maketrans({";": ",", "\t": ",", ".": ","}))
    (tmp_path / "log.csv").write_text(text, "utf-8")
    with pytest.raises(OutputError, match="decimals have commas, separate columns by semicolons or tabs"):
        read_swing(tmp_path / "log.csv", SPEC)


def test_more_whole_numbers_than_names_are_no_decimals(tmp_path):
    rows = "".join(f"{k},{round(1e4 * a)},7\n" for k, a in enumerate(ANGLES))
    (tmp_path / "log.csv").write_text(f"time [ms],angle\n{rows}", "utf-8")
    assert len(read_swing(tmp_path / "log.csv", SPEC, unit="0.0001 rad").times) == len(ANGLES)


def test_a_number_beyond_all_logs_is_told_as_that(tmp_path):
    rows = "".join(f"{FILETIME + k};{k}\n" for k in range(40))
    (tmp_path / "log.csv").write_text(f"stamp;t\n{rows}", "utf-8")
    with pytest.raises(OutputError, match=r"which is no number of a log, as it is beyond 1e\+12\."):
        read_swing(tmp_path / "log.csv", SPEC, columns=("t", "stamp"))


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("T#1h2m3s4ms", 3723.004),
        ("TIME#-5ms", -0.005),
        ("t#1.5s", 1.5),
        ("LTIME#2us300ns", 2.3e-6),
        ("T#1d_2h", 93600.0),
        ("T#", math.nan),
        ("T#5", math.nan),
        ("T#1s1h", math.nan),
    ],
)
def test_times_of_iec_61131(text, seconds):
    assert seconds_of(text) == pytest.approx(seconds, nan_ok=True)
