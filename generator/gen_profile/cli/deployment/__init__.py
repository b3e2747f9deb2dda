"""Commands that put a table into a controller, and one that simulates a controller."""
