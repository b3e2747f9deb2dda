"""What is in a picture's file."""

from pathlib import Path

import numpy as np
from matplotlib import image


def colours(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Find the colours of a PNG as rows of red, green, blue and opacity, and how many pixels have each."""
    pixels = np.round(255 * image.imread(path)).astype(np.uint8)
    found, counts = np.unique(pixels.view(np.uint32), return_counts=True)
    return found.view(np.uint8).reshape(-1, 4), counts
