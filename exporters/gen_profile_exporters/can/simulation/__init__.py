"""CiA 402 drives, simulated, and what they move."""
