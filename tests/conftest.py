"""Hypothesis without deadlines, as machines differ, and with the same examples in every run."""

from hypothesis import settings

settings.register_profile("gen-profile", deadline=None, derandomize=True)
settings.load_profile("gen-profile")
