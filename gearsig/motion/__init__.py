"""Measured motion of both gears of a pair: forces between the teeth, impacts, backlash, start–stop indicators."""
