"""Published and demonstration machines, one TOML each, with sources and what is assumed."""

from sims.presets.read import Preset, is_file, preset, presets
from sims.presets.write import preset_text

__all__ = ["Preset", "is_file", "preset", "preset_text", "presets"]
