"""Effects that can be switched on: one file each; see `sims.effects.effect`."""

from sims.effects.catalogue import effect, effects, with_effects
from sims.effects.effect import Effect, EffectSetting, Option, Severity

__all__ = ["Effect", "EffectSetting", "Option", "Severity", "effect", "effects", "with_effects"]
