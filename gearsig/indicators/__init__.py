"""Condition indicators."""
