"""The indirect method: Pontryagin's conditions as a boundary value problem."""
