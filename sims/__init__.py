"""Simulators and signal models; from gearsig they use only rig, recording and the gap diagnosis's protocol."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gearsig.recording import Recording
    from sims.effects import EffectSetting
    from sims.machine import Profile
    from sims.simulator import ParameterValue

    ProfileLike = float | Sequence[tuple[float, float]] | Profile

__all__ = ["simulate"]


def simulate(
    model: str = "cracked",
    *,
    preset: str = "",
    parameters: Mapping[str, ParameterValue] | None = None,
    effects: Mapping[str, float] | Sequence[EffectSetting] | None = None,
    speed_rpm: ProfileLike | None = None,
    torque_nm: ProfileLike | None = None,
    duration_s: float = 5.0,
    sampling_rate_hz: float = 20480.0,
    seed: int = 0,
) -> Recording:
    """Simulate a machine and its measurement; the recording carries the rig and the truth.

    Parameters
    ----------
    model : str
        See `sims.registry.simulators`, or ``gearsig simulate --list``.
    preset : str
        Empty: the model's first.
    parameters : mapping or None
        Name → value; the preset's value for each one not given.
    effects : mapping, sequence of EffectSetting or None
        Name → severity in the effect's unit, or settings with options (which gear, which tooth).
    speed_rpm, torque_nm : number, sequence of (time in s, value), Profile or None
        Of the input shaft, linear between points. None: the preset's.
    duration_s, sampling_rate_hz : float
    seed : int
        The same seed gives the same recording.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        If a name does not exist (with the closest that does), or a value is outside its range.

    Examples
    --------
    >>> from sims import simulate
    >>> recording = simulate("cracked", preset="workshop_29_47", effects={"root_crack": 1.5}, duration_s=0.1)
    >>> recording.truth["effects"][0]["name"], recording.channel_names
    ('root_crack', ('a1', 'a2', 'tacho'))
    """
    from sims.registry import Simulation
    from sims.simulator import as_profile, effect_settings

    return Simulation(
        model,
        preset=preset,
        parameters=parameters or {},
        effects=effect_settings(effects),
        speed_rpm=as_profile(speed_rpm, "speed_rpm"),
        torque_nm=as_profile(torque_nm, "torque_nm"),
        duration_s=duration_s,
        sampling_rate_hz=sampling_rate_hz,
        seed=seed,
    ).run()
