"""Effect: more play between the flanks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearsig.checks import FloatArray
from sims.effects import textbook as book
from sims.effects._effect import DriveEffect, DriveParameters, Effect, Options, PlausibleRange, Severity
from sims.effects._parts import module_mm
from sims.machine import Machine


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with more backlash, half of it on each side."""
    del options, rng
    return replace(machine, half_backlash_um=machine.half_backlash_um + severity / 2.0)


def on_drive(drive: DriveParameters, severity: float, options: Options) -> DriveEffect:
    """Increase the backlash by the severity."""
    del options
    return DriveEffect({"half_backlash_um": drive.number("half_backlash_um") + 0.5 * severity})


def textbook_signature(scene: book.SyntheticScene, size: float, rng: np.random.Generator) -> book.Signature:
    """Teeth that separate and meet again: impacts at the mesh order or half of it, scattered; other mesh harmonics."""
    order = scene.teeth[0] * float(rng.choice((0.5, 1.0)))
    at = book.passings(scene, order, rng.uniform())
    kept = at[rng.uniform(size=len(at)) < rng.uniform(0.3, 1.0)]
    if len(kept) > 1:  # lightly loaded teeth meet at random times
        late = float(rng.choice((0.0, 0.5))) * rng.uniform() * float(np.median(np.diff(at)))
        kept = kept + late * rng.uniform(-1.0, 1.0, len(kept))
    sizes = rng.normal(1.0, rng.uniform(0.1, 0.6), len(kept))
    blows = np.zeros(len(scene.time_s))
    for _ in range(int(rng.integers(1, 4))):
        rung = book.struck(kept, sizes, scene, book.ring(scene, rng))
        blows += rung / max(float(rung.std()), 1e-12)
    gains = np.exp(1.5 * min(size, 1.0) * book.partly(rng) * rng.standard_normal(book.N_MESH_HARMONICS))
    half = 0.5 * size * rng.uniform() * book.tone(scene.teeth[0] / 2.0, scene, rng)
    restless = np.maximum(1.0 + size * rng.uniform(0.0, 1.5) * _slow_noise(scene, rng), 0.0)
    return book.Signature(
        gain=restless, added=(2.0 * size * blows, half), mesh_gains=tuple(gains.tolist()), around=book.partly(rng)
    )


def _slow_noise(scene: book.SyntheticScene, rng: np.random.Generator) -> FloatArray:
    """Return noise of unit size that varies within a fraction of a revolution."""
    turns = scene.revolutions[-1] - scene.revolutions[0]
    n = int(turns * rng.uniform(2.0, 0.5 * scene.teeth[0])) + 2
    nodes = np.linspace(scene.revolutions[0], scene.revolutions[-1], n)
    return np.asarray(np.interp(scene.revolutions, nodes, rng.standard_normal(n)))


EFFECT = Effect(
    name="backlash",
    group="drive and load",
    title="more backlash",
    severity=Severity(
        "added_um", "um", 0.0, 1000.0, 100.0, "play that is added along the line of action, from flank to flank"
    ),
    changes="The flanks have that much more backlash. While the mesh force stays above zero nothing changes at all.",
    signature="Only where teeth separate: at light load, at a resonance, in reversals and start–stop. There: impacts "
    "on both flanks, a raised floor, subharmonics and chaotic motion, jumps of level over speed. At full steady load "
    "no method can see it.",
    shows_in=("low_load", "broadband", "mesh_harmonics"),
    change=change,
    plausible=PlausibleRange(25.0, 300.0, "um per mm of module; new gears have some 20 to 50", module_mm),
    on_drive=on_drive,
    textbook=book.Textbook(
        (("mesh.half", book.UP), ("line.half_mesh", book.UP)),
        "half orders of the mesh when teeth part",
        textbook_signature,
        source="A. Kahraman, R. Singh, Non-linear dynamics of a spur gear pair, J. Sound Vib. 142 (1990)",
    ),
)
