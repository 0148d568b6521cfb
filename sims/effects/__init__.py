"""Effects that can be switched on: one file each; see `sims.effects`."""

from sims.effects._catalogue import VARIABLE, add_effect, completed, effect, effects, is_own, own_files, with_effects
from sims.effects._effect import GROUPS, Effect, EffectSetting, Option, OptionValue, Severity
from sims.effects._shared import GEARS, element_spacing_mm, vector_sum, with_bearing
from sims.effects.pitch_error import cumulative_pitch
from sims.effects.unbalance import LARGEST_OFFSET

__all__ = [
    "GEARS",
    "GROUPS",
    "LARGEST_OFFSET",
    "VARIABLE",
    "Effect",
    "EffectSetting",
    "Option",
    "OptionValue",
    "Severity",
    "add_effect",
    "completed",
    "cumulative_pitch",
    "effect",
    "effects",
    "element_spacing_mm",
    "is_own",
    "own_files",
    "vector_sum",
    "with_bearing",
    "with_effects",
]
