"""The playback block in the vendors' containers: parsed and checked by others, read back by us."""

import re
import uuid

import attrs
import l5x
import numpy as np
import pytest
from blark.parse import parse as blark_parse
from lxml import etree
from motions import bang_bang, quintic, target
from playing import checked, column, play, start

from gen_profile.motion.profile import sample
from gen_profile.support.errors import ExportError
from gen_profile_exporters.block_source import parse_function_block
from gen_profile_exporters.motion_libraries import CODESYS, SIEMENS, TWINCAT
from gen_profile_exporters.playback import structured_text
from gen_profile_exporters.playback.axis_wrapper import axis_wrapper
from gen_profile_exporters.playback.structured_text import block_text
from gen_profile_exporters.vendors import codesys, plcopen_xml, rockwell_l5x, siemens_scl, twincat
from gen_profile_exporters.vendors.cam_points import quintic_points

MOVE = quintic((0.1, 0.4))
TWO_MOVES = quintic((0.1, 0.4), (1.2, -0.7))
LAYOUTS = ["segments", "samples", "counts"]
BLOCKS = {"plcopen-xml": plcopen_xml, "codesys": codesys, "twincat": twincat, "siemens-scl": siemens_scl}
CYCLE = 0.02
# Each as Structured Text has it and as XML has it, in the first table of numbers.
TABLE = r"(c(?:Power0|Position) : ARRAY [^;]*?:= \[\s*[^;]*?)"
XML_TABLE = r'(<variable name="c(?:Power0|Position)">(?:(?!</variable>).)*?)'
VALUE = r'<value>\s*<simpleValue value="[^"]*"/>\s*</value>'
MUTATIONS = {
    "wrong bounds": [
        (r"(cPower0|cPosition) : ARRAY \[0\.\.\d+\]", r"\1 : ARRAY [0..7]"),
        (rf'(?s){XML_TABLE}upper="\d+"', r'\1upper="7"'),
    ],
    "bounds from one": [
        (r"(cPower0|cPosition) : ARRAY \[0", r"\1 : ARRAY [1"),
        (rf'(?s){XML_TABLE}lower="0"', r'\1lower="1"'),
    ],
    "decimal comma": [
        (rf"{TABLE}(\d)\.(\d)", r"\1\2,\3"),
        (rf'(?s){XML_TABLE}(value="-?\d+)\.', r"\1\2,"),
        (rf"{TABLE}(\d)(,)", r"\1\2,5,"),
        (rf'(?s){XML_TABLE}(value="-?\d+)"', r'\1\2,5"'),
    ],
    "a value missing": [(rf"{TABLE}[-\d.E+]+,\s", r"\1"), (rf"(?s){XML_TABLE}{VALUE}", r"\1")],
    "a value too many": [(rf"{TABLE}([-\d.E+]+,\s)", r"\1\2\2"), (rf"(?s){XML_TABLE}({VALUE})", r"\1\2\2")],
    "an empty value": [(rf"{TABLE}[-\d.E+]+,", r"\1,"), (rf'(?s){XML_TABLE}value="[^"]+"', r'\1value=""')],
    "not a number": [
        (rf"{TABLE}[-\d.E+]+,", r"\1NaN,"),
        (rf'(?s){XML_TABLE}value="[^"]+"', r'\1value="NaN"'),
    ],
}
XHTML = "http://www.w3.org/1999/xhtml"


def goal_of(profile, layout="segments", **options):
    names = ("bridge", "trolley")[: profile.axes]
    return target(*names, **{"cycle_time": CYCLE, "export": {"plc_layout": layout}, **options})


