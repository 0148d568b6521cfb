"""Effect: a bearing with too much clearance."""

from __future__ import annotations

import numpy as np

from sims.effects import textbook as book
from sims.effects._effect import Effect, Options, PlausibleRange, Severity
from sims.effects._parts import BEARING_OPTION, any_bearing, chosen_bearing, each_bearing, module_mm, with_bearing
from sims.machine import Machine


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with clearance added to one bearing."""
    del rng
    index = chosen_bearing(machine, options)
    return with_bearing(machine, index, clearance_um=machine.bearings[index].clearance_um + severity)


def textbook_signature(scene: book.SyntheticScene, size: float, rng: np.random.Generator) -> book.Signature:
    """A less rigidly supported shaft: changed paths from the mesh to each sensor, and lines of element passage.

    Also the signs of looseness: many shaft orders, half orders, a mesh modulated by the shaft, and noise. A softer
    support shifts the modes of the path and transmits less at the higher mesh harmonics.
    """
    bearing = scene.bearings[int(rng.integers(len(scene.bearings)))]
    mesh, passing, turn, loose = book.balance(rng, 4)
    turn = max(turn, float(rng.uniform(0.1, 0.5)))  # distinguishes it from a changed path
    limited = min(size, 1.0)
    softer = rng.standard_normal() - rng.uniform(0.0, 0.7) * np.arange(book.N_MESH_HARMONICS)
    gains = np.exp(1.4 * mesh * limited * (rng.standard_normal(book.N_MESH_HARMONICS) + softer))
    lines = [
        0.4 * passing * size / k * book.tone(k * bearing["BPFO"] * float(rng.uniform(0.99, 1.0)), scene, rng)
        for k in (1, 2)
    ]
    fall, halves = float(rng.uniform(0.2, 1.5)), 0.5 * book.partly(rng)
    lines += [0.4 * turn * size / k**fall * book.tone(k * bearing["shaft"], scene, rng) for k in range(1, 11)]
    lines += [0.4 * turn * halves * size / k * book.tone((k - 0.5) * bearing["shaft"], scene, rng) for k in (1, 2, 3)]
    noise = 0.4 * loose * size * book.at_the_mesh(scene, book.band_noise(scene, rng), rng)
    return book.Signature(
        gain=book.swing(scene, bearing["shaft"], 0.5 * turn * book.partly(rng) * size, rng),
        added=(*lines, noise),
        mesh_gains=tuple(gains.tolist()),
        paths_scatter=1.4 * mesh * limited,
        around=book.partly(rng),
        uneven=book.partly(rng) * book.uneven(scene, rng),
        paths=book.draw_path_changes(
            scene.n_channels, limited * book.partly(rng), scene.sampling_rate_hz, rng, everywhere=True
        ),
    )


EFFECT = Effect(
    name="bearing_clearance",
    group="bearing",
    title="clearance in a bearing",
    severity=Severity(
        "added_um", "um", 0.0, 200.0, 30.0, "added radial travel before it carries load: half the diametral clearance"
    ),
    changes="The shaft moves that much further before rolling elements carry load; fewer of them do, so the support is "
    "softer and its stiffness varies as they pass.",
    signature="Lines at the order at which elements pass a point, n(1 − d cos α/D)/2 of the bearing's shaft, and its "
    "multiples, with sums and differences to the mesh; no impacts. Changed mesh harmonics, as the support is softer. "
    "Under a rotating load, harmonics of the shaft; impacts and a raised floor where the load lets the shaft lift.",
    shows_in=("shaft_orders", "envelope_orders", "resonances", "low_load"),
    change=change,
    options=(BEARING_OPTION,),
    plausible=PlausibleRange(
        3.0,
        40.0,
        "um per mm of module: clearance classes C3 to C5 of a bearing of the machine's size, to a worn-out one",
        module_mm,
        each_bearing,
        any_bearing,
    ),
    textbook=book.Textbook(
        (("shaft.{side}.3", book.UP), ("shaft.{side}.low", book.UP), ("envelope.cage", book.UP)),
        "looseness: many orders of the shaft",
        textbook_signature,
        source="J. E. Berry, Illustrated Vibration Diagnostic Chart, 1994: many harmonics of running speed, halves, a "
        "raised floor; M. Tiwari, K. Gupta, O. Prakash, Effect of radial internal clearance of a ball bearing "
        "on the dynamics of a balanced horizontal rotor, J. Sound Vib. 238 (2000): a larger clearance makes the "
        "support softer",
    ),
)
