"""Input shapers, the classical answer to sway: one pure function each, and one table."""
