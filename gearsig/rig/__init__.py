"""The machine: shafts, gear pairs, bearings, sensors, operating point, and the orders they imply."""
