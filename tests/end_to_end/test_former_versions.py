"""Files kept from former versions of the program: how manifests and certificates of other versions are read.

`former` holds what `gen-profile SPEC --out FOLDER` and `check FOLDER/kept.csv --certify` wrote at two
commits, by their dates (bf37a762 and f97690ff); docs/check.md states the policy. The spec of the
first one is written otherwise today, as a key of it is new.
"""

import json
import shutil
from pathlib import Path

import pytest
from command_line import error_of, run_here

from gen_profile.spec.reading import spec_from_dict
from gen_profile.support.artefacts.manifest import SEAL, seal_of
from gen_profile_recheck.__main__ import main as recheck

FORMER = sorted((Path(__file__).parent / "former").iterdir())
SPEC = """
name = "kept"
plant = { type = "slosh-tank" }
move = { distance = 0.5, duration = 4.0 }
check.residual_sway = 0.01
export.cycle_time = 0.05
"""


@pytest.fixture(params=FORMER, ids=lambda folder: folder.name)
def former(request, tmp_path):
    folder = tmp_path / "former"
    shutil.copytree(request.param, folder)
    return folder


def spec_words(folder, named):
    """Name a spec, or leave it to the manifest."""
    if not named:
        return ()
    (folder / "kept.toml").write_text(SPEC, "utf-8")
    return (folder / "kept.toml",)


def test_one_of_them_holds_a_spec_that_is_written_otherwise_today():
    """Else the other tests show nothing."""
    specs = [json.loads((folder / "manifest.json").read_text("utf-8"))["spec"] for folder in FORMER]
    assert any(spec_from_dict(spec).sha256() != seal_of(spec) for spec in specs)


@pytest.mark.slow
@pytest.mark.parametrize("named", [False, True])
def test_a_file_is_known_by_its_manifest_whatever_keys_were_added_since(former, named):
    words = spec_words(former, named)
    judged = run_here("check", former / "kept.csv", *words, "--json")
    assert (judged.code, judged.document["artefact"]["manifest"]) == (0, "matches")
    text = (former / "kept.csv").read_text("utf-8")
    assert "0.000266036" in text  # m
    (former / "kept.csv").write_text(text.replace("0.000266036", "0.000266038"), "utf-8")
    judged = run_here("check", former / "kept.csv", *words, "--json")
    assert (judged.code, judged.document["artefact"]["manifest"]) == (4, "differs")


@pytest.mark.slow
def test_a_certificate_is_about_the_manifest_as_it_stands(former):
    files = [former / name for name in ("kept.csv", "kept.csv.certificate.json")]
    made = run_here("check", files[0], "--certify")
    assert made.code == 0, made.err
    assert run_here("check", files[0], "--certificate", files[1]).code == 0
    assert recheck([*map(str, files), str(former / "manifest.json")]) == 0


@pytest.mark.slow
def test_a_certificate_holds_as_long_as_its_form_is_read(former):
    files = [former / name for name in ("kept.csv", "kept.csv.certificate.json")]
    judged = run_here("check", files[0], "--certificate", files[1])
    again = recheck([*map(str, files), str(former / "manifest.json")])
    if former_name(former) == "2026-11-23":
        assert judged.code == 4 and again != 0
        assert "damaged, or of another version" in judged.err and "certify the file again" in judged.err
    else:
        assert (judged.code, again) == (0, 0)


def former_name(folder):
    """Find which it was copied from."""
    manifest = (folder / "manifest.json").read_bytes()
    return next(one.name for one in FORMER if (one / "manifest.json").read_bytes() == manifest)


def test_a_later_version_s_key_is_refused_by_a_sentence_that_names_the_version(former):
    document = json.loads((former / "manifest.json").read_text("utf-8"))
    document["spec"]["limits"]["comfort"] = 1.0
    document["versions"]["gen-profile"] = "7.0.0"
    del document[SEAL]
    document[SEAL] = seal_of(document)
    (former / "manifest.json").write_text(json.dumps(document), "utf-8")
    assert "which gen-profile 7.0.0 wrote, is faulty: limits.comfort" in error_of(
        "check", former / "kept.csv"
    )
