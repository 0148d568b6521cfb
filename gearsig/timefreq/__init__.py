"""Spectra over time: STFT, wavelets, synchrosqueezing, over time or shaft angle."""
