"""Print the table of docs/architecture.md, made from the import layers and the packages' first lines.

python docs/list_layers.py
"""

import ast
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
CHAPTERS = ("presentation", "studies", "delivery", "assurance", "methods", "dynamics")
SOURCES = {
    "gen_profile": "generator",
    "gen_profile_fmu": "fmu",
    "gen_profile_exporters": "exporters",
    "gen_profile_recheck": "recheck",
}


def layers() -> list[list[str]]:
    """List the packages and modules of every layer, top to bottom."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    contracts = project["tool"]["importlinter"]["contracts"]
    (names,) = (contract["layers"] for contract in contracts if contract["type"] == "layers")
    return [layer.replace(":", "|").replace(" ", "").split("|") for layer in names]


def home(name: str) -> Path:
    """Find the folder or the file of a package or module."""
    path = ROOT / SOURCES[name.partition(".")[0]] / name.replace(".", "/")
    return path if path.is_dir() else path.with_suffix(".py")


def purpose(place: Path) -> str:
    """Read the first line of a package's or module's docstring."""
    file = place / "__init__.py" if place.is_dir() else place
    return (ast.get_docstring(ast.parse(file.read_text("utf-8"))) or "").partition("\n")[0].rstrip(".")


def packages(chapter: Path) -> list[Path]:
    """List the packages of a chapter, none of a package that is no chapter."""
    found = sorted(file.parent for file in chapter.glob("*/__init__.py"))
    return found if chapter.name in CHAPTERS else []


def table() -> str:
    """Lay the layers out as a table, top to bottom, and below each chapter its packages."""
    lines = ["| layer | package | what |", "|---|---|---|"]
    for number, names in enumerate(layers(), 1):
        for name in names:
            short = name.removeprefix("gen_profile.")
            lines.append(f"| {number} | `{short}` | {purpose(home(name))} |")
            lines += [f"| | `{short}.{one.name}` | {purpose(one)} |" for one in packages(home(name))]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.stdout.write(table() + "\n")
