"""Transmission error: a known one is found again from encoders and tachometers, and parted into mesh and gears."""

from __future__ import annotations

from dataclasses import replace
from math import cos, pi, radians

import numpy as np
import pytest

from gearsig.errors import InputError, RefusalError
from gearsig.motion import transmission_error
from gearsig.recording import Channel, Recording
from gearsig.rig import GearPair, Rig, Shaft, TachometerChannel

Z1, Z2, MODULE_MM = 17, 24, 2.0
RADII_M = tuple(0.5e-3 * z * MODULE_MM * cos(radians(20.0)) for z in (Z1, Z2))
RIG = Rig(
    shafts=(Shaft("in"), Shaft("out")),
    pairs=(GearPair("stage", "in", "out", Z1, Z2, MODULE_MM, 20.0, 20.0),),
)
RATE_HZ = 8000.0
TOOTH_UM = np.zeros(Z1)
TOOTH_UM[5] = 4.0


def error_um(pitches: np.ndarray) -> np.ndarray:
    """Two mesh harmonics, the driver's tooth 6 by 4 um, order 1 of the driven gear."""
    mesh = 3.0 * np.cos(2 * pi * pitches) + 1.0 * np.sin(4 * pi * pitches)
    return mesh + TOOTH_UM[np.floor(pitches).astype(int) % Z1] + 5.0 * np.cos(2 * pi * pitches / Z2)


def angles(duration_s: float = 30.0, rpm: float = 60.0) -> tuple[np.ndarray, np.ndarray]:
    time_s = np.arange(round(duration_s * RATE_HZ)) / RATE_HZ
    driver = 2 * pi * rpm / 60.0 * time_s + 0.02 * np.sin(2 * pi * 0.7 * time_s)
    driven = (RADII_M[0] * driver - 1e-6 * error_um(driver * Z1 / (2 * pi))) / RADII_M[1]
    return driver, driven


def recording(counts: int | None = None, **changes: float) -> Recording:
    rows = [np.degrees(a) for a in angles(**changes)]
    if counts:
        rows = [np.mod(np.floor(a / 360.0 * counts), counts) * 360.0 / counts for a in rows]
    channels = (Channel("e1", "encoder", "deg", "in"), Channel("e2", "encoder", "deg", "out"))
    return Recording(np.array(rows), RATE_HZ, channels, rig=RIG)


def test_mesh_and_gears_are_told_apart() -> None:
    found = transmission_error(recording())
    place = (np.arange(found.n_steps) + 0.5) / found.n_steps
    # Means over a step take off (πh/n)²/6 of harmonic h: 0.6 % of the second.
    np.testing.assert_allclose(
        found.mesh_um, 3.0 * np.cos(2 * pi * place) + np.sin(4 * pi * place), atol=0.02 if found.n_steps > 16 else 0.1
    )
    teeth = found.driver_um.mean(axis=1)
    np.testing.assert_allclose(teeth, TOOTH_UM - TOOTH_UM.mean(), atol=0.02)
    once = found.average(1).lines()[1]
    assert abs(once) == pytest.approx(5.0, rel=0.01)
    assert np.std(found.residual_um) < 0.02
    assert found.teeth == (Z1, Z2)
    assert found.speed_rpm == pytest.approx(60.0, rel=1e-3)


def test_orders_of_the_spectrum_are_the_drivers() -> None:
    spectrum = transmission_error(recording()).spectrum()
    assert spectrum.values[spectrum.index_of(float(Z1))] == pytest.approx(3.0, rel=0.02)
    assert spectrum.unit == "um"


def test_steps_of_hardly_one_reading_lose_no_pitches() -> None:
    found = transmission_error(recording(duration_s=1.0, rpm=60.0 * RATE_HZ / (9.02 * Z1)))
    assert found.n_steps == 9
    assert len(found.cycles_um) > 0.98 * found.mesh_hz
    assert found.driver_um[5].mean() == pytest.approx(4.0 * (1.0 - 1.0 / Z1), rel=0.03)


