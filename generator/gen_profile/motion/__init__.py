"""Motions of the axes, continuous and sampled, what drives are asked for them, and measures of them."""
