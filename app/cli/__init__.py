"""The `gearsig` command: one module a command."""
