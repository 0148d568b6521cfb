"""From signals and indicators to findings in words and numbers."""
