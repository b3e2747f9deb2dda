"""What stands on a page, in the order of reading: values only, no markup.

Every text here may come from a stranger (a machine's file, a log's header): the page escapes all of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import attrs
from attrs.validators import instance_of

from gen_profile.dynamics.evaluation.phrases import number
from gen_profile.presentation.charts.figure import Figure
from gen_profile.presentation.report.animation import Animation
from gen_profile.spec.model import Spec
from gen_profile.support.artefacts.manifest import versions

LEAST_SHARE = 1e-3


@attrs.frozen(kw_only=True)
class Verdict:
    """An answer that a reader must not miss.

    Attributes
    ----------
    word : str
        Such as ``"Passed"``: colour alone does not print.
    passed : bool or None
        None where nothing was judged.
    sentences : sequence of str
        The first one is the answer, the others are reasons.
    """

    word: str
    passed: bool | None
    sentences: Sequence[str]

    @property
    def kind(self) -> str:
        """What the style sheet calls it."""
        return {True: "passed", False: "failed", None: "open"}[self.passed]


@attrs.frozen(kw_only=True)
class Terms:
    """Names with a value each, as a list of facts."""

    rows: Sequence[tuple[str, str]]
    kind = "terms"


@attrs.frozen
class Share:
    """A cell of a table that shows how much of something allowed is taken up: 1 is all of it."""

    value: float

    @property
    def percent(self) -> str:
        """The share in words."""
        return f"{100.0 * self.value:.3g} %" if abs(self.value) >= LEAST_SHARE else "< 0.1 %"

    @property
    def width(self) -> str:
        """The share as the width of a bar."""
        return f"{100.0 * min(max(self.value, 0.0), 1.0):.1f}%"


@attrs.frozen(kw_only=True)
class TableRow:
    """A line of a table; `mark` is ``"passed"``, ``"failed"``, ``"own"`` or nothing."""

    cells: Sequence[str | Share]
    mark: str = ""


@attrs.frozen(kw_only=True)
class Table:
    """Rows under heads.

    Attributes
    ----------
    head : sequence of str
    rows : sequence of TableRow
    words : int
        So many columns at the left hold words, the others numbers.
    code : bool
        Whether the last column holds hashes and the like.
    """

    head: Sequence[str]
    rows: Sequence[TableRow]
    words: int = 1
    code: bool = False
    kind = "table"


@attrs.frozen(kw_only=True)
class Listing:
    """A text that is folded away until it is wanted."""

    title: str
    text: str
    kind = "listing"


BlockOfKind = TypeVar("BlockOfKind")
Block = Terms | Table | Figure | Animation | Listing


@attrs.frozen(kw_only=True)
class Section:
    """Blocks under a title, and what they say in words.

    Attributes
    ----------
    title : str
    blocks : sequence of Block
    words : sequence of str
        A paragraph each.
    """

    title: str
    blocks: Sequence[Block]
    words: Sequence[str] = attrs.field(default=(), validator=instance_of((tuple, list)))  # not one alone

    @property
    def anchor(self) -> str:
        """What links call it."""
        return "".join(letter if letter.isalnum() else "-" for letter in self.title.lower())


def machine_data(spec: Spec) -> list[tuple[str, str]]:
    """Name the machine's parameters, in SI units, and the version that made the page."""
    units, (program, release) = spec.machine().units, versions()[0]
    parameters = spec.plant.parameters.items()
    stated = [(name, f"{number(value)} {units[name]}".rstrip()) for name, value in parameters]
    return [*stated, ("Made by", f"{program} {release}")]


def _libraries() -> str:
    return f"Made by {', '.join(f'{library} {number}' for library, number in versions())}."


@attrs.frozen(kw_only=True)
class Page:
    """A whole report.

    Attributes
    ----------
    title, subtitle : str
    verdicts : sequence of Verdict
    facts : sequence of (str, str)
        The few numbers that say what the motion is.
    sections : sequence of Section
    colophon : str
        What made the page.
    machine : sequence of (str, str)
        Its parameters, and the program's version.
    papers : sequence of (str, str)
        What the reader wants to have on it, such as a customer.
    signatures : sequence of str
        Lines to be filled in by hand.
    """

    title: str
    subtitle: str
    verdicts: Sequence[Verdict]
    facts: Sequence[tuple[str, str]]
    sections: Sequence[Section]
    colophon: str = attrs.field(factory=_libraries)
    machine: Sequence[tuple[str, str]] = ()
    papers: Sequence[tuple[str, str]] = ()
    signatures: Sequence[str] = ()

    def with_fields(self, fields: Sequence[tuple[str, str]]) -> Page:
        """Say what else the page shall hold: names and their values, or lines to sign where there is none."""
        papers = [field for field in fields if field[1]]
        return attrs.evolve(self, papers=papers, signatures=[name for name, value in fields if not value])

    def blocks(self, kind: type[BlockOfKind]) -> list[BlockOfKind]:
        """All blocks of a kind, in their order."""
        return [block for section in self.sections for block in section.blocks if isinstance(block, kind)]
