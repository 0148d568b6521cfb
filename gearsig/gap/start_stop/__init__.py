"""The gap of start–stop motion: what its cycles tell of a drive, how that changes, which cause explains it."""
