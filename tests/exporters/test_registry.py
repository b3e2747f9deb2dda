import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import PurePosixPath

import pytest

from gen_profile.support.errors import SpecError
from gen_profile_exporters import registry
from gen_profile_exporters.registry import (
    BUILT_IN,
    Format,
    find_container,
    find_exporter,
    format_of,
    formats,
)

PLUGIN = Format(module="json", summary="a test", proof="untested", suffix=".json")
NOT_A_FORMAT = "text"


@pytest.fixture
def plugins(monkeypatch):
    """Pretend that a package provides entry points."""

    def install(**entries):
        points = [EntryPoint(name=name, value=value, group=registry.GROUP) for name, value in entries.items()]
        monkeypatch.setattr(registry, "entry_points", lambda group: [p for p in points if p.group == group])

    sys.modules["format_plugin"] = sys.modules[__name__]
    yield install
    del sys.modules["format_plugin"]


def test_every_format_can_be_found_and_has_its_own_suffix():
    for name, form in formats().items():
        assert callable(find_exporter(name).encode)
        assert callable(find_exporter(name).replay)
        assert format_of(f"out/motion{form.suffix}") == name
    assert {"csv", "plc", "can"} <= formats().keys()


def test_those_that_carry_a_block_take_any_and_others_say_so():
    for name, form in formats().items():
        if form.holds_block:
            assert callable(find_container(name).wrap)
            assert callable(find_container(name).unwrap)
        else:
            with pytest.raises(SpecError, match=f"^{name} carries no playback block; .* are .codesys.xml"):
                find_container(name)
    assert find_container("st") is find_exporter("plc")


def test_structured_text_goes_by_two_names():
    assert find_exporter("st") is find_exporter("plc")
    assert "st" not in formats()


def test_the_longest_suffix_tells():
    assert format_of("bay.codesys.xml") == "codesys"
    assert format_of("bay.xml") == "plcopen-xml"


def test_suffixes_ignore_case():
    assert format_of(PurePosixPath("MOTION.CSV")) == "csv"


def test_unknown_formats_are_refused_with_a_suggestion():
    with pytest.raises(SpecError, match=r"^export: unknown format 'cvs'; did you mean 'csv'\?"):
        find_exporter("cvs")
    with pytest.raises(SpecError, match=r"export: unknown format 'xyz' \(known: can, codesys, csv, "):
        find_exporter("xyz")


@pytest.mark.parametrize("path", ["motion.nc", "motion", "folder.csv/motion"])
def test_unknown_suffixes_are_refused(path):
    with pytest.raises(SpecError, match=r"no format has the suffix .* \(known: .*\.csv, .*\.st, "):
        format_of(path)


def test_a_spec_is_no_artefact():
    with pytest.raises(
        SpecError, match=r"^manifest\.json: this is no exported file; name one that the manifest"
    ):
        format_of("manifest.json")
    with pytest.raises(SpecError, match=r"^bay\.toml: this is a spec; name the file that was exported"):
        format_of("bay.toml")


def test_plugins_join_in(plugins):
    plugins(extra="format_plugin:PLUGIN")
    assert formats()["extra"] == PLUGIN
    assert find_exporter("extra").__name__ == "json"
    assert format_of("x.json") == "extra"


def test_built_in_formats_win_over_plugins(plugins):
    plugins(csv="format_plugin:PLUGIN")
    assert formats() == BUILT_IN


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("format_plugin:NOT_A_FORMAT", "is no gen_profile_exporters.registry.Format"),
        ("format_plugin:missing", "cannot be loaded from format_plugin:missing"),
        ("no_such_module:FORMAT", "cannot be loaded"),
    ],
)
def test_broken_plugins_are_named(plugins, value, message):
    plugins(extra=value)
    with pytest.raises(SpecError, match=message):
        formats()
    assert find_exporter("csv")
    assert format_of("motion.csv") == "csv"


def test_listing_formats_loads_nothing_heavy():
    program = (
        "import sys; from gen_profile_exporters.registry import formats; formats(); "
        "heavy = {'numpy', 'attrs', 'attr', 'rich', 'casadi', 'scipy', 'can'}; "
        "sys.exit(', '.join(sorted(heavy & set(sys.modules))) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", program], check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
