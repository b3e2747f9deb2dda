"""Watching a block in a controller while it runs: reading its state, judging it, keeping its course."""
