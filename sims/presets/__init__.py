"""Published and demonstration machines, one TOML each, with sources and what is assumed."""

from sims.presets._presets import MAX_BYTES, Preset, is_file, preset, preset_text, presets

__all__ = ["MAX_BYTES", "Preset", "is_file", "preset", "preset_text", "presets"]
