"""Effect: rougher flanks."""

from __future__ import annotations

from dataclasses import replace
from math import hypot

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from sims.effects._effect import Effect, Option, Options, PlausibleRange, Severity
from sims.effects.textbook import UP, Signature, SyntheticScene, Textbook, at_the_mesh, balance, band_noise
from sims.machine import Machine, Roughness

_AS_IT_IS = "as it is"


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with rougher flanks."""
    del rng  # the profile is drawn by the simulator
    locked_to = _locked_to(machine.roughness, str(options["locked_to"]))
    rms_um = hypot(machine.roughness.rms_um, severity)
    return replace(machine, roughness=replace(machine.roughness, rms_um=rms_um, locked_to=locked_to))


def _locked_to(now: Roughness, requested: str) -> str:
    if requested in (_AS_IT_IS, now.locked_to):
        return now.locked_to
    # Otherwise a vanishing severity would change the existing profile.
    if now.rms_um > 0:
        raise InputError(
            f"the flanks already have {now.rms_um:g} µm, locked to {now.locked_to!r}, and {requested!r} was asked for",
            where="locked_to of surface_roughness",
            allowed=f"{_AS_IT_IS!r} or {now.locked_to!r}",
            remedy="change the model's own roughness",
        )
    return requested


def textbook_signature(scene: SyntheticScene, size: float, rng: np.random.Generator) -> Signature:
    """Asperities sliding over each other: band noise, more or less modulated by the mesh."""
    loose, locked = balance(rng, 2)
    total = sum(
        (at_the_mesh(scene, band_noise(scene, rng), rng) * rng.uniform(0.3, 1.0) for _ in range(3)),
        np.zeros(len(scene.time_s)),
    )
    sides = [_born_with(scene, side, rng) * rng.uniform(0.0, 1.0) for side in (0, 1)]
    return Signature(added=(0.8 * size * loose * total, 0.8 * size * locked * (sides[0] + sides[1])))


def _born_with(scene: SyntheticScene, side: int, rng: np.random.Generator) -> FloatArray:
    """Return a waveform of unit size that a gear repeats each revolution: lines at all its orders in a broad band."""
    teeth = scene.teeth[side]
    low, high = teeth * rng.uniform(0.5, 3.0), teeth * rng.uniform(4.0, 9.0)
    n = 2 * int(high) + 2
    orders = np.arange(n // 2 + 1)
    lines = (rng.standard_normal(len(orders)) + 1j * rng.standard_normal(len(orders))) * (
        (orders > low) & (orders < high)
    )
    wave = np.fft.irfft(lines, 8 * n)
    places = scene.revolutions * scene.shaft_orders[side] % 1.0 * len(wave)
    waveform: FloatArray = np.interp(places, np.arange(len(wave) + 1), np.append(wave, wave[0]))
    return waveform / max(float(waveform.std()), 1e-12)


EFFECT = Effect(
    name="surface_roughness",
    group="flank",
    title="rougher flanks",
    severity=Severity(
        "added_rms_um", "um", 0.0, 3.0, 0.8, "added rms roughness; the squares of independent finishes add"
    ),
    changes="The composite rms roughness becomes √(R² + severity²): the fractal profile that opens and closes the "
    "contact grows with it, and so does the friction coefficient.",
    signature="Broadband: fractal lines and a raised floor between mesh harmonics, strongest about the resonances; "
    "mesh harmonics from friction, above all across the line of action. Locked to the flank, the lines are orders of "
    "both shafts and repeat with the hunting-tooth period; locked to time, they are at fixed frequencies and no "
    "synchronous average retains them. Above about 0.8 µm friction rises steeply.",
    shows_in=("broadband", "mesh_harmonics", "shaft_orders"),
    change=change,
    options=(
        Option(
            "locked_to",
            _AS_IT_IS,
            "what the profile repeats with; 'none': roughness affects friction only",
            choices=(_AS_IT_IS, "time", "flank", "none"),
        ),
    ),
    plausible=PlausibleRange(
        0.3, 2.5, "um: ground flanks have 0.4, hobbed or worn ones 1 to 3; it does not grow with the gear"
    ),
    textbook=Textbook(
        (("floor.band.3", UP), ("floor.band.4", UP), ("tooth.driver.elsewhere", UP)),
        "noise rises over a wide band",
        textbook_signature,
    ),
)
