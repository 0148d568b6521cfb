"""Recordings: channels over time, readers, quality of the data."""
