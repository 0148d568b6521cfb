"""Simulators and signal models; they use only gearsig.rig and gearsig.recording."""
