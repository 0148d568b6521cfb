"""From evidence and held-out shrink to calibrated probabilities of start–stop causes."""

from __future__ import annotations

from gearsig.gap.posterior import GapCalibration
from gearsig.gap.start_stop.floors import load_floors


def load_drive_calibration(*, with_reference: bool) -> GapCalibration:
    """Return the calibration that comes with this version; its first shares are those of the evidence."""
    return GapCalibration.from_mapping(load_floors()["with_reference" if with_reference else "without_reference"])


def is_drive_calibrated() -> bool:
    """Whether it was fitted to blind cases."""
    return int(load_floors()["provenance"]["n_cases"]) > 0
