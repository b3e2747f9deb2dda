"""Anderson's acceleration on iterations whose fixed points are known."""

import numpy as np
import pytest

from gen_profile.methods.solvers.direct.acceleration import accelerate


@pytest.mark.parametrize("eigenvalues", [(-1.3, 0.2), (0.95, -2.0, 0.4)])
def test_an_iteration_that_diverges_is_led_to_its_fixed_point(eigenvalues):
    """Of a linear iteration in n dimensions, n + 1 steps determine the fixed point."""
    size = len(eigenvalues)
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(size, size)))[0]
    matrix, fixed = turn @ np.diag(eigenvalues) @ turn.T, np.arange(1.0, size + 1.0)
    points, images = [np.zeros(size)], []
    for _ in range(size + 1):
        images.append(fixed + matrix @ (points[-1] - fixed))
        points.append(accelerate(points, images, np.ones(size)) if len(images) > 1 else images[-1])
    assert points[-1] == pytest.approx(fixed, rel=1e-9)
    plain = np.zeros(size)
    for _ in range(size + 1):
        plain = fixed + matrix @ (plain - fixed)
    assert np.abs(plain - fixed).max() > 0.1


def test_what_does_not_count_follows_what_does():
    def step(x):
        return np.array([1.0 - 1.5 * x[0], 10.0 * (1.0 - 1.5 * x[0])])

    points, images = [np.zeros(2)], []
    for _ in range(3):
        images.append(step(points[-1]))
        points.append(accelerate(points, images, np.array([1.0, 0.0])) if len(images) > 1 else images[-1])
    assert points[-1] == pytest.approx([0.4, 4.0])