class TestBlocks:
    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("layout", "profile"), [*zip(LAYOUTS, (MOVE, TWO_MOVES, bang_bang()), strict=True)], ids=LAYOUTS
    )
    @pytest.mark.parametrize("format_", BLOCKS.values(), ids=BLOCKS.keys())
    def test_replay_is_that_of_structured_text(self, format_, profile, layout):
        goal = goal_of(profile, layout, unit="mm")
        found = format_.replay(format_.encode(profile, goal)[0].content, goal)
        expected = structured_text.replay(structured_text.encode(profile, goal)[0].content, goal)
        assert found.payload_hash() == expected.payload_hash()
        np.testing.assert_array_equal(found.acceleration, expected.acceleration)

    @pytest.mark.parametrize("format_", BLOCKS.values(), ids=BLOCKS.keys())
    def test_an_altered_number_is_refused(self, format_):
        goal = goal_of(MOVE, "samples")
        content = format_.encode(MOVE, goal)[0].content
        literal = structured_text.literal(sample(MOVE, CYCLE).position[20, 0].item()).encode()
        assert content.count(literal) == 1
        with pytest.raises(ExportError, match="one was altered"):
            format_.replay(content.replace(literal, b"0.25"), goal)

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("format_", "layout"),
        [(structured_text, layout) for layout in LAYOUTS] + [(one, "samples") for one in BLOCKS.values()],
        ids=[*LAYOUTS, *BLOCKS],
    )
    @pytest.mark.parametrize("mutation", MUTATIONS.values(), ids=MUTATIONS.keys())
    def test_mutants_are_refused(self, mutation, format_, layout):
        goal = goal_of(TWO_MOVES, layout)
        text = format_.encode(TWO_MOVES, goal)[0].content.decode()
        mutants = [re.sub(old, new, text, count=1) for old, new in mutation]
        assert any(mutant != text for mutant in mutants)
        for mutant in mutants:
            if mutant != text:
                with pytest.raises(ExportError):
                    format_.replay(mutant.encode(), goal)

    @pytest.mark.parametrize("format_", BLOCKS.values(), ids=BLOCKS.keys())
    @pytest.mark.parametrize(
        ("old", "new"),
        [
            ("nCycle + 1", "nCycle + 2"),
            ("LREAL", "REAL"),
            ("cMoving", "cMovin"),
            ("bStopping", "bStoppin"),
            (
                "END_IF;",
                "",
            ),
        ],
    )
    def test_another_program_is_refused(self, format_, old, new):
        goal = goal_of(MOVE)
        text = format_.encode(MOVE, goal)[0].content.decode().replace("#nCycle", "nCycle")
        assert old in text
        with pytest.raises(ExportError):
            format_.replay(text.replace(old, new, 1).encode(), goal)

    @pytest.mark.parametrize("format_", BLOCKS.values(), ids=BLOCKS.keys())
    @pytest.mark.parametrize(
        "content", [b"", b"<a/>", b"<project/>", b"FUNCTION_BLOCK", b"<TcPlcObject/>", b"\xff\xfe", b"<a>"]
    )
    def test_something_else_is_refused(self, format_, content):
        with pytest.raises(ExportError):
            format_.replay(content, goal_of(MOVE))


