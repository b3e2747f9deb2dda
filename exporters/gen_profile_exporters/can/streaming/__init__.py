"""The streamer: setpoints in time, drives watched, and axes stopped."""
