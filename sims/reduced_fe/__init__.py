"""Flexible spur gears: three-dimensional finite elements, their reduction, and pairs of reduced gears."""
