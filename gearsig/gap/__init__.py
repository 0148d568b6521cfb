"""The sim-to-real gap: floor, where it lies, which effect causes it, how far it shrinks."""
