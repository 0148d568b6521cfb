"""One reader per file format; each returns a `RawTable` that one place turns into a Recording."""
