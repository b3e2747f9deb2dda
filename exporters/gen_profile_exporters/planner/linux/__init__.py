"""The planner block as the program of a Linux machine."""
