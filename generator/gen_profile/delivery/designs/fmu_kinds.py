"""The kinds of FMUs, and of systems of them, that are written, in a module that loads at once."""

KINDS = ("plant", "profile", "system", "planner", "planned-system", "ssp", "planned-ssp")
