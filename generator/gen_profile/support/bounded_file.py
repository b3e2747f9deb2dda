"""Files that a user names, read up to a size: one that is huge, or never ends, is refused."""

import errno
from functools import partial
from itertools import islice
from os import fstat
from pathlib import Path

DOCUMENT = 1 << 24  # bytes of what is read as a whole before it is understood: a manifest, a machine's file
MOST_BYTES = 1 << 29  # bytes of anything else: a CAN log of an hour at 1 ms
BLOCK = 1 << 20


def read_bounded(path: Path, most: int = MOST_BYTES) -> bytes:
    """Read a file, or a pipe to its end.

    Raises
    ------
    OSError
        It cannot be read, or holds more than `most` bytes; what it is called does not count: a link may lead
        to a device that never ends.
    """
    with path.open("rb") as file:
        if fstat(file.fileno()).st_size <= most:
            content = b"".join(islice(iter(partial(file.read, BLOCK), b""), most // BLOCK + 1))
            if len(content) <= most:
                return content
    raise OSError(errno.EFBIG, f"it is larger than {most >> 20} MiB")


def is_folder(error: OSError, path: Path) -> bool:
    """Tell whether reading a path failed as it is a folder, which Windows calls a matter of permission."""
    return isinstance(error, IsADirectoryError | PermissionError) and path.is_dir()
