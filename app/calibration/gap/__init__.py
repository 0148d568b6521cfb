"""Makes what the gap diagnosis knows from the start: how each effect changes the features of machines drawn at random.

`python -m app.calibration.gap.population` simulates; `python -m app.calibration.gap.calibrate` fits the probabilities.
"""
