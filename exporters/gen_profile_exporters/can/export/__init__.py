"""The files of a motion: logs, DBC."""
