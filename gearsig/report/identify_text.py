"""Fitted parameters as text and as JSON.

The JSON object has these members; names end in their unit, numbers carry nine significant digits, and what is not known
is null. Members may be added within a version, never renamed or removed.

- ``schema``: "gearsig.identify", ``schema_version``: 1, ``gearsig_version``, ``source``
- ``parameters``: each with ``name``, ``unit``, ``value``, ``low``, ``high`` (95 %), ``is_told``, ``why_not``,
  ``rig_value``, ``most_like``
- ``equations``: each with ``name``, ``text``, ``condition``
"""

from __future__ import annotations

import json
from textwrap import fill

from gearsig import __version__
from gearsig.formatting import readable, rounded
from gearsig.gap.words import severity_unit
from gearsig.motion.identify_types import FittedParameter, Identification
from gearsig.plot.display import unit_text

SCHEMA, SCHEMA_VERSION = "gearsig.identify", 1
WIDTH = 100


def identify_text(found: Identification) -> str:
    """Return the parameters with their intervals, and what cannot be told, in plain text."""
    lines = [f"{found.source or 'recording'}: parameters with 95 % intervals", ""]
    lines += [f"{name} equation: {text}" for name, text in found.equations.items()]
    lines += ["", f"{'parameter':<26} {'value':>11} {'from':>11} {'to':>11} {'rig':>11}  unit"]
    lines += [_row(p) for p in found.parameters if p.is_told]
    untold = [p for p in found.parameters if not p.is_told]
    if untold:
        lines += ["", "Cannot be told from this record"]
        lines += [fill(f"{p.name}: {p.why_not}", WIDTH, initial_indent="  ", subsequent_indent="    ") for p in untold]
    alike = [f"{p.name} moves with {p.most_like}" for p in found.parameters if p.is_told and p.most_like]
    if alike:
        lines += ["", fill(f"Told together rather than each by itself: {'; '.join(alike)}.", WIDTH)]
    return "\n".join(lines)


def identify_json(found: Identification) -> str:
    """Return the same as JSON, see the module's description."""
    data = {
        "schema": SCHEMA,
        "schema_version": SCHEMA_VERSION,
        "gearsig_version": __version__,
        "source": found.source,
        "parameters": [
            {"name": p.name, "unit": p.unit, "value": rounded(p.value), "low": rounded(p.interval[0]),
             "high": rounded(p.interval[1]), "is_told": p.is_told, "why_not": p.why_not,
             "rig_value": None if p.rig_value is None else rounded(p.rig_value), "most_like": p.most_like}
            for p in found.parameters
        ],
        "equations": [
            {"name": name, "text": text, "condition": rounded(found.condition.get(name, float("nan")))}
            for name, text in found.equations.items()
        ],
    }  # fmt: skip
    return json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _row(p: FittedParameter) -> str:
    rig = "" if p.rig_value is None else readable(p.rig_value, 5)
    low, high = (readable(v, 5) for v in p.interval)
    unit = unit_text(severity_unit(p.unit))
    return f"{p.name:<26} {readable(p.value, 5):>11} {low:>11} {high:>11} {rig:>11}  {unit}".rstrip()
