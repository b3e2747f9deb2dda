"""What the commands say that find a machine's parameters."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from gen_profile.cli.words import block

if TYPE_CHECKING:
    from gen_profile.studies.identification.identify import Identification
    from gen_profile.studies.identification.learning import Learning

RESTS = 0.5  # of a half-range, from which on 1 % of another parameter is worth a word


def identification(identified: Identification, path: Path) -> str:
    """Tell what was identified, how well, and how the measurements agree with it."""
    document = identified.to_dict()
    rows = []
    for name, row in document["parameters"].items():
        size = f"{row['value']:.6g} ± {row['half_range']:.2g} {row['unit']}"
        relative = f"±{100.0 * row['half_range'] / abs(row['value']):.2g} %; " if row["value"] else ""
        rows.append((name, f"{size} ({relative}{row['given']:g} before)"))
    for row in document["readings"]:
        what = row["parameter"] if "parameter" in row else f"period of mode {row['mode']}"
        read = row["value"] if "parameter" in row else row["seconds"]
        off = (read - row["model"]) / row["uncertainty"]
        size = f"{read:.6g} ± {row['uncertainty']:.2g} {row['unit']}"
        rows.append((f"read {what}", f"{size}, {off:+.1f} σ off the model"))
    for row in document["logs"]:
        sizes = f"swing ±{row['swing']:.2g} {row['unit']}, noise {row['noise']:.2g} {row['unit']}"
        taken = f" ({row['averages']} averages over {row['lasts_s']:.4g} s)" if row["averages"] else ""
        samples = f"{row['samples']} samples of its {row['quantity']}{taken}"
        rows.append((f"log of {row['load']}", f"{samples}, {sizes}"))
        rows += [("as read", sentence) for sentence in row["read"]]
    rows += [("WARNING", sentence) for sentence in identified.warnings()]
    rows += [*_stated_ranges(identified), *_rests(identified)]
    rows += [("ranges hold", f"with {document['confidence']:.0%}, all at once"), ("wrote", str(path))]
    return block(identified.spec.name, rows)


def learning(learned: Learning, path: Path) -> str:
    """Tell which ranges are left, and what the runs showed."""
    document = learned.to_dict()
    rows = []
    for name, row in document["parameters"].items():
        (low, high), before = row["range"], row["before"]
        size = f"{low:.5g} to {high:.5g} {row['unit']}"
        rows.append((name, f"{size} ({before[0]:.5g} to {before[1]:.5g} before)"))
    for row in document["runs"]:
        if "seen" in row:
            rows.append((f"{row['load']}", f"seen {row['seen']:.4g} ± {row['bound']:.2g} m after the motion"))
            continue
        left = f"{row['left']:.2g} of {row['swing']:.2g} {row['unit']} RMS left by the best machine"
        rows.append((f"log of {row['load']}", f"the motion begins at {row['begins_s']:.2f} s; {left}"))
    rows += [("WARNING", sentence) for sentence in learned.warnings()]
    rows += [("ranges hold", f"with {document['confidence']:.1%} for each log"), ("wrote", str(path))]
    return block(learned.spec.name, rows)


def _stated_ranges(identified: Identification) -> Iterator[tuple[str, str]]:
    """Tell which range of the spec is wider than what the measurements leave open."""
    for name, row in identified.to_dict()["parameters"].items():
        fraction = row["half_range"] / abs(row["value"] or 1.0)
        if row["stated"] is not None and row["stated"] > fraction:
            yield "kept", f"the spec's range of {name}, ±{row['stated']:.2%}: it may change in service"


def _rests(identified: Identification) -> Iterator[tuple[str, str]]:
    """Tell what a result rests on that was not measured, where a per cent of that matters."""
    uncertain = identified.given.robustness.uncertain
    for name, row in identified.to_dict()["parameters"].items():
        for other, moved in row["rests_on"].items():
            if abs(moved) > RESTS * row["half_range"]:
                range_ = f" (±{uncertain[other]:.2%})" if other in uncertain else ""
                words = f"{other} as the spec states it{range_}: 1 % more makes {moved:+.2g} {row['unit']}"
                yield f"{name} rests on", words
