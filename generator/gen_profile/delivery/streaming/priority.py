"""The priority of this process, lowered for work that others need not wait for."""

import ctypes
import os
import sys

NICENESS = 10
THIS_PROCESS = ctypes.c_void_p(-1)  # the pseudo handle that GetCurrentProcess gives
BELOW_NORMAL = 0x4000  # BELOW_NORMAL_PRIORITY_CLASS, as winbase.h has it


def lower_priority() -> None:
    """Let other processes go first, from now on; once lowered, it stays so."""
    if sys.platform == "win32":
        ctypes.windll.kernel32.SetPriorityClass(THIS_PROCESS, BELOW_NORMAL)
    elif os.nice(0) < NICENESS:
        os.nice(NICENESS)
