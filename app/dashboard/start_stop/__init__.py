"""The page of the start–stop drive: what is set, what it does, what it looks like."""
