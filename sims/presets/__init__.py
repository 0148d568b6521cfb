"""Published and demonstration machines, one TOML each, with sources and what is assumed."""

from sims.presets._presets import Preset, is_file, preset, preset_text, presets, read_preset

__all__ = ["Preset", "is_file", "preset", "preset_text", "presets", "read_preset"]
