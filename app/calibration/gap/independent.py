"""Cases of the independent rig's development gears for the population of the gap diagnosis.

How an effect looks differs from simulator to simulator: what is learned from several holds better for one that none
of them is. Gears of the calibration and evaluation cases are not among these, nor is what the independent rig has
outside the catalogue: what nothing explains must be told by being like nothing.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import typer

from app.calibration.gap.outside import with_foreign_vibration
from app.calibration.gap.sample import SEED, Compared, Sample, reduced
from app.calibration.gap.scene import rig_of
from app.calibration.gap.signatures import made_by_hand, with_signature
from app.gap.conditions import run_length_s, with_channels_of
from gearsig.errors import InputError, RefusalError
from gearsig.gap.gather import gather
from gearsig.gap.gathered import Gathered
from gearsig.gap.population import BY_HAND, INDEPENDENT
from gearsig.gap.simulator import Point
from gearsig.gap.types import NONE, UNKNOWN
from gearsig.recording.types import Recording
from sims.blind import CATALOGUE, draw_case, record_case
from sims.cracked.twin import CrackedTwin
from sims.gear_pair.usual import nominal_of

FIRST_RIG, MOST_CONDITIONS = 100_000, 2
LEAST_LEVEL = 0.25
"""0 (barely noticeable) to 1 (strong)."""
ROUND = (*CATALOGUE, NONE)
N_BY_HAND = 2


def one_case(index: int) -> list[Sample]:
    """Return the samples of one case: its effect, the same without it, and a few made by hand of the latter."""
    rng = np.random.default_rng([SEED, 2, index])
    wanted = ROUND[index % len(ROUND)]
    case = draw_case(
        rng,
        "development",
        kind=NONE if wanted == NONE else "single",
        effect=None if wanted == NONE else wanted,
        level=None if wanted == NONE else float(rng.uniform(LEAST_LEVEL, 1.0)),
        with_reference=True,
    )
    made = record_case(case)
    sound = made.twins or made.conditions
    samples: list[Sample] = []
    for i, (now, sound_now, reference) in enumerate(zip(made.conditions, sound, made.references, strict=True)):
        rig, torque_nm = FIRST_RIG + MOST_CONDITIONS * index + i, case.conditions[i].stated_nm
        severity = case.faults[0].severity if case.faults else 0.0
        try:
            compared = Compared(INDEPENDENT, rig, reduced(reference, rig), _simulated(now, rig, torque_nm))
            samples += [
                compared.sample(label, detail, severity if label == wanted else 0.0, recording, torque_nm)
                for label, detail, recording in _recordings(wanted, now, sound_now, torque_nm, rng)
            ]
        except (InputError, RefusalError) as error:
            typer.echo(f"case {index}, {wanted}: {error}")
    return samples


def _recordings(
    wanted: str, now: Recording, sound: Recording, torque_nm: float, rng: np.random.Generator
) -> Iterator[tuple[str, str, Recording]]:
    """Yield label, detail and recording."""
    yield NONE, "", sound
    if wanted != NONE:
        yield wanted, "", now
    recording, name = with_foreign_vibration(sound, rng)
    yield UNKNOWN, name, recording
    for name in rng.choice(made_by_hand(sound, torque_nm), N_BY_HAND, replace=False):
        yield str(name), BY_HAND, with_signature(sound, str(name), rng)[0]


def _simulated(now: Recording, rig: int, torque_nm: float) -> Gathered:
    """Return a twin that knows the rig file only, at a recording's speed and stated torque."""
    here, known = reduced(now, rig), rig_of(now)
    twin = CrackedTwin(known, nominal_of(known))
    run = twin.run(
        Point(60.0 * here.speed_hz, torque_nm),
        seed=rig,
        duration_s=run_length_s(here),
        sampling_rate_hz=now.sampling_rate_hz,
        noise=1,
    )
    return with_channels_of(gather(run, known), here)
