"""A machine's parameters from what can be measured on site."""
