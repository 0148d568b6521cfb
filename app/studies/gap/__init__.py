"""Makes what the gap diagnosis knows from the start: how each effect changes the features of machines drawn at random.

`python -m app.studies.gap.population` simulates; `python -m app.studies.gap.calibrate` fits the probabilities.
"""
