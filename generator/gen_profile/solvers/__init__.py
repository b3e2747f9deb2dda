"""Optimal motions: which method solves which problem, and what to change where none does."""
