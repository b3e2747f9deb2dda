"""The verdict: written files replayed, co-simulated on every machine, and judged."""
