"""Figures in files, drawn by Matplotlib, which is an extra."""

from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from gen_profile.presentation.charts import figure as parts
from gen_profile.support.artefacts.writing import deliver, require_place
from gen_profile.support.errors import OutputError
from gen_profile.support.plugins import require_installed

# suffix → metadata that keeps the clock out of the file
METADATA: dict[str, dict[str, None]] = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
DASHES: dict[parts.Dash, str] = {"solid": "-", "dash": "--", "dot": ":", "points": "none"}
HATCHES: dict[parts.Dash, str] = {"solid": "", "dash": "///", "dot": "..", "points": ""}
WIDE, HIGH = (9.0, 7.5, 5.2, 3.9), (6.0, 3.8, 3.8, 3.4)  # inches of a panel, by columns from 1
BESIDE, EVEN = 5.5, 9.0  # inches of a figure beside another one, and where its axes have one scale
LETTERS = 13  # of a caption, in an inch


def require_drawable(path: Path) -> None:
    """Find out whether a picture can be drawn, before time goes into what it shows.

    Raises
    ------
    OutputError
        Matplotlib is not installed, the file's suffix is none of a picture, or it cannot be written.
    """
    if path.suffix.lower() not in METADATA:
        raise OutputError(f"plot {path}: name a file that ends in {', '.join(METADATA)}.")
    require_installed("plot needs Matplotlib", "plot", "matplotlib")
    require_place(path)


def save(figures: Sequence[parts.Figure], path: Path, salt: str, title: str) -> None:
    """Draw figures side by side in one file, the panels of all but the first below each other.

    Parameters
    ----------
    figures : sequence of Figure
        The first one is the widest.
    path : Path
    salt : str
        What ids inside an SVG are made from; they would be random otherwise.
    title : str

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    write(drawn(figures, title), path, salt)


def write(canvas: Any, path: Path, salt: str) -> None:
    """Write a figure of Matplotlib's to a file, the same bytes each time; as `save`."""
    import matplotlib  # noqa: PLC0415  # an extra

    suffix, content = path.suffix.lower(), BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": salt}):
        canvas.savefig(content, format=suffix[1:], dpi=110, metadata=METADATA[suffix])
    deliver(path, content.getvalue())


def drawn(figures: Sequence[parts.Figure], title: str) -> Any:
    """Draw figures side by side, as a figure of Matplotlib's; its pyplot stays as the caller has it."""
    from matplotlib.figure import Figure as Canvas  # noqa: PLC0415  # an extra

    columns = _columns(figures[0])
    rows = -(-len(figures[0].panels) // columns)
    beside = [EVEN if any(panel.even for panel in figure.panels) else BESIDE for figure in figures[1:]]
    widths = [columns * WIDE[columns - 1], *beside]
    height = max(6.0, 1.0 + rows * (2.4 if rows > 2 and columns == 1 else HIGH[columns - 1]))
    picture = Canvas(figsize=(sum(widths), height), layout="constrained")
    subfigures = picture.subfigures(1, len(figures), width_ratios=widths, squeeze=False)[0]
    for number, (part, figure, width) in enumerate(zip(subfigures, figures, widths, strict=True)):
        _draw(part, figure, width, 1 if number else columns)
    picture.suptitle(plain(title))
    return picture


def plain(text: str) -> str:
    """Keep Matplotlib from reading as a formula what stands between two dollars."""
    return str(text).replace("$", r"\$")


def _draw(part: Any, figure: parts.Figure, width: float, columns: int) -> None:
    """Draw panels row by row; bars take what is left of their row."""
    names = [str(number) for number in range(len(figure.panels))]
    filling = names[-1] if isinstance(figure.panels[-1], parts.Bars) else "."
    mosaic = np.reshape([*names, *[filling] * (-len(names) % columns)], (-1, columns))
    axes = part.subplot_mosaic(mosaic.tolist())
    for name, panel in zip(names, figure.panels, strict=False):
        match panel:
            case parts.Panel():
                _curves(axes[name], panel)
            case parts.Bars():
                _bars(axes[name], panel)
            case parts.Map():
                _map(part, axes[name], panel)
        axes[name].set_title(plain(panel.title), fontsize="medium")
    handles: Mapping[str, Any] = {
        label: handle
        for axis in axes.values()
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)
    }
    caption = plain(fill(figure.caption, round(LETTERS * width)))
    if len(handles) < 2:
        part.supxlabel(caption, fontsize="small")
        return
    part.legend(
        handles.values(),
        handles.keys(),
        title=caption,
        title_fontsize="small",
        loc="outside lower center",
        ncols=max(1, int(width / max(2.1, 0.9 + max(map(len, handles)) / LETTERS))),
        handlelength=3.5,
    )


