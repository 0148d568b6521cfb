"""Spectra over frequency: amplitude, power, envelope, cepstrum."""
