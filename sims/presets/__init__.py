"""Published and demonstration machines, one TOML each, with sources and what is assumed."""

from sims.presets._presets import MOST_BYTES, Preset, is_file, preset, preset_text, presets

__all__ = ["MOST_BYTES", "Preset", "is_file", "preset", "preset_text", "presets"]
