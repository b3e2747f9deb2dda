"""A kernel with vcan: this machine's, or Debian's user-mode-linux on this machine's files.

Most containers' kernels have no vcan. User-mode-linux is a kernel that runs as a process: it boots in two
seconds, sees this machine's files read-only, and has a CAN bus of its own. It needs no privileges.
"""

import ctypes
import os
import shlex
import shutil
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

UML = "linux.uml"
PR_SET_PDEATHSIG = 1  # linux/prctl.h
libc = ctypes.CDLL(None)
TOOLS = ("candump", "cansend", "ip", "tc")
MODULES = (
    "net/can/can.ko",
    "net/can/can-raw.ko",
    "net/can/can-bcm.ko",
    "drivers/net/can/dev/can-dev.ko",
    "drivers/net/can/vcan.ko echo=1",  # frames are heard when they are sent, as on a real bus, not queued
    "net/sched/sch_fq.ko",
)

INIT = """#!/bin/sh
export PATH={path}
export HOME=/root
export TMPDIR=/dev/shm
mount -t proc proc /proc
mount -t sysfs sys /sys
mount -t devtmpfs dev /dev
mkdir -p /dev/shm
mount -t tmpfs shm /dev/shm
mount -t hostfs -o {folder} scratch {folder}
cd /usr/lib/uml/modules/$(uname -r)/kernel
{insmods}
cd /
ip link set lo up
echo -1 >/proc/sys/kernel/sched_rt_runtime_us
{command} >{folder}/output 2>&1
echo $? >{folder}/code
sync
echo o >/proc/sysrq-trigger
sleep 60
"""


def missing():
    """Name what is not installed of what running on vcan takes; nothing if all is there."""
    tools = [tool for tool in TOOLS if _which(tool) is None]
    if not _own_vcan() and None in map(_which, (UML, "insmod", "gcc")):
        tools.append("user-mode-linux, kmod and gcc (or a kernel with vcan)")
    return ", ".join(tools)


def run(command, folder, environment):
    """Run a command where vcan0 can be made; files below `folder` can be written. Return its output."""
    lines = [f"export {name}={shlex.quote(value)}" for name, value in environment.items()]
    script = folder / "command.sh"
    script.write_text("\n".join([*lines, f"exec {shlex.join(map(str, command))}", ""]))
    if _own_vcan():
        done = subprocess.run(["unshare", "-n", "sh", script], capture_output=True, text=True, check=False)
        return done.returncode, done.stdout + done.stderr
    return _run_in_uml(script, folder)


def _run_in_uml(script, folder):
    init = folder / "init"
    init.write_text(
        INIT.format(
            path=shlex.quote(f"{Path(sys.executable).parent}:/usr/sbin:/usr/bin:/sbin:/bin"),
            folder=shlex.quote(str(folder)),
            insmods="\n".join(f"insmod {module}" for module in MODULES),
            # locked memory, all of which each process would have copied, takes it seconds
            command=f"setpriv --bounding-set=-ipc_lock sh {shlex.quote(str(script))}",
        )
    )
    init.chmod(0o755)
    kernel = [_which(UML), "mem=1G", "rootfstype=hostfs", "root=/dev/root", "rootflags=/", "ro"]
    console = ["con=null", "con0=fd:0,fd:1", "quiet", f"init={init}"]
    whole_state = folder / "whole_fp_state.so"
    source = Path(__file__).with_name("whole_fp_state.c")
    subprocess.run(["gcc", "-shared", "-fPIC", "-o", whole_state, source, "-ldl"], check=True)
    booted = subprocess.run(
        [*kernel, *console],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
        # the kernel keeps its socket at home, and dies without
        env={**os.environ, "HOME": str(folder), "LD_PRELOAD": str(whole_state)},
        preexec_fn=_punctual,
    )
    code = folder / "code"
    if not code.is_file():
        return 1, booted.stdout + booted.stderr
    return int(code.read_text()), (folder / "output").read_text()


def _punctual():
    """End the kernel with us, and where it may, let it not wait for what else this machine does."""
    libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    with suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))


def _which(tool):
    return shutil.which(tool, path=f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin")


def _own_vcan():
    """Whether this machine's kernel makes vcan interfaces, in a network namespace of their own."""
    if _which("unshare") is None or _which("ip") is None:
        return False
    probe = ["unshare", "-n", "ip", "link", "add", "vcan0", "type", "vcan"]
    return subprocess.run(probe, capture_output=True, check=False).returncode == 0
