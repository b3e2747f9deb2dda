"""Motions of the axes, continuous and sampled, and measures of them."""