class TestPlcopenXml:
    @pytest.mark.parametrize("layout", LAYOUTS)
    @pytest.mark.parametrize("profile", [MOVE, TWO_MOVES], ids=["one", "two"])
    @pytest.mark.parametrize("format_", [plcopen_xml, codesys], ids=["plcopen-xml", "codesys"])
    def test_it_is_valid(self, tc6_schema, format_, profile, layout):
        """CODESYS writes the namespace of version 2.0, whose schema no registry has."""
        (file,) = format_.encode(profile, goal_of(profile, layout))
        tc6_schema.assertValid(etree.fromstring(file.content.replace(b"/tc6_0200", b"/tc6_0201")))

    def test_beremiz_and_openplc_find_the_statements(self):
        """Their reader (xmlclass.py in both) takes the text of the first ``p`` that ``ST`` holds."""
        root = etree.fromstring(plcopen_xml.encode(MOVE, goal_of(MOVE))[0].content)
        names = {"tc6": "http://www.plcopen.org/xml/tc6_0201", "ns": XHTML}
        (statements,) = root.xpath(
            "/tc6:project/tc6:types/tc6:pous/tc6:pou/tc6:body/tc6:ST", namespaces=names
        )
        assert (
            statements.xpath("ns:p", namespaces=names)[0].text
            == parse_function_block(block_text(MOVE, goal_of(MOVE))).body
        )
        # What it rewrites before parsing would need a prefix that our document does not declare.
        assert b"CDATA" not in etree.tostring(root) and b"]]>" not in etree.tostring(root)

    def test_codesys_finds_the_statements(self):
        """Where its own exports have them."""
        root = etree.fromstring(codesys.encode(MOVE, goal_of(MOVE))[0].content)
        assert root.tag == "{http://www.plcopen.org/xml/tc6_0200}project"
        bodies = root.findall(f".//{{*}}body/{{*}}ST/{{{XHTML}}}xhtml")
        assert len(bodies) == len(root.findall(".//{*}pou")) == 3
        assert bodies[0].text == parse_function_block(block_text(MOVE, goal_of(MOVE))).body

    def test_no_entity_is_expanded(self):
        text = (
            '<!DOCTYPE a [<!ENTITY e SYSTEM "file:///etc/hostname">]>'
            f'<project xmlns="{plcopen_xml.TC6.namespace}"><types><pous><pou name="&e;"/></pous></types>'
            "</project>"
        )
        with pytest.raises(ExportError):
            plcopen_xml.replay(text.encode(), goal_of(MOVE))

    def test_variables_keep_their_comments(self):
        root = etree.fromstring(plcopen_xml.encode(MOVE, goal_of(MOVE))[0].content)
        (variable,) = root.iterfind(".//{*}inputVars/{*}variable[@name='bHold']")
        assert "go on when it drops" in "".join(variable.itertext())


class TestCodesys:
    def test_the_cam_holds_the_quintics(self):
        goal = goal_of(TWO_MOVES, unit="mm")
        root = etree.fromstring(codesys.encode(TWO_MOVES, goal)[0].content)
        assert [pou.get("name") for pou in root.iterfind(".//{*}pou")] == [
            "FB_bay_3", "FB_bay_3_Axis", "FB_bay_3_Cam1", "FB_bay_3_Cam2",
        ]  # fmt: skip
        points = quintic_points(TWO_MOVES, goal)
        for number in (1, 2):
            (cam,) = root.iterfind(f".//{{*}}pou[@name='FB_bay_3_Cam{number}']")
            for member, values in (
                ("dX", points.time),
                ("dY", points.position[:, number - 1]),
                ("dV", points.velocity[:, number - 1]),
                ("dA", points.acceleration[:, number - 1]),
            ):
                found = cam.iterfind(f".//{{*}}structValue/{{*}}value[@member='{member}']/{{*}}simpleValue")
                assert [float(value.get("value")) for value in found] == values.tolist()


@pytest.mark.parametrize("library", [TWINCAT, CODESYS, SIEMENS])
@pytest.mark.parametrize("move", [MOVE, TWO_MOVES])
def test_a_wrapper_takes_and_tells_all_but_positions(library, move):
    block = parse_function_block(block_text(move, goal_of(move)))
    wrapper = axis_wrapper(block, move.axes, library)
    outer, inner = (
        {v.name: v for v in source.variables if v.section in {"VAR_INPUT", "VAR_OUTPUT"}}
        for source in (wrapper, block)
    )
    positions = {"fActPosition", "fPosition", "fVelocity", "fAcceleration"}
    assert inner.keys() - outer.keys() == positions
    assert all(outer[name] == inner[name] for name in outer)
    call = re.search(r"fbMotion\((.*?)\);", wrapper.body, re.DOTALL)[1]
    assert set(re.findall(r"(\w+) :=", call)) == {v.name for v in block.variables if v.section == "VAR_INPUT"}
    copied = [name for name in outer if outer[name].section == "VAR_OUTPUT"]
    assert all(len(re.findall(rf"^{name} := .*;$", wrapper.body, re.MULTILINE)) == 1 for name in copied)
    own = [v.name for v in wrapper.variables if v.section == "VAR"]
    assert all(re.search(rf"\b{name}\b", wrapper.body) for name in own)


