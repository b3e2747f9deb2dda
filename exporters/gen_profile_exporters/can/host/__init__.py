"""The computer: its CAN interfaces, clock, priorities, and terminal."""
