"""A simulation beside a recording: aligned in angle, compared by order, band and angle. Names no cause."""
