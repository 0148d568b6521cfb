"""Effects that can be switched on: one file each; see `sims.effects.effect`."""

from sims.effects.catalogue import add_effect, completed, effect, effects, is_own, with_effects
from sims.effects.effect import Effect, EffectSetting, Option, Severity

__all__ = [
    "Effect",
    "EffectSetting",
    "Option",
    "Severity",
    "add_effect",
    "completed",
    "effect",
    "effects",
    "is_own",
    "with_effects",
]
