"""The playback block: a motion as Structured Text that any IEC 61131-3 controller plays."""
