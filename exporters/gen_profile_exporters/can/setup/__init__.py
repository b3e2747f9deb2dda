"""Drives set up before a motion and put back after it, by SDO, and held to what the spec says of them."""
