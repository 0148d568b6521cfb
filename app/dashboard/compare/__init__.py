"""The page *Simulation against recording*: what it computes, and its parts."""
