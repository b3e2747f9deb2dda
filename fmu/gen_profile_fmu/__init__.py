"""FMUs of plants, and their co-simulation."""
