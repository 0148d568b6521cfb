"""Methods beyond the first look at a recording, each with its parameters; only the chosen one is computed."""
