"""FMUs run: ours in memory, one or thousands, and external ones in a child process."""
