"""Optimal motions: which method solves which problem, and how least values are searched."""
