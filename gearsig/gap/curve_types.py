"""The curves that a gap report draws: order spectra, energy over the angle, synchronous averages."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gearsig.checks import FloatArray


@dataclass(frozen=True)
class SpectrumCurves:
    """Order spectra of one shaft's average or of the residual, measured against simulated.

    Parameters
    ----------
    label, unit : str
    orders : array, (n,)
        Of the driver's shaft.
    measured, before, after : arrays, (n,)
        Peak amplitudes; `after` is with the likeliest effect, empty where there is none; `before` is empty where
        nothing was simulated.
    floor : array, (n,)
        Repeatability; where nothing was simulated, the noise beside the lines.
    structural_db : array, (n,)
        How far healthy machines lie from what is compared with, line by line; empty: not known.
    reference, reference_floor, reference_structural_db : arrays, (n,)
        Peak amplitudes of the healthy reference, the repeatability floor of both recordings, and how far healthy
        machines change from one recording to another; empty where there is no reference.
    """

    label: str
    unit: str
    orders: FloatArray
    measured: FloatArray
    before: FloatArray
    after: FloatArray
    floor: FloatArray
    structural_db: FloatArray = field(default_factory=lambda: np.zeros(0))
    reference: FloatArray = field(default_factory=lambda: np.zeros(0))
    reference_floor: FloatArray = field(default_factory=lambda: np.zeros(0))
    reference_structural_db: FloatArray = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True)
class AngleCurves:
    """The residual synchronous average of one shaft over its angle, measured against simulated.

    Parameters
    ----------
    shaft, unit : str
    teeth : int
    has_mark : bool
        Whether angle 0 is a mark, so that teeth have numbers.
    angle_deg : array, (n,)
    measured, before, after : arrays, (n,)
        Energy within one pitch, over the middling tooth's; `after` may be empty.
    """

    shaft: str
    unit: str
    teeth: int
    has_mark: bool
    angle_deg: FloatArray
    measured: FloatArray
    before: FloatArray
    after: FloatArray


@dataclass(frozen=True)
class AverageCurves:
    """What tells a shaft's teeth apart in its synchronous average, of the recording and of the healthy reference.

    Parameters
    ----------
    shaft, unit, channel : str
    teeth : int
    has_mark : bool
        Whether angle 0 is a mark, so that teeth have numbers.
    angle_deg : array, (n,)
    measured, reference : arrays, (n,)
        Without the mesh harmonics, what lies close to them and the first shaft orders; the reference turned so that
        the same teeth meet, and its gain matched as far as a slightly other speed or load explains it.
    """

    shaft: str
    unit: str
    channel: str
    teeth: int
    has_mark: bool
    angle_deg: FloatArray
    measured: FloatArray
    reference: FloatArray
