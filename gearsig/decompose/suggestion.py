"""What was tried to find the number of modes and the penalty, and why one pair is suggested."""

from __future__ import annotations

from dataclasses import dataclass

from gearsig.decompose.types import ModeAxis, VmdSettings


@dataclass(frozen=True)
class ModeTrial:
    """One number of modes at one penalty.

    Parameters
    ----------
    settings : VmdSettings
        With the start that did better: "uniform", or "peaks" where the uniform one met an objection.
    centres, bandwidths : tuple of float
        By rising centre, in Hz or orders.
    reconstruction_error : float
        Root mean square of the residual over that of the signal.
    separation : float
        Smallest distance of two centres over the distance at which a mode's gain is one half; inf for one mode. Below 1
        two modes share their lines.
    widest : float
        Largest bandwidth over the one that white noise alone would give a mode; 1 is noise, a tone is near 0.
    smallest_share : float
        Energy of the weakest mode over the signal's.
    n_iterations : int
    converged : bool
    objection : str
        Why this trial is not suggested; empty if it could be.
    """

    settings: VmdSettings
    centres: tuple[float, ...]
    bandwidths: tuple[float, ...]
    reconstruction_error: float
    separation: float
    widest: float
    smallest_share: float
    n_iterations: int
    converged: bool
    objection: str

    @property
    def n_modes(self) -> int:
        """Number of modes tried."""
        return self.settings.n_modes

    @property
    def penalty(self) -> float:
        """Penalty tried."""
        return self.settings.penalty


@dataclass(frozen=True)
class ModeSuggestion:
    """Settings for a signal, with their reasons and everything that was tried.

    Parameters
    ----------
    chosen : ModeTrial
    trials : tuple of ModeTrial
        By penalty, then number of modes.
    reasons : tuple of str
        One sentence each.
    axis : str
        "frequency" or "order".
    source : str
    """

    chosen: ModeTrial
    trials: tuple[ModeTrial, ...]
    reasons: tuple[str, ...]
    axis: ModeAxis
    source: str

    @property
    def settings(self) -> VmdSettings:
        """The suggested number of modes, penalty and start."""
        return self.chosen.settings

    def describe(self) -> str:
        """Return reasons and table as text; the suggested row is marked."""
        head = "".join(f"{name:>11}" for name in ("penalty", "modes", "start", "residual %", "separation", "widest"))
        head += f"{'weakest %':>11}  objection"
        lines = [f"Suggested for {self.source or 'signal'}:", *self.reasons, "", "  " + head]
        for t in self.trials:
            mark = ">" if t is self.chosen else " "
            lines.append(
                f"{mark} {t.penalty:>11g}{t.n_modes:>11}{t.settings.start!s:>11}{100 * t.reconstruction_error:>11.2f}"
                f"{t.separation:>11.2f}{t.widest:>11.2f}{100 * t.smallest_share:>11.2g}  {t.objection or '-'}"
            )
        return "\n".join(lines)
