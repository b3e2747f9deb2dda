"""Caches for tests that must compile an FMU, quickly."""

from pathlib import Path


def share_zig(cache: Path, other: Path) -> None:
    """Let another cache use what Zig has built of the C library, which takes seconds."""
    (cache / "zig").mkdir(exist_ok=True)
    other.mkdir(exist_ok=True, mode=0o700)
    (other / "zig").symlink_to(cache / "zig")
