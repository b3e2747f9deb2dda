"""What a page asks a worker for."""

from collections.abc import Mapping
from typing import Any

import attrs

from gen_profile.presentation.studio.state import StudioState, WrittenSpec, document_of
from gen_profile.spec.model import Spec
from gen_profile.spec.reading import spec_from_dict


@attrs.frozen(kw_only=True)
class Question:
    """What a page asks for.

    Attributes
    ----------
    start : WrittenSpec
    state : StudioState
        Its edits are those of the start.
    agreed : mapping of str to str
        SHA-256 of the programs that the user lets run, by the keys that name them.
    """

    start: WrittenSpec
    state: StudioState
    agreed: Mapping[str, str] = attrs.field(factory=dict)

    def document(self) -> dict[str, Any]:
        """State the spec as nested plain values."""
        return document_of(self.start, self.state.edits)

    def spec(self) -> Spec:
        """Read the spec.

        Raises
        ------
        SpecError
        """
        return self._read(self.document())

    def beginning(self) -> Spec:
        """Read the spec without the edits.

        Raises
        ------
        SpecError
        """
        return self._read(self.start.document)

    def _read(self, document: dict[str, Any]) -> Spec:
        """Read a spec; a program that was changed since the user agreed is refused where it is read."""
        for key, digest in self.agreed.items():
            name, file = key.split(".")
            table = document.get(name)
            if isinstance(table, dict) and file in table:
                document = {**document, name: {f"{file}_sha256": digest, **table}}
        return spec_from_dict(document, self.start.folder)


@attrs.frozen(kw_only=True)
class Order:
    """What shall be made.

    Attributes
    ----------
    question : Question
    formats : tuple of str
        As exporters are named.
    report : bool
        Whether a report is written, not the artefacts themselves.
    """

    question: Question
    formats: tuple[str, ...]
    report: bool


@attrs.frozen(kw_only=True)
class DriveQuestion:
    """What a hand wants of a planner block for a moment.

    Attributes
    ----------
    question : Question
        The spec of the block.
    drive : int
        Which drive it is: another number begins anew.
    command : str
        ``"velocity"``, ``"target"``, ``"point"``, ``"stop"``, ``"quick_stop"``, or empty to go on.
    values : tuple of float
        A velocity or target for every axis that is planned, in m/s or m (or rad); to point, the number of a
        picture, and a place in it in m.
    live : mapping of str to float
        Live parameters, as they are now.
    sensor : mapping of str to float
        What is wrong with a simulated sensor, as `SimulatedSensor.set` takes it.
    wind : tuple of float
        m/s² along each axis that is planned, by which it pushes all loads; calm if empty.
    """

    question: Question
    drive: int
    command: str
    values: tuple[float, ...]
    live: Mapping[str, float]
    sensor: Mapping[str, float]
    wind: tuple[float, ...]


@attrs.frozen(kw_only=True)
class LogQuestion:
    """What was measured on the machine, and how to read it.

    Attributes
    ----------
    question : Question
        The design beside which it is shown.
    name : str
        Of the file.
    content : bytes
    use : str
        ``"swing"``, from which parameters are identified, ``"move"``, which is held against the plan, or
        empty for what the log looks like.
    columns : str or None
        Which column holds what, as `gen_profile.presentation.report.log.read_log` takes it; None to go by
        their names.
    after : float
        Time in s from which on the axes stood still, of a swing.
    at : tuple of float
        Where the axes stood meanwhile, in m or rad; at the move's target if empty.
    free : tuple of str
        Parameters to identify; those that the spec calls uncertain if empty.
    """

    question: Question
    name: str
    content: bytes = attrs.field(repr=False)
    use: str
    columns: str | None
    after: float
    at: tuple[float, ...]
    free: tuple[str, ...]
