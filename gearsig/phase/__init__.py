"""Motion in its phase space: portraits, Poincaré sections, embedding, Lyapunov exponents."""
