"""Binaries for every platform, compiled once, and whole FMUs made of them."""
