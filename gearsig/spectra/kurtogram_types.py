"""A kurtogram: how impulsive each band of a tree of bands is."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gearsig.checks import FloatArray, frozen_array, not_negative
from gearsig.errors import InputError, RefusalError
from gearsig.spectra.band_choice import BandCandidate
from gearsig.spectra.kurtogram_noise import noise_limit

LARGE_SHARE = 0.2
"""Share of the fourth moment from which on a single envelope sample makes a kurtosis a doubtful guide."""

WEAK_KURTOSIS = 0.3
"""Kurtosis that is more than chance in long signals, yet no sign of impacts: slow changes of level do as much."""


@dataclass(frozen=True)
class Kurtogram:
    """Spectral kurtosis over the bands of a tree of halves and thirds.

    K = ⟨|z|⁴⟩/⟨|z|²⟩² - 2 of a band's complex envelope z; 0 for stationary Gaussian noise, -1 for a steady sine. For
    the whole band (level 0), x being real, K = ⟨x⁴⟩/⟨x²⟩² - 3.

    Parameters
    ----------
    low_hz, high_hz : arrays, (n_bands,)
    level : array, (n_bands,)
        log2 of the number of bands that the spectrum is cut into: 0, 1, log2 3, 2, 1 + log2 3, …; ascending.
    kurtosis : array, (n_bands,)
    standard_error : array, (n_bands,)
        Of the kurtosis under Gaussian noise, white within the band.
    largest_share : array, (n_bands,)
        Share of Σ|z|⁴ that the largest envelope sample has: 1 if all the kurtosis is one event.
    n_envelope_samples : array, (n_bands,)
        Samples of z that the kurtosis rests on, about twice the number of independent ones.
    preparation : str
        What was done to the signal first.
    source : str
    """

    low_hz: FloatArray
    high_hz: FloatArray
    level: FloatArray
    kurtosis: FloatArray
    standard_error: FloatArray
    largest_share: FloatArray
    n_envelope_samples: FloatArray
    preparation: str = "none"
    source: str = field(default="")

    def __post_init__(self) -> None:
        arrays = ("low_hz", "high_hz", "level", "kurtosis", "standard_error", "largest_share", "n_envelope_samples")
        for name in arrays:
            object.__setattr__(self, name, frozen_array(getattr(self, name), name, ndim=1))
        if len({len(getattr(self, name)) for name in arrays}) != 1:
            raise InputError("the arrays of a kurtogram differ in length")

    @property
    def centre_hz(self) -> FloatArray:
        """Middle of each band."""
        return (self.low_hz + self.high_hz) / 2

    @property
    def bandwidth_hz(self) -> FloatArray:
        """Width of each band."""
        return self.high_hz - self.low_hz

    @property
    def noise_limit(self) -> FloatArray:
        """Kurtosis that stationary Gaussian noise exceeds in any band at all in one kurtogram of 20."""
        return noise_limit(self.n_envelope_samples, self.standard_error, 0.05)

    @property
    def levels(self) -> FloatArray:
        """The levels, each once, ascending."""
        return np.unique(self.level)

    def best_band(
        self, *, narrowest_hz: float = 0.0, lowest_hz: float = 0.0, highest_hz: float | None = None
    ) -> BandCandidate:
        """Return the band of the largest kurtosis among those allowed; of equals, the widest.

        Parameters
        ----------
        narrowest_hz : float
            Bands are at least that wide: three times the highest modulation frequency sought, or more.
        lowest_hz, highest_hz : float
            Bands lie between these; None is half the sampling rate.

        Raises
        ------
        RefusalError
            If no band fits.
        """
        top = float(self.high_hz.max()) if highest_hz is None else not_negative(highest_hz, "highest_hz", "Hz")
        rounding = 1e-9 * float(self.high_hz.max())
        allowed = (
            (self.bandwidth_hz >= not_negative(narrowest_hz, "narrowest_hz", "Hz") - rounding)
            & (self.low_hz >= not_negative(lowest_hz, "lowest_hz", "Hz") - rounding)
            & (self.high_hz <= top + rounding)
        )
        if not allowed.any():
            raise RefusalError(
                f"no band of the kurtogram lies from {lowest_hz:g} to {top:g} Hz and is {narrowest_hz:g} Hz wide",
                remedy="widen the range or allow narrower bands",
            )
        i = int(np.argmax(np.where(allowed, self.kurtosis, -np.inf)))
        numbers = (float(a[i]) for a in (self.low_hz, self.high_hz, self.level, self.kurtosis, self.standard_error))
        return BandCandidate(*numbers)

    def remarks(self, band: BandCandidate) -> tuple[str, ...]:
        """Return what speaks against trusting a band's kurtosis: chance, few samples, a single event."""
        i = int(np.argmin(np.abs(self.low_hz - band.low_hz) + np.abs(self.high_hz - band.high_hz)))
        n, share = int(self.n_envelope_samples[i]), float(self.largest_share[i])
        remarks = []
        limit = float(self.noise_limit[i])
        if band.kurtosis <= limit:
            remarks.append(
                f"kurtosis {band.kurtosis:.2g} is what noise alone reaches ({limit:.2g} in one kurtogram of 20): "
                "no band stands out"
            )
        elif band.kurtosis <= max(2.0 * limit, WEAK_KURTOSIS):
            remarks.append(f"kurtosis {band.kurtosis:.2g} is small: the band hardly stands out from noise")
        if band.standard_error > 0.1:
            remarks.append(
                f"rests on {n} envelope samples: noise alone scatters by {band.standard_error:.2g}; record longer or "
                "allow wider bands only"
            )
        if share > LARGE_SHARE:
            remarks.append(
                f"one envelope sample carries {100 * share:.0f} % of the fourth moment: a single event, not a train "
                "of impulses, may have chosen the band"
            )
        return tuple(remarks)
