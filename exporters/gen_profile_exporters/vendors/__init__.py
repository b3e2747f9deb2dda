"""The playback block, or the motion as a cam, in the formats of vendors' engineering tools."""
