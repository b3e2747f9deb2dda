"""Commands on site: what is measured there, and what follows from it."""

from gen_profile.cli.commissioning import commission, identify, log_swing  # noqa: F401  # each adds its commands
