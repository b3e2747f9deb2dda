"""Judging histories on the workers of a Dask scheduler."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import ceil
from pathlib import Path
from tempfile import TemporaryDirectory

import attrs

from gen_profile.assurance.proof.closed_loop import ClosedLoop
from gen_profile.assurance.proof.histories import Histories
from gen_profile.assurance.proof.judging import Judge
from gen_profile.assurance.proof.numbering import Numbering
from gen_profile.assurance.proof.verdict import JudgedHistory
from gen_profile.spec.model import Spec
from gen_profile.spec.reading import spec_from_dict
from gen_profile.support.artefacts.manifest import versions
from gen_profile.support.cluster import client_of, processes, require_versions, unable
from gen_profile.support.errors import GenProfileError
from gen_profile.support.progress import Progress

MOST_AT_ONCE = 25  # histories that a worker is handed


@attrs.frozen(kw_only=True)
class ProofRecipe:
    """What a worker needs to know of a proof; nothing is shared with it but the program.

    Attributes
    ----------
    spec : str
        In JSON.
    files : tuple of (str, bytes)
        That the spec names, by their names.
    text : str
        The block.
    versions : tuple of (str, str)
        Of the libraries that shape the numbers.
    """

    spec: str = attrs.field(repr=False)
    files: tuple[tuple[str, bytes], ...] = attrs.field(repr=False)
    text: str = attrs.field(repr=False)
    versions: tuple[tuple[str, str], ...]

    @classmethod
    def of(cls, spec: Spec, text: str) -> ProofRecipe:
        """Pack a proof's block and machine."""
        return cls(
            spec=json.dumps(spec.to_dict()), files=tuple(spec.files().items()), text=text, versions=versions()
        )

    def read_spec(self) -> Spec:
        """Read the spec."""
        with TemporaryDirectory(prefix="gen-profile-") as folder:
            for name, content in self.files:
                (Path(folder) / name).write_bytes(content)
            return spec_from_dict(json.loads(self.spec), Path(folder))


@contextmanager
def judged_on_cluster(spec: Spec, text: str, scheduler: str, progress: Progress) -> Iterator[Judge]:
    """Let the workers of a Dask scheduler judge.

    Raises
    ------
    SpecError
        No worker answers, or they cannot do it.
    """
    with client_of(scheduler, 0) as client:
        recipe = client.scatter(ProofRecipe.of(spec, text), broadcast=True)

        def judge(numbering: Numbering, numbers: Sequence[int]) -> list[JudgedHistory]:
            drawn = (numbering.count, numbering.seed, numbering.parents)
            each = min(MOST_AT_ONCE, ceil(len(numbers) / processes(client)) or 1)
            parts = [(*drawn, numbers[begin : begin + each]) for begin in range(0, len(numbers), each)]
            judged = list[JudgedHistory]()
            try:
                for done in client.map(judge_part, [recipe] * len(parts), parts, pure=False):
                    judged += done.result()
                    progress("proving", judged[-1].number, numbering.count)
            except GenProfileError:
                raise
            except Exception as error:
                raise unable(error) from error
            return judged

        yield judge


def judge_part(
    recipe: ProofRecipe, part: tuple[int, int, Sequence[Sequence[int]], Sequence[int]]
) -> list[JudgedHistory]:
    """Judge some histories, on a worker.

    Parameters
    ----------
    recipe : ProofRecipe
    part : (count, seed, parents, numbers)
        Of the numbering, and which of its histories.

    Raises
    ------
    SpecError
        This computer has other versions than the recipe asks for.
    CosimulationError
        Something cannot be compiled or loaded here.
    """
    require_versions(recipe.versions, "this proof")
    spec, (count, seed, parents, numbers) = recipe.read_spec(), part
    numbering = Numbering.of(Histories.of(spec), count, seed, parents)
    with ClosedLoop(spec, recipe.text, numbering.histories) as loop:
        return loop.judged(numbering, numbers)
