"""The record beside the artefacts."""

import hashlib
import json

import attrs
import pytest

from gen_profile.support.artefacts.manifest import PLANNER, Artefact, Manifest, parse_manifest, sha256
from gen_profile.support.errors import OutputError

ARTEFACT = Artefact(format="csv", path="brücke.csv", sha256="00", bytes=3, payload_sha256="11")
MANIFEST = Manifest(
    name="brücke",
    spec={"name": "brücke", "move": {"duration": 3.0}},
    spec_sha256="22",
    profile_sha256="33",
    versions={"gen-profile": "0.1.0"},
    artefacts=(ARTEFACT,),
    check={"passed": True},
)


@pytest.mark.parametrize("manifest", [MANIFEST, attrs.evolve(MANIFEST, check=None, artefacts=())])
def test_reads_what_it_writes(manifest):
    assert parse_manifest(manifest.to_json(), "manifest.json") == manifest


def test_is_plain_utf_8_json_that_ends_in_a_newline():
    content = MANIFEST.to_json()
    assert content.endswith(b"}\n")
    assert "brücke".encode() in content
    document = json.loads(content)
    assert (document["format"], document["format_version"]) == ("gen-profile manifest", 1)
    assert document["artefacts"] == [attrs.asdict(ARTEFACT)]
    assert document["check"] == {"passed": True}


def test_of_two_exports_of_the_same_bytes_a_file_belongs_to_that_of_its_name():
    """Two CAN logs may be alike, and their start-up lists not; a renamed copy is of the latest."""

    def export(name):
        files = {f"{name}.log": "00", f"{name}.dbc": name}
        made = (Artefact(format="can", path=one, sha256=hash_, bytes=1) for one, hash_ in files.items())
        return attrs.evolve(MANIFEST, name=name, artefacts=(*made, ARTEFACT))

    both = export("b").after(export("a"))
    for name, due in {"a.log": "a", "b.log": "b", "copy.log": "b"}.items():
        found = both.covering(name, "00")
        assert (found.name, found.companions(name, "00")) == (due, {f"{due}.dbc": due})
    assert both.covering("a.log", "altered").companions("a.log", "altered") == {"a.dbc": "a"}
    assert both.companions("brücke.csv", "00") == {} == both.companions("unknown", "altered")


def test_a_file_by_the_name_of_another_is_of_that_name():
    """Two motions whose files had changed places were taken for each other."""

    def export(name, format_="csv"):
        return attrs.evolve(
            MANIFEST, name=name, artefacts=(attrs.evolve(ARTEFACT, path=name, sha256=name, format=format_),)
        )

    both = export("b").after(export("a"))
    assert both.covering("a", "b").name == "a" and both.covering("b", "a").name == "b"
    assert both.covering("copy", "a").name == "a"
    block = export("b", PLANNER).after(export("a"))
    assert block.covering("a", "b", planner=True) is None and block.covering("b", "a") is None


def test_what_only_an_earlier_export_of_a_name_wrote_is_left_over():
    def export(name, *files, format_="can"):
        made = (Artefact(format=format_, path=one, sha256=one, bytes=1) for one in files)
        return attrs.evolve(MANIFEST, name=name, artefacts=tuple(made))

    first, other = export("a", "a.log", "a.dbc", "a.csv"), export("b", "b.log", "b.dbc")
    table = export("a", "a.st", format_="plc")
    latest = export("a", "a.log", "a.csv").after(table.after(other.after(first)))
    assert latest.left_over("a.log", "altered") == ["a.dbc"]
    assert latest.companions("a.log", "altered") == {"a.csv": "a.csv"}
    assert latest.covering("b.log", "b.log").left_over("b.log", "b.log") == []
    assert latest.left_over("unknown", "unknown") == []


def test_says_unverified_without_a_check():
    assert json.loads(attrs.evolve(MANIFEST, check=None).to_json())["check"] == "unverified"


def change(**changes):
    document = json.loads(MANIFEST.to_json())
    for key, value in changes.items():
        if value is None:
            del document[key]
        else:
            document[key] = value
    return json.dumps(document).encode()


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\xff\xfe",
        b"[]",
        b"null",
        b'"text"',
        b"{}",
        MANIFEST.to_json()[:-20],
        change(format="something else"),
        change(format_version=2),
        change(artefacts=[{"format": "csv"}]),
        change(artefacts=[1]),
        change(artefacts=None),
        change(spec=None),
        change(surplus=1),
    ],
)
def test_refuses_what_is_no_manifest(content):
    with pytest.raises(OutputError, match=r"^out/manifest\.json: not a manifest of this version .*\.$"):
        parse_manifest(content, "out/manifest.json")


def change_deeply(document, key, value):
    *path, last = key
    for step in path:
        document = document[step]
    document[last] = value


@pytest.mark.parametrize(
    ("key", "value"),
    [
        (("spec", "move", "duration"), 2.0),
        (("spec_sha256",), "23"),
        (("check", "passed"), 1),
        (("check",), "unverified"),
        (("artefacts", 0, "sha256"), "01"),
        (("versions", "gen-profile"), "0.2.0"),
        (("earlier", 0, "check", "passed"), False),
        (("manifest_sha256",), "0"),
        (("manifest_sha256",), None),
    ],
)
def test_an_altered_one_vouches_for_nothing(key, value):
    document = json.loads(exported("b", "b.csv").after(exported("a", "a.csv")).to_json())
    change_deeply(document, key, value)
    with pytest.raises(OutputError, match=r"^manifest\.json was altered .*export again\.$"):
        parse_manifest(json.dumps(document).encode(), "manifest.json")


def test_layout_and_order_do_not_matter():
    document = dict(reversed(json.loads(MANIFEST.to_json()).items()))
    assert parse_manifest(json.dumps(document, indent=7).encode(), "manifest.json") == MANIFEST


def exported(name, *paths):
    artefacts = tuple(
        attrs.evolve(ARTEFACT, path=path, sha256=sha256(f"{name} {path}".encode())) for path in paths
    )
    return attrs.evolve(MANIFEST, name=name, artefacts=artefacts)


class TestSeveralExportsIntoOneFolder:
    def test_what_is_not_replaced_is_kept(self):
        first, second = exported("a", "a.csv", "a.st"), exported("b", "b.csv")
        third = exported("a", "a.st").after(second.after(first))
        assert third.artefacts == exported("a", "a.st").artefacts
        assert [(one.name, [kept.path for kept in one.artefacts]) for one in third.earlier] == [
            ("b", ["b.csv"]),
            ("a", ["a.csv"]),
        ]
        assert parse_manifest(third.to_json(), "manifest.json") == third

    def test_an_export_that_replaces_everything_is_alone(self):
        assert exported("a", "a.csv").after(exported("a", "a.csv")) == exported("a", "a.csv")

    def test_a_file_is_found_by_content_then_by_name(self):
        both = exported("b", "b.csv").after(exported("a", "a.csv"))
        (own,) = exported("a", "a.csv").artefacts
        assert both.covering("renamed.csv", own.sha256).name == "a"
        assert both.covering("a.csv", "altered").name == "a"
        assert both.covering("b.csv", "altered").name == "b"
        assert both.covering("renamed.csv", "altered").name == "b"


def test_hashes_as_others_do():
    assert sha256(b"load") == hashlib.sha256(b"load").hexdigest()
