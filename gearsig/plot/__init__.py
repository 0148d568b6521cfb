"""Figures of results; no arithmetic beyond display units."""
