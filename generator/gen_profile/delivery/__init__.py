"""What leaves the program: designs written to files, streamed to drives, and deployed to controllers."""
