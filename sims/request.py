"""Speed, torque and effects as people write them, in the simulators' own types."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from gearsig.errors import InputError
from sims.effects.effect import EffectSetting
from sims.machine.operation import Course, Operation
from sims.presets import preset

if TYPE_CHECKING:
    from sims import Profile


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
    model: str, preset_name: str, speed_rpm: Profile | None, torque_nm: Profile | None
) -> Operation | None:
    """Return the wanted operation, the preset's own where only one of the two is given, None where neither is."""
    if speed_rpm is None and torque_nm is None:
        return None
    own = preset(model, preset_name).operation
    return Operation(
        own.speed_rpm if speed_rpm is None else _course(speed_rpm, "speed_rpm"),
        own.torque_nm if torque_nm is None else _course(torque_nm, "torque_nm"),
    )


def _course(profile: Profile, name: str) -> Course:
    if isinstance(profile, Course):
        return profile
    try:
        if isinstance(profile, Sequence):
            times, values = zip(*profile, strict=True)
            return Course.of(times, values)
        return Course.constant(profile)
    except (TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{name} is {profile!r}", allowed="a number, or (time in s, value) points") from None
