"""Published and demonstration machines, one TOML each, with sources and what is assumed."""

from sims.presets.read import Preset, preset, presets

__all__ = ["Preset", "preset", "presets"]
