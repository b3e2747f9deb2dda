"""One drive as its configuration sees it: objects read and written by SDO."""

import struct

import attrs
from canopen import SdoAbortedError
from canopen.sdo.exceptions import SdoError

from gen_profile.support.errors import StreamAborted
from gen_profile_exporters.can.host.link import Link

NOT_THERE = {0x0602_0000, 0x0609_0011}  # SDO abort codes: no such object, no such subindex
# what drives say as well of an object that they need not have: general error, not available, no data
NOT_GIVEN = NOT_THERE | {0x0800_0000, 0x060A_0023, 0x0800_0024}


@attrs.frozen(eq=False)
class Node:
    """One drive as the configuration sees it: its place on the bus and among the axes, and its objects."""

    link: Link
    number: int
    column: int
    name: str

    def read(self, index: int, sub: int = 0, bits: int = 32) -> int:
        """Read a number that it must have."""
        data = self.upload(index, sub, bits)
        if data is None:
            raise self.unfit(f"the drive has no object {index:04X}h:{sub:02X}.")
        return int.from_bytes(data, "little")

    def upload(self, index: int, sub: int, bits: int = 32, *, optional: bool = False) -> bytes | None:
        """Read an object of some bits, whose answer may have room for more; None where it has none."""
        try:
            data: bytes = self.link.sdo(self.number).upload(index, sub)
        except SdoAbortedError as error:
            if error.code in (NOT_GIVEN if optional else NOT_THERE):
                return None
            raise self.unfit(f"the drive refuses to give {index:04X}h:{sub:02X} ({error}).") from error
        except (SdoError, struct.error) as error:
            raise self.silent(error) from error
        return data[: bits // 8]

    def download(self, index: int, sub: int, data: bytes) -> None:
        """Write an object; a drive may refuse it, for what counts is what is read back."""
        try:
            self.link.sdo(self.number).download(index, sub, data)
        except SdoAbortedError:
            return
        except (SdoError, struct.error) as error:
            raise self.silent(error) from error

    def unfit(self, words: str) -> StreamAborted:
        """Say why its axis cannot be moved."""
        return StreamAborted(f"axis {self.name}: {words}")

    def silent(self, error: Exception) -> StreamAborted:
        """Say that it gives no answer that means anything."""
        return self.unfit(
            f"node {self.number} does not answer properly ({error}); check power, cabling, bit rate and node "
            "id."
        )