class TestTwincat:
    @pytest.mark.slow
    def test_blark_parses_block_and_wrapper(self, tmp_path):
        goal = goal_of(quintic((0.1, 0.4)), cycle_time=0.5)
        for file in twincat.encode(MOVE, goal)[:2]:
            (tmp_path / file.filename).write_bytes(file.content)
            for part in blark_parse(tmp_path / file.filename):
                assert part.exception is None
                assert part.transform() is not None

    def test_points_count_from_one_without_gaps(self):
        move = bang_bang()
        (*_, variables) = twincat.encode(move, goal_of(move))
        text = "".join(etree.fromstring(variables.content).itertext())
        indices = [int(index) for index in re.findall(r"PointIndex := (\d+)", text)]
        assert indices == list(range(1, len(indices) + 1))
        assert f"ARRAY [1..{len(indices)}]" in text
        assert [int(n) for n in re.findall(r"RelIndexNextPoint := (\d)", text)] == [1] * (
            len(indices) - 1
        ) + [0]
        times = [float(time) for time in re.findall(r"MasterPos := ([^,]+),", text)]
        np.testing.assert_array_equal(times, quintic_points(move, goal_of(move)).time)

    def test_identifiers_are_stable_and_their_own(self):
        def identifiers(profile, **options):
            files = twincat.encode(profile, goal_of(profile, **options))
            return [uuid.UUID(etree.fromstring(file.content)[0].get("Id")) for file in files]

        assert identifiers(MOVE) == identifiers(bang_bang())
        assert len(set(identifiers(MOVE) + identifiers(MOVE, name="bay-4"))) == 6


class TestSiemens:
    def test_own_names_are_marked_and_others_not(self):
        text = siemens_scl.encode(TWO_MOVES, goal_of(TWO_MOVES))[0].content.decode()
        body = text[text.index("\nBEGIN") :]
        assert "#fbMotion(\n    bExecute := #bExecuteNow" in body
        assert "#LREAL" not in body
        assert not re.search(
            r"(?<![#\w.])(nCycle|fPosition|cLast)\b(?!\s*:)", re.sub(r"\(\*.*?\*\)", "", body)
        )

    def test_tables_are_no_constants(self):
        text = siemens_scl.encode(MOVE, goal_of(MOVE))[0].content.decode()
        constants = text[text.index("VAR CONSTANT") : text.index("END_VAR", text.index("VAR CONSTANT"))]
        assert "ARRAY" not in constants
        assert "cPower5 : ARRAY" in text

    def test_points_of_the_cam(self):
        goal = goal_of(TWO_MOVES, unit="mm")
        text = siemens_scl.encode(TWO_MOVES, goal)[-1].content.decode()
        points = {
            name: np.array(
                re.findall(rf"{name}\[\d+\]\.x := (\S+);\n\s+{name}\[\d+\]\.y := (\S+);", text), float
            )
            for name in ("Point1", "Point2")
        }
        motion = sample(TWO_MOVES, CYCLE)
        for axis, table in enumerate(points.values()):
            assert f"Array[1..{len(table)}] of TO_Cam_Struct_PointData" in text
            cycles = np.rint(table[:, 0] / CYCLE).astype(int)
            np.testing.assert_allclose(table[:, 1], 1e3 * motion.position[cycles, axis], rtol=1e-15)

    def test_a_table_larger_than_an_optimised_data_block_is_refused(self, monkeypatch):
        """64 kB are a standard block's; these are optimised."""
        move = quintic((0, 1), duration=3.0)
        goal = goal_of(move, "samples", cycle_time=0.001)
        text = siemens_scl.encode(move, goal)[0].content.decode()
        assert text.count("S7_Optimized_Access := 'TRUE'") == text.count("END_FUNCTION_BLOCK")
        monkeypatch.setattr(siemens_scl, "MOST_BYTES", 72_000)
        with pytest.raises(ExportError, match=r"numbers take 0\.07 MB, an optimised data block .* 0\.072 MB"):
            siemens_scl.encode(move, goal)


