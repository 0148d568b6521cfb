"""Makes the prior knowledge of the gap diagnosis: how each effect changes the features of random machines.

`python -m app.studies.gap.population` simulates; `python -m app.studies.gap.calibrate` fits the probabilities.
"""
