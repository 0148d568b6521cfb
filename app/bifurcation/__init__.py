"""Bifurcation diagrams of the simulator: what is asked for, one value, a whole folder, the files that come out."""
