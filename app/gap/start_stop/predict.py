"""What the simulated drive predicts of every cause: how far what its cycles tell would change."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from app.gap.start_stop.causes import TORQUE_GAIN, TRIED, parameters_with, setting_of
from app.gap.start_stop.twin import DriveTwin
from app.gap.start_stop.worn import worn_curve_um
from gearsig.checks import FloatArray
from gearsig.errors import GearsigError
from gearsig.gap.start_stop.told import NAMES, Spot, Told, change_of
from gearsig.gap.start_stop.weigh import Predicted
from sims.effects import EffectSetting
from sims.forging.effects import with_effects
from sims.forging.parameters import PARAMETERS
from sims.values import complete_values

Tell = Callable[[str, float], object]


@dataclass(frozen=True)
class Predictions:
    """All causes, and the shape of worn flanks that their changes were measured with."""

    causes: dict[str, Predicted]
    shape: FloatArray
    options: dict[str, dict[str, float | str]]


def curve_shape(twin: DriveTwin) -> FloatArray:
    """Return the course of the compression over the mesh cycle that flanks worn by 50 µm give, its mean taken off."""
    curve = worn_curve_um(twin.parameters, twin.sound.contact.deflection_um, 50.0)
    shape: FloatArray = curve - np.mean(curve)
    return shape


def predict(
    twin: DriveTwin,
    spot: Spot,
    order: int,
    names: tuple[str, ...],
    tell: Tell = lambda *_: None,
    *,
    with_reference: bool = True,
) -> Predictions:
    """Simulate every cause at some severities.

    Worn flanks and a cracked tooth move the gears against each other by hundredths of a millimetre; that is added to
    what the sound drive tells, without the noise of a run: the play by the mean depth over the mesh cycle, the curve by
    its shape (the drive in motion agrees, see the tests), a tooth by what its lost stiffness lets it yield. A sensor
    that misreads changes no motion. All others are run.

    Parameters
    ----------
    twin : DriveTwin
    spot : Spot
        Where the recording changed most: the tooth that is cracked, and the place of the ripple's order.
    order : int
        Of the ripple.
    names : tuple of str
        Causes that the recording can tell.
    tell : callable
        Is told the cause and the share that is done.
    with_reference : bool
        Whether a sound recording is compared with, and not the simulated drive.
    """
    shape = curve_shape(twin)
    options: dict[str, dict[str, float | str]] = {
        "root_crack": {"gear": "driver", "tooth": float(spot.tooth + 1)},
        "torque_ripple": {"order": float(order)},
    }
    causes = {}
    for i, name in enumerate(names):
        tell(name, i / len(names))
        rows, kept = [], []
        shown = np.isin(NAMES, TRIED[name].shows_in)
        for severity in TRIED[name].severities:
            told = (
                _misread(twin, severity, with_reference=with_reference)
                if name == TORQUE_GAIN
                else _told(twin, name, severity, options.get(name, {}), spot)
            )
            change = None if told is None else change_of(told, twin.sound, shape, spot)
            if change is not None and np.isfinite(change[shown]).any():  # else it stands still
                rows.append(change)
                kept.append(severity)
        if rows:
            changes = np.where(shown, np.nan_to_num(np.array(rows)), 0.0)
            free, direct = (np.isin(NAMES, which) for which in (TRIED[name].may_move, TRIED[name].direct))
            causes[name] = Predicted(name, np.array(kept), changes, free, direct)
    return Predictions(causes, shape, {name: options.get(name, {}) for name in causes})


def _told(twin: DriveTwin, name: str, severity: float, options: dict[str, float | str], spot: Spot) -> Told | None:
    """Return what a drive with a cause tells; None where it cannot run: a load that cannot be moved, say."""
    if name == "tooth_wear":
        return _worn(twin, severity)
    try:
        settings = setting_of(name, severity, options)
        if name == "root_crack":
            return _cracked(twin, settings[0], spot)
        return twin.tell(parameters_with(name, severity, twin.parameters), settings)
    except GearsigError:
        return None


def _worn(twin: DriveTwin, depth_um: float) -> Told:
    sound = twin.sound
    curve = worn_curve_um(twin.parameters, sound.contact.deflection_um, depth_um)
    mean = float(np.mean(curve))
    contact = replace(
        sound.contact,
        play_um=sound.contact.play_um + mean,
        curve_um=sound.contact.curve_um + curve - mean,
    )
    return replace(sound, contact=contact)


def _misread(twin: DriveTwin, percent: float, *, with_reference: bool) -> Told:
    """Return what a torque sensor of another gain makes of the same motion.

    Inertia and friction of the load follow from the torque, and grow with the reading. What the teeth yield does not:
    it stays as in a sound recording, and falls behind a simulated drive, which is driven by the torque that was read.
    That one also takes the friction of its load from the recording.
    """
    gain, sound = 1.0 + 0.01 * percent, twin.sound
    load = replace(sound.load, inertia_kg_m2=gain * sound.load.inertia_kg_m2)
    if with_reference:
        return replace(sound, load=replace(load, friction_nm=gain * sound.load.friction_nm))
    yielding = sound.contact.deflection_um * gain ** (-1.0 / float(twin.parameters["exponent"]))
    return replace(sound, load=load, contact=replace(sound.contact, deflection_um=yielding))


def _cracked(twin: DriveTwin, setting: EffectSetting, spot: Spot) -> Told:
    """Let one tooth yield more, g grows as (1 − loss)^{−1/λ}, among teeth that differ as the recording's do."""
    values = complete_values(PARAMETERS, twin.parameters)
    _, weak = with_effects(values, (setting,))
    assert weak is not None  # noqa: S101  a crack of some depth makes a tooth weak
    sound = twin.sound
    extra = sound.contact.deflection_um * ((1.0 - weak.loss) ** (-1.0 / float(twin.parameters["exponent"])) - 1.0)
    teeth = sound.contact.teeth_um.copy()
    teeth[(spot.tooth + len(teeth) // 2) % len(teeth)] += spot.next_tooth_um
    teeth[spot.tooth] += max(extra, spot.next_tooth_um)
    return replace(sound, contact=replace(sound.contact, teeth_um=teeth))
