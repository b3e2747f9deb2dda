"""A verified motion streamed to drives, and what became of it."""
