"""Equations: the optimal control problem of a spec, and machines that follow a motion."""
