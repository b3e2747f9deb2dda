"""The direct method: the motion as polynomials, found by convex programs."""
