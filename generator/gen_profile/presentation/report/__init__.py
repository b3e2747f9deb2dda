"""Self-contained HTML pages: values that say what stands on one, and how a browser gets to see it."""
