"""The commit that a distribution is built from, written into it: `gen-profile --version` tells it."""

import subprocess
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PLACES = {"sdist": "commit.txt", "wheel": "gen_profile/commit.txt"}


class CommitHook(BuildHookInterface):
    """Adds a file to both distributions; the source archive hands its own on to the wheel."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Find or write the file."""
        kept = Path(self.root, PLACES["sdist"])
        if version == "editable":
            return
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


def _commit(root: Path) -> str:
    """Tell the commit of a checkout, and whether files differ from it; nothing of another folder."""
    if not (root / ".git").exists():
        return ""
    command = ["git", "-C", str(root), "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""
