"""The commands that stream: what is asked for, and what is said."""

from gen_profile.cli.streaming.commands import drive_sim, stream  # noqa: F401  # each adds its commands
