"""Print the picture of docs/architecture.md, drawn from the import layers and the packages' first lines.

python docs/draw_layers.py
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


def label(name: str) -> str:
    """Name a package with its purpose."""
    return f"<b>{name.removeprefix('gen_profile.')}</b><br>{purpose(name)}"


def picture() -> str:
    """Draw a flow chart in Mermaid's language."""
    rows = layers()
    lines = ["flowchart TB"]
    for number, row in enumerate(rows):
        lines.append(f'  subgraph layer{number}[" "]')
        lines += [f'    {name.replace(".", "_")}["{label(name)}"]' for name in row]
        lines.append("  end")
    lines += [f"  layer{number} --> layer{number + 1}" for number in range(len(rows) - 1)]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.stdout.write(picture() + "\n")
