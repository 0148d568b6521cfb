"""How deep a crack in a tooth root is: millimetres and percent with an interval, or why that cannot be told."""
