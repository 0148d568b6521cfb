"""One gear as finite elements: mesh, modes, stress, reductions."""
