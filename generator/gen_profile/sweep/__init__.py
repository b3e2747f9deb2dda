"""Designs over a grid of parameters: cases, their store and table, lookup, profile library."""
