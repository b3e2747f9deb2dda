"""Hide what not every system has, as Windows has not: modules from the project, and functions from all.

Python runs this at its start where PYTHONPATH names the folder, in the processes of a sweep, too.
"""

import builtins
import os

MODULES = {"fcntl", "grp", "posix", "pty", "pwd", "resource", "spwd", "syslog", "termios", "tty"}
FUNCTIONS = ("chown", "fork", "killpg", "mkfifo", "nice", "setsid", "statvfs")
FUNCTIONS += tuple(name for name in dir(os) if name.startswith("sched_"))

whole_import = builtins.__import__


def hiding_import(name, globals=None, *arguments, **options):  # noqa: A002
    if name in MODULES and globals and str(globals.get("__name__")).startswith("gen_profile"):
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)
    return whole_import(name, globals, *arguments, **options)


builtins.__import__ = hiding_import
for function in FUNCTIONS:
    delattr(os, function)
