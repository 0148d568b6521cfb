"""Shaft speed and angle, and resampling over angle."""
