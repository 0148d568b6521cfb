"""Speed, torque and effects as people write them, in the simulators' own types."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from gearsig.errors import InputError
from sims.effects import EffectSetting, effect
from sims.machine import Operation, Profile
from sims.presets import preset, presets
from sims.simulator import Parameter, Values

if TYPE_CHECKING:
    from sims import ProfileLike


def effect_settings(effects: Mapping[str, float] | Sequence[EffectSetting] | None) -> tuple[EffectSetting, ...]:
    """Return settings, given as such or as name → severity."""
    if effects is None:
        return ()
    if isinstance(effects, (str, bytes)):  # type: ignore[unreachable]  # what a caller may give all the same
        raise InputError(f"effects is {effects!r}", allowed='name and severity, e.g. {"root_crack": 2.0}')
    if isinstance(effects, Mapping):
        return tuple(EffectSetting(name, severity) for name, severity in effects.items())
    return tuple(effects)


def operation_of(
    model: str, preset_name: str, speed_rpm: ProfileLike | None, torque_nm: ProfileLike | None
) -> Operation | None:
    """Return the wanted operation, the preset's own where only one of the two is given, None where neither is."""
    if speed_rpm is None and torque_nm is None:
        return None
    own = preset(model, preset_name).operation
    return Operation(
        own.speed_rpm if speed_rpm is None else _profile(speed_rpm, "speed_rpm"),
        own.torque_nm if torque_nm is None else _profile(torque_nm, "torque_nm"),
    )


def _profile(profile: ProfileLike, name: str) -> Profile:
    if isinstance(profile, Profile):
        return profile
    try:
        if isinstance(profile, Sequence):
            times, values = zip(*profile, strict=True)
            return Profile.of(times, values)
        return Profile.constant(profile)
    except (TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{name} is {profile!r}", allowed="a number, or (time in s, value) points") from None


# --------------------
# What was put into a simulation, as plain values.
# --------------------


def truth_of(
    model: str, preset_name: str, values: Values, settings: Sequence[EffectSetting], operation: Operation
) -> dict[str, Any]:
    """Return what was put into a simulation as plain values, for `Recording.truth`."""
    return {
        "model": model,
        "preset": preset_name,
        "parameters": dict(values),
        "effects": [
            {"name": s.name, "severity": s.severity, "unit": effect(s.name).severity.unit, "options": dict(s.options)}
            for s in settings
        ],
        "operation": {"speed_rpm": operation.speed_rpm.as_dict(), "torque_nm": operation.torque_nm.as_dict()},
    }


# --------------------
# What a simulator states of itself: name, parameters, machines, effects, and where its recordings come from.
# --------------------


@dataclass(frozen=True)
class Model:
    """Base of the simulators, which give these fields values of their own.

    Parameters
    ----------
    name : str
        Short, as on the command line.
    title : str
        One line for people.
    parameters : tuple of Parameter
        All of them.
    effects : tuple of str
        Names of the effects that have a meaning.
    meaningless : tuple of str
        What of them has none, and why, one sentence each.
    """

    name: str
    title: str
    parameters: tuple[Parameter, ...] = field(repr=False)
    effects: tuple[str, ...] = field(repr=False)
    meaningless: tuple[str, ...] = field(default=(), repr=False)

    @property
    def presets(self) -> tuple[str, ...]:
        """Names of the machines."""
        return tuple(presets(self.name))

    def rig_name(self, preset_name: str) -> str:
        """Return the name of a simulated recording's rig."""
        return f"simulated: {preset_name}"

    def rig_sources(self, preset_name: str) -> list[str]:
        """Return what such a rig says of where it comes from."""
        return [f"simulated with the model {self.name!r}, preset {preset_name!r}; the truth stands in the recording"]
