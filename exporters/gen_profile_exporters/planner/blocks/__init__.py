"""Function blocks of which the planner block is made, and what writes them for a machine."""
