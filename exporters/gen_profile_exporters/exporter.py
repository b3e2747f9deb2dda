"""What an exporter is: a profile to files, and files back to what the controller will issue."""

from typing import Protocol

import attrs

from gen_profile.motion.profile import Profile, SampledProfile
from gen_profile.spec.can import CanSpec
from gen_profile.spec.model import ExportSpec, Spec
from gen_profile.support.units import AxisScale
from gen_profile_exporters.block_source import BlockSource
from gen_profile_exporters.machine_variants import AxisVariants, machine_variants

UNSTATED_LAG = 0.03  # s, of drives of which none is stated: a position loop of some 33/s


@attrs.frozen(kw_only=True)
class Target:
    """The controller that an artefact is for.

    Attributes
    ----------
    name : str
        Of the motion; files and program blocks are named after it.
    axes : tuple of AxisScale
        How each axis is counted, in the profile's order.
    start : tuple of float
        Where each axis stands before the motion, in m (or rad).
    export : ExportSpec
        The controller's cycle, and what each format leaves to choose.
    can : CanSpec
        The bus and the drives on it.
    variants : tuple of AxisVariants
        What a controller may change of the motion, axis by axis; empty for nothing.
    lag : float
        Greatest time in s by which the axes come after their setpoints.
    """

    name: str
    axes: tuple[AxisScale, ...]
    start: tuple[float, ...]
    export: ExportSpec
    can: CanSpec
    variants: tuple[AxisVariants, ...] = ()
    lag: float = UNSTATED_LAG

    @property
    def cycle_time(self) -> float:
        """Of the controller's task, in s."""
        return self.export.cycle_time


@attrs.frozen
class File:
    """A file to be written: its name, without folder, and its bytes."""

    filename: str
    content: bytes


class Exporter(Protocol):
    """One format: a module, or any object, with these two functions. Both are pure."""

    def encode(self, profile: Profile, target: Target) -> tuple[File, ...]:
        """Write the motion; the first file is the one that `replay` takes.

        Raises
        ------
        ExportError
            The format or the target cannot take the motion.
        """

    def replay(self, content: bytes, target: Target) -> SampledProfile:
        """Read what the controller will issue each cycle.

        Raises
        ------
        ExportError
            The content is not what `encode` writes: truncated, damaged or meant for another target.
        """


class BlockContainer(Exporter, Protocol):
    """A format whose first file holds a function block, of one motion or of a library."""

    def wrap(self, source: BlockSource, target: Target) -> tuple[File, ...]:
        """Write the block, and what the controller needs around it.

        Raises
        ------
        ExportError
            The format or the target cannot take the block.
        """

    def unwrap(self, content: bytes, target: Target) -> BlockSource:
        """Read the first file's first block as Structured Text has it.

        Raises
        ------
        ExportError
            There is none.
        """


def target_of(spec: Spec) -> Target:
    """Pick from a spec what exporters need."""
    return Target(
        name=spec.ascii_name,
        axes=spec.axis_scales(),
        start=spec.move.start,
        export=spec.export,
        can=spec.can,
        variants=machine_variants(spec),
        lag=_greatest_lag(spec),
    )


def _greatest_lag(spec: Spec) -> float:
    """Take the greatest lag that the spec designs for, or checks."""
    path = spec.check.path
    stated = [lag for lag in (spec.actuator.tau, path.lag and path.lag[1]) if lag is not None]
    return max(stated, default=UNSTATED_LAG) + path.latency
