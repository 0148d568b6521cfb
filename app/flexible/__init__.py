"""A study of the flexible gear pair: maps, sweeps over speed, spectra, as figures and tables."""
