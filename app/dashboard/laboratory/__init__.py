"""The fault laboratory: a simulated machine, healthy beside faulty, that follows its sliders."""
