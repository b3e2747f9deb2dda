"""What a distribution holds beside the packages.

That is the commit that it is built from, which `gen-profile --version` tells, and in a wheel the manual's
pages, which the studio shows.
"""

import re
import subprocess
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PLACES = {"sdist": "commit.txt", "wheel": "gen_profile/commit.txt"}


class DistributionHook(BuildHookInterface):
    """Adds files to both distributions; the source archive hands its own on to the wheel."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Find or write the files."""
        kept = Path(self.root, PLACES["sdist"])
        if version == "editable":
            return
        if self.target_name == "wheel":
            build_data["force_include"] |= {
                str(file): f"gen_profile/docs/{file.name}" for file in manual_files(Path(self.root, "docs"))
            }
        if not kept.exists():
            commit = _commit(Path(self.root))
            if not commit:
                return
            kept = self._written
            kept.parent.mkdir(parents=True, exist_ok=True)
            kept.write_text(f"{commit}\n", "utf-8")
        build_data["force_include"][str(kept)] = PLACES[self.target_name]

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove what was written."""
        self._written.unlink(missing_ok=True)

    @property
    def _written(self) -> Path:
        return Path(self.directory, f".{self.target_name}-commit.txt")


def manual_files(docs: Path) -> list[Path]:
    """List the manual's pages, and the pictures that are on them."""
    pages = sorted(docs.glob("*.md"))
    shown = {
        name for page in pages for name in re.findall(r"!\[[^]]*\]\(([\w-]+\.png)\)", page.read_text("utf-8"))
    }
    return [*pages, *(docs / name for name in sorted(shown))]


def _commit(root: Path) -> str:
    """Tell the commit of a checkout, and whether files differ from it; nothing of another folder."""
    if not (root / ".git").exists():
        return ""
    command = ["git", "-C", str(root), "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""
