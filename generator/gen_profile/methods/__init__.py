"""How motions are found: optimal control and input shapers."""
