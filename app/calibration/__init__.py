"""Scripts that make the calibrations kept with the product; they may use simulators and library alike."""
