"""The commands that stream: what is asked for, and what is said."""
