"""Logs that are refused show what they hold: a spectrum its peaks, and every one a picture of its columns."""

import numpy as np
import pytest
from command_line import error_of, run_here

from gen_profile.spec.reading import preset_spec
from gen_profile.studies.identification.identify import read_swing
from gen_profile.support.errors import OutputError

SPEC = preset_spec("mass-spring-chain")


def peak(frequencies, at, height):
    share = frequencies / at
    return height / ((1.0 - share**2) ** 2 + (0.1 * share) ** 2)


def spectrum(folder, head="freq,psd_x,psd_y,psd_z,psd_xyz,mzv(48.4)", comma=False):
    """What Klipper's TEST_RESONANCES writes: an axis with two modes, and another axis's beside it."""
    frequencies = np.arange(0.0, 205.0, 1.6)
    x = peak(frequencies, 48.5, 20.0) + peak(frequencies, 95.0, 3.0)
    y, z = peak(frequencies, 60.0, 2.0), np.full(len(frequencies), 2.0)
    columns = np.column_stack([frequencies, x, y, z, x + y + z, 0.0 * x + 0.01])
    rows = [head, *(",".join(f"{value:.3e}" for value in row) for row in columns)]
    text = "\n".join(rows) + "\n"
    path = folder / "resonances_x.csv"
    path.write_text(text.replace(",", ";").replace(".", ",") if comma else text, "utf-8")
    return path


@pytest.mark.parametrize("head", ["freq,psd_x,psd_y,psd_z,psd_xyz,mzv(48.4)", "#Frequency (Hz),a,b,c,d,e"])
@pytest.mark.parametrize("comma", [False, True])
def test_a_spectrum_is_refused_with_the_periods_of_its_peaks(tmp_path, head, comma):
    with pytest.raises(OutputError) as refused:
        read_swing(spectrum(tmp_path, head, comma), SPEC)
    assert "spectrum with peaks at 48 and 94.4 Hz" in str(refused.value)
    assert str(refused.value).endswith("such as --period 0.02083±0.00035 --period 2:0.01059±9e-05.")


@pytest.mark.parametrize("rows", ["", "0,1\n", "1,2\n2,x\n", "1\n2\n", "5,1\n5,9\n5,1\n", "nan,3\n"])
def test_a_spectrum_without_a_peak_is_refused(tmp_path, rows):
    (tmp_path / "log.csv").write_text(f"freq,psd_x\n{rows}", "utf-8")
    with pytest.raises(OutputError, match=r"this is a spectrum, and no swing|no column '2'"):
        read_swing(tmp_path / "log.csv", SPEC)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (None, "this is a spectrum"),
        ("time,angle\n0,1\n0.1,2\n0.2,1\n", "at least 16 samples"),
        ("time,angle [V]\n" + "".join(f"{k},{k % 3}\n" for k in range(40)), "is in V"),
        ("time,angle\n" + "".join(f"{k},{'x' * (k % 2) or 1}\n" for k in range(40)), "which is no number"),
    ],
)
def test_every_refusal_has_a_picture(tmp_path, monkeypatch, text, sentence):
    monkeypatch.chdir(tmp_path)
    log = spectrum(tmp_path) if text is None else tmp_path / "log.csv"
    if text is not None:
        log.write_text(text, "utf-8")
    assert sentence in error_of(
        "identify", "--preset", "mass-spring-chain", "--swing", log, "--plot", "seen.svg"
    )
    drawn = (tmp_path / "seen.svg").read_text("utf-8")
    assert "Refused" in drawn and ("psd_x" in drawn or "angle" in drawn)
    assert not (tmp_path / "identified.toml").exists()


def test_what_holds_no_number_has_none(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "log.csv").write_text("nothing,here\nat,all\n", "utf-8")
    command = ("identify", "--preset", "mass-spring-chain", "--swing", "log.csv", "--plot", "seen.svg")
    outcome = run_here(*command)
    assert outcome.code == 2 and not (tmp_path / "seen.svg").exists()
    assert outcome.err.count("Error:") == 1


def test_a_raw_log_of_klipper_is_a_swing(tmp_path):
    times = np.arange(0.0, 1.2, 1.0 / 3200.0)
    ring = 3000.0 * np.exp(-9.0 * times) * np.cos(2.0 * np.pi * 48.5 * times)
    noise = np.random.default_rng(2).normal(0.0, 60.0, (3, len(times)))
    rows = zip(times + 1234.5, ring + noise[0], noise[1], 9810.0 + noise[2], strict=True)
    text = "##accel_chip='adxl345'\n#time,accel_x,accel_y,accel_z\n"
    text += "".join("{:.6f},{:.6f},{:.6f},{:.6f}\n".format(*row) for row in rows)
    (tmp_path / "raw.csv").write_text(text, "utf-8")
    log = read_swing(tmp_path / "raw.csv", SPEC, signal="acceleration", unit="mm/s²")
    assert len(log.times) == len(times) and log.times[0] == 0.0
    np.testing.assert_allclose(log.values[:20], (ring + noise[0])[:20] / 1e3, atol=0.3)


def test_names_that_look_like_formulas_or_markup_are_drawn_as_they_are(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a $x$ log.csv").write_text("time,$\\frac{a$,<b>&amp;\n1,2,3\n2,3,4\n5,6,x\n", "utf-8")
    command = ("identify", "--preset", "mass-spring-chain", "--swing", "a $x$ log.csv", "--plot", "seen.svg")
    outcome = run_here(*command)
    assert outcome.code == 2 and "Internal error" not in outcome.err
    assert r"$\frac{a$" in (tmp_path / "seen.svg").read_text("utf-8")
