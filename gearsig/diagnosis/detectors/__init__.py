"""One question per file: each detector looks at the signals and returns findings."""
