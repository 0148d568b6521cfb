"""The command line and the dashboard: faces over the library."""
