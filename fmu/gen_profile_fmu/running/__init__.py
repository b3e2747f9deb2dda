"""FMUs run: ours in memory, one or thousands, and somebody else's in a child process."""
