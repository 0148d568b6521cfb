"""Spectra and averages over shaft angle: orders, maps, tracked orders, synchronous averages."""
