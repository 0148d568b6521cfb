"""Command line, dashboard, benchmark and studies: faces over the library."""
