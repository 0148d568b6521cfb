"""What is set on the page: a machine, how it runs, its effects, and how it is measured."""

from __future__ import annotations

from dataclasses import dataclass, replace

from sims.effects import EffectSetting, effect
from sims.simulator import ParameterValue

MODEL = "cracked"
"""Whose motion the bifurcation can follow."""
MODELS = (MODEL, "reduced-fe")


@dataclass(frozen=True)
class Setup:
    """Everything that decides a simulation: equal setups give equal recordings.

    Parameters
    ----------
    preset : str
    speed_rpm, torque_nm : float
        Of the input shaft, constant.
    parameters : tuple of (name, value)
        What differs from the preset, in the healthy machine as well.
    effects : tuple of EffectSetting
    duration_s, sampling_rate_hz : float
    seed : int
        The same for the healthy twin, so that the two differ by the effects only.
    model : str
        One of `MODELS`.
    """

    preset: str
    speed_rpm: float
    torque_nm: float
    parameters: tuple[tuple[str, ParameterValue], ...] = ()
    effects: tuple[EffectSetting, ...] = ()
    duration_s: float = 1.0
    sampling_rate_hz: float = 20480.0
    seed: int = 0
    model: str = MODEL

    @property
    def healthy(self) -> Setup:
        """The same machine without effects."""
        return replace(self, effects=())

    @property
    def is_healthy(self) -> bool:
        """Whether no effect changes anything."""
        return all(setting.severity == 0 for setting in self.effects)

    @property
    def revolutions_per_s(self) -> float:
        """Of the input shaft."""
        return self.speed_rpm / 60.0

    @property
    def file_stem(self) -> str:
        """Name of its files, without a dot: preset and effects.

        Examples
        --------
        >>> Setup("small_30_25", 1800, 20, effects=(EffectSetting("root_crack", 1.5),)).file_stem
        'small_30_25_root_crack_1_5'
        """
        parts = [f"{s.name}_{s.severity:g}" for s in self.effects] or ["healthy"]
        return "_".join([self.preset, *parts]).replace(".", "_")[:100]


def effect_text(setting: EffectSetting) -> str:
    """Name an effect with its severity, e.g. "crack in a tooth root, 2 mm"."""
    found = effect(setting.name)
    return f"{found.title}, {setting.severity:.4g} {shown_unit(found.severity.unit)}".rstrip()


def shown_unit(unit: str) -> str:
    """Write a unit of the catalogue as people read it."""
    from gearsig.gap.words import severity_unit
    from gearsig.plot.display import unit_text

    return unit_text(severity_unit(unit))
