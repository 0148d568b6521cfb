"""How the numbers that ship were made: calibrations and the population of the gap diagnosis."""
