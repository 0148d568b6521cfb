"""How much of each cause a start–stop recording would show: below it, saying nothing means nothing."""

from __future__ import annotations

import numpy as np

from app.gap.start_stop.causes import drive_effects
from app.gap.start_stop.compare import Compared
from app.gap.start_stop.predict import Predictions
from gearsig.formatting import readable
from gearsig.gap.start_stop.floors import FLOOR, DriveFloor
from gearsig.gap.start_stop.weigh import Predicted
from gearsig.gap.words import severity_unit


def least_seen(compared: Compared, predictions: Predictions) -> tuple[str, ...]:
    """Return one sentence with the least severity of every cause that would exceed the floor of this recording."""
    floor, effects = compared.floor(), drive_effects()
    told = []
    for name, cause in predictions.causes.items():
        least = least_severity(cause, floor)
        unit, title = severity_unit(effects[name].unit), effects[name].title
        if np.isfinite(least):
            told.append(f"{title} below {readable(least, 2)} {unit}".rstrip())
        else:
            most = f"{readable(float(cause.severities[-1]), 2)} {unit}".rstrip()
            told.append(f"{title} at all (up to {most} were tried)")
    return (f"This recording would not show: {'; '.join(told)}.",) if told else ()


def least_severity(cause: Predicted, floor: DriveFloor) -> float:
    """Return the least severity above 0 whose change exceeds the floor; infinite where none that was tried does."""
    severities, changes = cause.fine()
    sizes = np.max(np.abs(changes) / (FLOOR * floor.scale), axis=1, initial=0.0)
    seen = severities[(sizes >= 1.0) & (severities > 0.0)]
    return float(seen.min()) if len(seen) else float("inf")
