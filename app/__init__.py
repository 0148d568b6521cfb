"""Command line, dashboard, benchmark and studies: user interfaces of the library."""