def _columns(figure: parts.Figure) -> int:
    return min(figure.columns, len(figure.panels))


def _curves(axis: Any, panel: parts.Panel) -> None:
    shown = [line for line in panel.lines if line.style.shown]
    for line in shown:
        if line.style.fill:
            look = {"alpha": line.style.fill, "linewidth": 0.0, "zorder": 1}
            axis.fill(line.x, line.y, label=plain(line.name), color=line.style.colour, **look)
        else:
            axis.plot(line.x, line.y, label=plain(line.name), **_ink(line.style))
    for band in panel.bands:
        if band.high > band.low:
            axis.axvspan(band.low, band.high, color=parts.FRAME, alpha=0.2, linewidth=0.0, zorder=0)
        else:
            axis.axvline(band.low, color=parts.FRAME, linewidth=0.9, linestyle=":", zorder=1)
    for level in panel.levels:
        _level(axis, level)
    axis.set(xlabel=plain(panel.x_label), ylabel=plain(panel.y_label))
    if panel.even:
        axis.set_aspect("equal")
    else:
        axis.set_xlim(min(float(line.x.min()) for line in shown), max(float(line.x.max()) for line in shown))
    axis.grid(alpha=0.3)
    if panel.decades is not None:
        greatest = max(float(line.y.max()) for line in shown)
        axis.set(yscale="log", ylim=(greatest * 10.0**-panel.decades, 1.5 * greatest))
    elif panel.span is not None:
        axis.set_ylim(panel.span)


def _level(axis: Any, level: parts.Level) -> None:
    look = {"color": parts.LIMIT, "linewidth": 1.0, "linestyle": "--", "zorder": 1}
    if level.between is None:
        axis.axhline(level.value, **look)
    else:
        axis.plot(level.between, [level.value] * 2, **look)


def _bars(axis: Any, panel: parts.Bars) -> None:
    """Draw bars, and their texts beside them; what the axis cannot hold has an arrow."""
    look = {
        "color": [style.colour for style in panel.styles],
        "edgecolor": parts.PAPER,
        "hatch": [HATCHES[style.dash] for style in panel.styles],
    }
    axis.barh([*map(plain, panel.names)], panel.values, **look, linewidth=0.0)
    for place, (value, text) in enumerate(zip(panel.values, panel.texts, strict=True)):
        arrow = "" if value <= panel.end else "▸ "
        axis.text(min(value, panel.end), place, f" {arrow}{text}", va="center", fontsize="small")
    axis.axvline(panel.limit, color=parts.LIMIT, linewidth=1.0, linestyle="--")
    axis.invert_yaxis()
    axis.set(xlabel=panel.x_label, xlim=(0.0, panel.end))


def _map(part: Any, axis: Any, panel: parts.Map) -> None:
    from matplotlib.ticker import AutoLocator  # noqa: PLC0415  # an extra

    end = panel.headroom * panel.limit
    if panel.cells:
        coloured = axis.pcolormesh(panel.x, panel.y, panel.values, cmap="viridis_r", vmin=0.0, vmax=end)
    else:
        levels = np.linspace(0.0, end, parts.SHADES + 1)
        coloured = axis.contourf(panel.x, panel.y, panel.values, levels, cmap="viridis_r", extend="max")
        if panel.values.min() < panel.limit < panel.values.max():
            axis.contour(panel.x, panel.y, panel.values, [panel.limit], colors=parts.INK, linewidths=2.2)
    if panel.frame is not None:
        width, height = panel.frame
        for colour, dash in ((parts.PAPER, "-"), (parts.INK, ":")):
            corners = ([-width, width, width, -width, -width], [-height, -height, height, height, -height])
            axis.plot(*corners, color=colour, linestyle=dash, linewidth=1.2)
    axis.set(xlabel=plain(panel.x_label), ylabel=plain(panel.y_label))
    part.colorbar(coloured, ax=axis, label=panel.unit, ticks=AutoLocator())  # else at ends of shades


def _ink(style: parts.Style) -> dict[str, Any]:
    """Say in Matplotlib's words how a curve looks."""
    points = {"marker": ".", "markersize": 2.0 * style.width} if style.dash == "points" else {}
    return {"color": style.colour, "linestyle": DASHES[style.dash], "linewidth": style.width, **points}
