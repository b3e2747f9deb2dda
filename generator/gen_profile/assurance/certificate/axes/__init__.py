"""Axes under a file's setpoints: what these ask for, the motion that follows, and a smooth one beside it."""