class TestRockwell:
    def test_another_library_reads_the_points(self, tmp_path):
        move = bang_bang()
        goal = goal_of(move, unit="mm")
        (file,) = rockwell_l5x.encode(move, goal)
        (tmp_path / file.filename).write_bytes(file.content)
        tag = l5x.Project(str(tmp_path / file.filename)).controller.tags["Cam_bay_3"]
        points = np.array([[tag[k]["Master"].value, tag[k]["Slave"].value] for k in range(tag.shape[0])])
        assert {tag[k]["SegmentType"].value for k in range(tag.shape[0])} == {1}
        cycles = np.rint(points[:, 0] / CYCLE).astype(int)
        exact = sample(move, CYCLE).position[cycles, 0]
        np.testing.assert_array_equal(points[:, 1].astype(np.float32), (1e3 * exact).astype(np.float32))
        assert (
            f"error {rockwell_l5x.spline_error(sample(move, CYCLE), cycles, single=True):.2g} m"
            in tag.description
        )

    def test_tags_of_long_names_are_valid_and_apart(self):
        """Logix takes 40 characters, no underscore at the end and no two in a row."""
        tags = []
        for end in ("north", "south"):
            goal = attrs.evolve(
                goal_of(TWO_MOVES), name=f"the third bay of hall - and its cranes, {end}".replace(",", "")
            )
            (file,) = rockwell_l5x.encode(TWO_MOVES, goal)
            root = etree.fromstring(file.content)
            tags.append({one.get("Name") for one in (*root.iter("Tag"), *root.iter("Routine"))})
        assert not tags[0] & tags[1] - {"Timebase"}
        for name in set.union(*tags):
            assert re.fullmatch(r"[A-Za-z](_?[A-Za-z0-9])*", name) and len(name) <= 40, name

    def test_profiles_are_calculated_once_after_an_import(self, tmp_path):
        """Structured Text runs MCCP in every scan that reaches it, and so would begin anew without end."""
        (file,) = rockwell_l5x.encode(TWO_MOVES, goal_of(TWO_MOVES))
        (tmp_path / file.filename).write_bytes(file.content)
        tags = l5x.Project(str(tmp_path / file.filename)).controller.tags
        text = "\n".join(line.text for line in etree.fromstring(file.content).iter("Line"))
        for name in ("Cam_bay_3_1", "Cam_bay_3_2"):
            assert tags[f"{name}_Calculate"].value == 1
            guarded = (
                rf"IF {name}_Calculate AND \({name}_Profile\[0\].Status <= 2\) THEN\s+MCCP\({name}_Control, "
            )
            assert re.search(guarded + rf"[^;]*;\s+{name}_Calculate := 0;\s+END_IF;", text)
        assert text.count("MCCP(") == 2

    @pytest.mark.parametrize("profile", [MOVE, TWO_MOVES, bang_bang()], ids=["one", "two", "rough"])
    def test_positions_come_back_within_the_stated_error(self, profile):
        goal = goal_of(profile, unit="mm", sign=-1)
        found = rockwell_l5x.replay(rockwell_l5x.encode(profile, goal)[0].content, goal)
        error = np.abs(found.position - sample(profile, CYCLE).position).max()
        assert error <= rockwell_l5x.POINT_ERROR
        assert (found.resolution > 0.0).all()

    def test_few_points_are_enough_for_a_smooth_move(self):
        content = rockwell_l5x.encode(MOVE, goal_of(MOVE, cycle_time=0.001))[0].content
        assert 8 <= content.count(b'"Master"') <= 64

    def test_too_many_points_are_refused(self, monkeypatch):
        monkeypatch.setattr(rockwell_l5x, "MOST_POINTS", 3)
        with pytest.raises(ExportError, match=r"rockwell-l5x, CAM: \d+ points would be needed, it holds 3;"):
            rockwell_l5x.encode(bang_bang(), goal_of(MOVE))

    def test_positions_too_far_for_a_real_are_refused(self):
        with pytest.raises(
            ExportError, match=r"CAM: its numbers are so coarse .* m of error remain .*, 1e-05 m are allowed"
        ):
            rockwell_l5x.encode(quintic((1000.0, 1000.3)), goal_of(MOVE))

    @pytest.mark.parametrize(
        ("old", "new", "message"),
        [
            ('Value="1"/>', 'Value="0"/>', "the segment is not cubic"),
            ('Name="Slave" DataType="REAL" Radix="Float" Value="', "\\g<0>,", "which is no REAL"),
            ('Name="Slave" DataType="REAL" Radix="Float" Value="', "\\g<0>9.0e99", "which is no REAL"),
            (r'Dimensions="\d+">\s+<Element', 'Dimensions="5"><Element', "points of 5"),
            ('Name="Master"', 'Name="Mister"', "Master.* is missing"),
            (r'Value="0\.0e\+0"', 'Value="0.5"', "times must rise from 0"),
            ('Name="Cam_bay_3"', 'Name="Cam"', "is missing"),
            ('Value="1"', "", "Value is missing"),
        ],
    )
    def test_damaged_points_are_refused(self, old, new, message):
        text = rockwell_l5x.encode(MOVE, goal_of(MOVE))[0].content.decode()
        altered = re.sub(old, new, text, count=1)
        assert altered != text
        with pytest.raises(ExportError, match=message):
            rockwell_l5x.replay(altered.encode(), goal_of(MOVE))

    def test_axes_at_different_times_are_refused(self):
        goal = goal_of(TWO_MOVES)
        text = rockwell_l5x.encode(TWO_MOVES, goal)[0].content.decode()
        last = text.rindex('Name="Master"')
        altered = text[:last] + re.sub(r'Value="[^"]*"', 'Value="2.0"', text[last:], count=1)
        with pytest.raises(ExportError, match="different times"):
            rockwell_l5x.replay(altered.encode(), goal)

    def test_another_cycle_time_is_refused(self):
        content = rockwell_l5x.encode(MOVE, goal_of(MOVE))[0].content
        with pytest.raises(ExportError, match=r"no multiple of export\.cycle_time"):
            rockwell_l5x.replay(content, goal_of(MOVE, cycle_time=0.3))


class TestTakingApart:
    @pytest.mark.slow
    @pytest.mark.parametrize("layout", LAYOUTS)
    @pytest.mark.parametrize("profile", [MOVE, TWO_MOVES], ids=["one", "two"])
    def test_the_parts_make_the_same_program(self, profile, layout):
        goal = goal_of(profile, layout)
        text = structured_text.block_text(profile, goal)
        again = parse_function_block(parse_function_block(text).text()).text()
        assert structured_text.read_table(again, goal).motion().payload_hash()
        fb, other = checked(text), checked(again)
        rows = play(fb, start(fb))
        np.testing.assert_array_equal(column(play(other, start(other)), "position"), column(rows, "position"))

    @pytest.mark.parametrize("text", ["", "PROGRAM x END_PROGRAM", "FUNCTION_BLOCK x VAR END_VAR"])
    def test_no_block_is_refused(self, text):
        with pytest.raises(ExportError, match="export it again"):
            parse_function_block(text)
