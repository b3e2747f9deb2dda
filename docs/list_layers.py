"""Print the table of docs/architecture.md, made from the import layers and the packages' first lines.

python docs/list_layers.py
"""

import ast
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
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


def purpose(name: str) -> str:
    """Read the first line of a package's or module's docstring."""
    path = ROOT / SOURCES[name.partition(".")[0]] / name.replace(".", "/")
    file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    return (ast.get_docstring(ast.parse(file.read_text("utf-8"))) or "").partition("\n")[0].rstrip(".")


def table() -> str:
    """Lay the layers out as a table, top to bottom."""
    lines = ["| layer | package | what |", "|---|---|---|"]
    for number, names in enumerate(layers(), 1):
        lines += [f"| {number} | `{name.removeprefix('gen_profile.')}` | {purpose(name)} |" for name in names]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.stdout.write(table() + "\n")
