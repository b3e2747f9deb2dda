"""Commands on site: what is measured there, and what follows from it."""
