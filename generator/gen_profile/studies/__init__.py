"""Many motions or machines at once: comparisons, sweeps, and parameters found from measurements."""