@pytest.mark.parametrize(("counts", "scatter_um"), [(2048, 3.0), (65536, 0.15), (2**20, 0.03)])
def test_counts_cost_little(counts: int, scatter_um: float) -> None:
    """Slow counts are timed, fast ones averaged: a count of the first is 27 um (standard deviation of its step)."""
    found = transmission_error(recording(counts))
    assert np.std(found.residual_um) < scatter_um
    assert abs(found.average(1).lines()[1]) == pytest.approx(5.0, abs=0.3)
    assert int(np.argmax(found.driver_um.mean(axis=1))) == 5


def test_more_counts_are_surer() -> None:
    coarse, fine = (transmission_error(recording(n)) for n in (4096, 2**18))
    assert fine.driver_error_um.mean() < coarse.driver_error_um.mean()


def test_an_eccentric_encoder_is_order_1_of_its_shaft_and_nothing_else() -> None:
    bare = recording()
    samples = np.array(bare.samples)
    samples[0] += 0.01 * np.sin(np.radians(samples[0]))
    found, then = transmission_error(replace(bare, samples=samples)), transmission_error(bare)
    change = np.abs(found.average(0).lines() - then.average(0).lines())
    assert change[1] == pytest.approx(np.radians(0.01) * RADII_M[0] * 1e6, rel=0.01)
    assert change[2:60].max() < 0.01 * change[1]
    assert np.abs(found.driven_um - then.driven_um).max() < 0.02 * change[1]


def test_fine_tachometers_do_as_well() -> None:
    """Pulses per revolution of the second follow from the teeth."""
    turns = [a / (2 * pi) for a in angles()]
    rows = [np.clip(0.5 + 2.0 * np.sin(2 * pi * n * t), 0.0, 1.0) for n, t in zip((90, 128), turns, strict=True)]
    channels = (Channel("t1", "tachometer", "V", "in"), Channel("t2", "tachometer", "V", "out"))
    made = Recording(np.array(rows), RATE_HZ, channels, TachometerChannel("t1", 90, shaft="in"), rig=RIG)
    found = transmission_error(made)
    assert np.ptp(found.mesh_um) == pytest.approx(6.6, abs=1.5)
    assert abs(found.average(1).lines()[1]) == pytest.approx(5.0, abs=0.5)


def test_what_cannot_be_is_refused() -> None:
    good = recording()
    stretched = np.array(good.samples) * np.array([[1.0], [1.01]])
    nameless = replace(RIG, pairs=(replace(RIG.pairs[0], module_mm=None),))
    with pytest.raises(RefusalError, match='use it as "driven angle"') as caught:
        transmission_error(replace(good, samples=good.samples[:1], channels=good.channels[:1]))
    assert "--" not in str(caught.value)  # it is asked by scripts and by gap diagnoses, too
    with pytest.raises(InputError, match="tooth pitches"):
        transmission_error(replace(good, samples=stretched))
    with pytest.raises(RefusalError, match="tooth pitch"):
        transmission_error(recording(32))
    with pytest.raises(RefusalError, match="revolutions"):
        transmission_error(recording(duration_s=1.5))
    with pytest.raises(RefusalError, match="module"):
        transmission_error(good, nameless)


def test_equal_teeth_share_out_what_both_repeat() -> None:
    """Gears of equal teeth always meet the same mates: the sum of both parts is known, neither alone."""
    time_s = np.arange(round(6.0 * RATE_HZ)) / RATE_HZ
    driver = 4 * pi * time_s
    delta = TOOTH_UM[np.floor(driver * Z1 / (2 * pi)).astype(int) % Z1]
    driven = driver - 1e-6 * delta / RADII_M[0]
    rig = replace(RIG, pairs=(replace(RIG.pairs[0], driven_teeth=Z1),))
    made = replace(recording(), samples=np.degrees(np.array([driver, driven])), rig=rig)
    found = transmission_error(made)
    first, second = found.driver_um.mean(axis=1), found.driven_um.mean(axis=1)
    np.testing.assert_allclose(first, second, atol=1e-6)
    np.testing.assert_allclose(first + second, TOOTH_UM - TOOTH_UM.mean(), atol=0.05)
