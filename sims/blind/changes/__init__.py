"""What may be wrong with the blind rig, one family per file."""
