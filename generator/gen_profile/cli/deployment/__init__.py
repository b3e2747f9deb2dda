"""Commands that put a table into a controller, and one that simulates a controller."""

from gen_profile.cli.deployment import commands  # noqa: F401  # each adds its commands
