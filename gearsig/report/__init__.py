"""Results as JSON and self-contained HTML."""
