"""A proved table put into a running controller, read back, and switched to; and a simulated controller."""
