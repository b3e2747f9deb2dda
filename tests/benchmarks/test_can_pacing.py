"""How evenly frames leave, beside `canplayer` and python-can's own ways. Printed, not judged."""

import json
import sys
from pathlib import Path

import exporters
from exporters.can import vcan_kernel

PROGRAM = Path(exporters.__path__[0]) / "can" / "vcan_pacing.py"
FRAMES = 15_000  # of 4 ms: a minute


def test_pacing(tmp_path):
    code, output = vcan_kernel.run([sys.executable, PROGRAM, FRAMES], tmp_path, {})
    assert code == 0, output
    figures = json.loads(output)
    print(f"\n{'4 ms for a minute':20} {'p50':>8} {'p99':>8} {'max':>8} µs  drift")
    for name, late in figures.items():
        print(
            f"{name:20} {late['p50']:8.0f} {late['p99']:8.0f} {late['max']:8.0f}     {late['drift_s']:+.6f} s"
        )
    assert abs(figures["ours"]["drift_s"]) < 0.004
