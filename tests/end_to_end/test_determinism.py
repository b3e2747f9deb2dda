"""The same spec gives the same bytes, wherever and however it is run."""

import locale
import os

import numpy as np
import pytest
from command_line import run_process
from system_parts import missing

pytestmark = pytest.mark.slow

FORMATS = ("--export", "csv", "--export", "plc", "--export", "can")
GERMAN = "de_DE.UTF-8"


def outputs(folder, **environment):
    folder.mkdir()
    outcome = run_process(*FORMATS, "--json", cwd=folder, **environment)
    assert outcome.code == 0, outcome.err
    document = outcome.document
    del document["solver"]["time_s"]
    return document, {path.name: path.read_bytes() for path in sorted((folder / "gen-profile-out").iterdir())}


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    folder = tmp_path_factory.mktemp("first") / "run"
    return outputs(folder, PYTHONHASHSEED="0", LC_ALL="C.UTF-8", TZ="UTC")


def test_a_second_run_with_another_time_zone_hash_seed_and_letters_of_ascii_alone(first, tmp_path):
    environment = {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}
    assert outputs(tmp_path / "run", PYTHONHASHSEED="4242", TZ="Asia/Kathmandu", **environment) == first


def test_a_german_locale_with_its_decimal_comma_in_a_folder_elsewhere(first, tmp_path):
    before = locale.setlocale(locale.LC_ALL)
    try:
        locale.setlocale(locale.LC_ALL, GERMAN)
        assert locale.localeconv()["decimal_point"] == ","
    except locale.Error:
        missing(f"the locale {GERMAN} (localedef -i de_DE -f UTF-8 {GERMAN})")
    finally:
        locale.setlocale(locale.LC_ALL, before)
    folder = tmp_path / "anderer Ort, weit weg ‒ très loin"
    assert outputs(folder, LC_ALL=GERMAN, LANG=GERMAN, LANGUAGE="de") == first


@pytest.mark.parametrize("kernels", ["Haswell", "SkylakeX"])
def test_a_processor_with_other_kernels_of_blas(first, tmp_path, kernels):
    assert outputs(tmp_path / "run", OPENBLAS_CORETYPE=kernels) == first


def test_a_processor_without_wide_registers(first, tmp_path):
    rare = (
        "X86_V3 X86_V4" if np.lib.NumpyVersion(np.__version__) >= "2.4.0" else "AVX2 FMA3 AVX512F AVX512_SKX"
    )
    assert outputs(tmp_path / "run", NPY_DISABLE_CPU_FEATURES=rare) == first


def test_artefacts_name_neither_machine_nor_clock(first, tmp_path):
    _, files = first
    for name, content in files.items():
        for word in ("/tmp", "/home", "/root", os.uname().nodename, "gen-profile-out"):
            assert word.encode() not in content
        if name.endswith((".json", ".csv", ".st", ".log")):
            text = content.decode("utf-8")
            assert "\r" not in text
            assert text.endswith("\n")
