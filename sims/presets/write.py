"""Writes a preset as a file that `read_preset` reads back to the same machine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sims.presets.read import Preset


def preset_text(preset: Preset, comments: Sequence[str] = ()) -> str:
    """Return a preset as TOML; its name is left out: it is that of the file.

    Parameters
    ----------
    preset : Preset
    comments : sequence of str
        Lines ahead of it.
    """
    import tomli_w

    tables: dict[str, Any] = {
        "about": {
            "model": preset.model,
            "title": preset.title,
            "sources": list(preset.sources),
            "assumed": list(preset.assumed),
            "does_not_represent": list(preset.does_not_represent),
        },
        "parameters": dict(preset.parameters),
        "operation": {"speed_rpm": preset.speed_rpm, "torque_nm": preset.torque_nm},
    }
    if preset.effects:
        tables["effects"] = [
            {"name": e.name, "severity": e.severity, "options": dict(e.options)} for e in preset.effects
        ]
    if preset.installed:
        tables["installed"] = dict(preset.installed)
    lines = [" ".join(text.split()) for text in comments]
    return "".join(f"# {line}\n" for line in lines) + ("\n" if lines else "") + tomli_w.dumps(tables)
