"""Vold–Kalman order tracking: orders taken out of a recording as waveforms; offered by `gearsig.orders`."""
