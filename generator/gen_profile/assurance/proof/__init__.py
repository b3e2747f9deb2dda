"""The proof of a planner block: machines that follow the written block under thousands of commands."""
