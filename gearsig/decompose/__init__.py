"""Signals taken apart: variational modes, wavelet denoising."""
