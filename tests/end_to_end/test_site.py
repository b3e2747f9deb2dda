"""The documentation as a site: built without a warning, searched offline, and without a fault for axe."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from headless import browser

import gen_profile

ROOT = Path(__file__).parents[2]


def test_the_python_reference_lists_every_public_name_once():
    listed = re.findall(r"^`[\w`, ]+$", (ROOT / "docs" / "api.md").read_text("utf-8"), re.MULTILINE)
    names = [name for line in listed for name in re.findall(r"`(\w+)`", line)]
    assert sorted([*names, "__version__"]) == dir(gen_profile)


@pytest.mark.slow
def test_builds_and_can_be_searched_offline(tmp_path):
    build = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-c", "docs", ".", str(tmp_path)]
    done = subprocess.run(build, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    api = (tmp_path / "docs" / "api.html").read_text("utf-8")
    assert all(f'id="gen_profile.{name}"' in api for name in dir(gen_profile) if not name.startswith("_"))
    with browser() as page:
        page.visit((tmp_path / "index.html").as_uri())
        page.wait("return document.querySelector('h1') !== null")
        assert page.violations() == []
        page.complaints()  # of axe-core, which may not read style sheets, are left behind
        page.find(".sidebar-search").send_keys("freeboard\n")
        page.wait("return document.querySelectorAll('#search-results li').length > 0")
        found = page.run(
            "return [...document.querySelectorAll('#search-results li a')].map((link) => link.href)"
        )
        assert any("docs/machines.html" in address for address in found)
        assert page.complaints() == []  # of a page that may not read another one
        page.visit((tmp_path / "docs" / "plc.html").as_uri())
        assert page.violations() == []
