"""How fast formats are written and read, beside `numpy.savetxt` and `numpy.loadtxt`. Printed, not judged."""

from __future__ import annotations

import io
import time
import tracemalloc
from collections.abc import Callable

import numpy as np
import pytest
from exporters.motions import quintic, target

from gen_profile.motion.profile import sample
from gen_profile_exporters.playback.quintic_segments import fit
from gen_profile_exporters.registry import find_exporter

FORMATS = {
    "csv": {},
    "plc segments": {},
    "plc samples": {"plc_layout": "samples"},
    "plc counts": {"plc_layout": "counts"},
    "plcopen-xml": {},
    "twincat": {},
    "siemens-scl": {},
    "rockwell-l5x": {},
}


def timed(run: Callable[[], object]) -> tuple[float, float]:
    """Time in s, and in another run the peak of memory in MB."""
    began = time.perf_counter()
    run()
    elapsed = time.perf_counter() - began
    tracemalloc.start()
    run()
    peak = tracemalloc.get_traced_memory()[1] / 1e6
    tracemalloc.stop()
    return elapsed, peak


def goal_of(axes: int, export: dict[str, str]):
    return target(*(f"axis {k}" for k in range(axes)), cycle_time=0.001, export=export)


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize(("samples", "axes"), [(1_001, 1), (10_001, 1), (100_001, 1), (10_001, 50)])
def test_export(name, samples, axes):
    profile = quintic(*[(0.0, 1.0)] * axes, duration=(samples - 1) / 1000)
    exporter, goal = find_exporter(name.split()[0]), goal_of(axes, FORMATS[name])
    elapsed, peak = timed(lambda: exporter.encode(profile, goal))
    content = exporter.encode(profile, goal)[0].content
    read, _ = timed(lambda: exporter.replay(content, goal))
    rate = samples * axes / elapsed
    print(
        f"\n{name}, {axes} axes, {samples} samples: {rate / 1e6:.2f} M samples/s, {peak:.0f} MB, "
        f"{len(content) / 1e6:.2f} MB written; read in {read:.2f} s"
    )


@pytest.mark.parametrize(("samples", "axes"), [(100_001, 1), (10_001, 50)])
def test_numpy(samples, axes):
    motion = sample(quintic(*[(0.0, 1.0)] * axes, duration=(samples - 1) / 1000), 0.001)
    parts = (motion.position, motion.velocity, motion.acceleration, motion.jerk)
    table = np.column_stack([motion.times, *(part for part in parts if part is not None)])
    elapsed, peak = timed(lambda: np.savetxt(io.BytesIO(), table, fmt="%.17g", delimiter=","))
    rate = samples * axes / elapsed
    print(f"\nnumpy.savetxt, {axes} axes, {samples} samples: {rate / 1e6:.2f} M samples/s, {peak:.0f} MB")


def test_segments_of_a_rough_motion():
    """The worst case: nothing but segments of one cycle."""
    motion = sample(quintic((0.0, 1.0), duration=100.0), 0.001)
    noise = np.random.default_rng(1).normal(size=motion.position.shape)
    began = time.perf_counter()
    segments = fit(np.stack([motion.position, motion.velocity, noise]), motion.cycle_time)
    print(
        f"\n{len(segments.first) - 1} segments of {len(noise)} samples in {time.perf_counter() - began:.2f} s"
    )
