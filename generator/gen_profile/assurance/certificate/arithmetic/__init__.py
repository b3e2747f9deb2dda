"""Numbers that enclose: balls, affine forms, Chebyshev series of them, and their matrices."""
