"""The parts of the gap page."""
