"""Machines with fewer motors than coordinates, one file each."""
