"""The planner block: a function block that plans every motion itself, in portable Structured Text."""
