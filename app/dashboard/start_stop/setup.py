"""What is set on the page of the start–stop drive."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from sims.effects import EffectSetting
from sims.simulator import ParameterValue

if TYPE_CHECKING:
    from gearsig.recording.types import Recording

MODEL = "forging"


@dataclass(frozen=True)
class DriveSetup:
    """Everything that decides a run: equal setups give equal recordings.

    Parameters
    ----------
    preset : str
    speed_rpm, torque_nm : float
        Of the pinion: what the flow allows, and the motor's.
    parameters : tuple of (name, value)
        What differs from the preset, in the sound drive as well.
    effects : tuple of EffectSetting
    duration_s, sampling_rate_hz : float
    """

    preset: str
    speed_rpm: float
    torque_nm: float
    parameters: tuple[tuple[str, ParameterValue], ...] = ()
    effects: tuple[EffectSetting, ...] = ()
    duration_s: float = 6.0
    sampling_rate_hz: float = 1000.0

    @property
    def sound(self) -> DriveSetup:
        """The same drive without effects."""
        return replace(self, effects=())

    @property
    def file_stem(self) -> str:
        """Name of its files, without a dot."""
        return "_".join([self.preset, *(setting.name for setting in self.effects)])

    def record(self) -> Recording:
        """Simulate the recording that the command line makes of the same settings."""
        from sims import simulate

        return simulate(
            MODEL,
            preset=self.preset,
            parameters=dict(self.parameters),
            effects=self.effects,
            speed_rpm=self.speed_rpm,
            torque_nm=self.torque_nm,
            duration_s=self.duration_s,
            sampling_rate_hz=self.sampling_rate_hz,
        )
