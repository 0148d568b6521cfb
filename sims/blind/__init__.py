"""An independent gear-pair rig that makes blind cases for evaluating the gap diagnosis.

It shares nothing with the simulators that the diagnosis uses: it has other degrees of freedom, another stiffness law,
another integrator, and its own form of every effect. **Anyone who works on the diagnosing side reads this page and
nothing else of this room**; the effects are to be learned from the recordings alone.

Making cases
------------
>>> import numpy as np
>>> from sims.blind import draw_case
>>> case = draw_case(np.random.default_rng(1), role="development", effect="root_crack", level=0.8)
>>> case.kind, [fault.name for fault in case.faults], case.role
('single', ['root_crack'], 'development')

`draw_case(rng, role, *, kind, effect, level, n_conditions, with_reference)`
    Draws a case; whatever is not given is drawn. Roles "development", "calibration", "evaluation" share no tooth
    number and no module. Kinds: "none" (healthy, with only tolerances and a changed mounting), "single" (one of the
    catalogue's 19), "unknown" (something outside the catalogue, half of it easily mistaken for an effect), "pair"
    (two of the catalogue, of different groups). Levels range from 0, barely noticeable, to 1, strong, geometrically
    spaced in the effect's unit. The rig, conditions, durations and noise do not depend on kind, effect or level,
    except that the first condition of `backlash` is a light load, which a quarter of all others have by chance.
`record_case(case, *, encoder_counts) -> CaseRecordings`
    Runs it in memory: `conditions`, `references`, `twins`, `places`. A twin is the same run with the same seeds but
    without the fault, so that the true location and size of the change can be measured. All recordings of a case are
    of one assembly, started at random angles: what is fixed to a shaft rotates with it, and teeth keep their mates.
    With `encoder_counts` per revolution each gear carries an encoder (``input encoder``, ``output encoder``; deg).
`write_visible(made, folder)`
    Writes a folder for the diagnosing side: ``condition_1.h5``, with two conditions also ``condition_2.h5``, with
    references ``reference_1.h5`` (same operating point as ``condition_1.h5``) and so on; each with a rig file of the
    same name that states its nominal speed and torque; and ``rig.toml``, which is that of condition_1. Channels:
    ``a1``, possibly ``a2`` (m/s^2), ``tacho`` (one pulse per revolution of the input shaft). Nominal torque is within
    about 20 %, nominal speed within about 1.5 % of the truth.
`labels(case, made)`
    Returns the true answers, for the scoring side.

Labels
------
==============  ====================================================================================================
layout          "gearsig blind labels 1"
role, kind      as above
effects         list, empty for "none": name, group ("outside" if not in the catalogue), severity, unit, level,
                resembles (the catalogue's effect that an outside one is easily mistaken for, or empty), place (those
                that apply of gear, shaft, tooth, angle_deg after the tachometer's pulse, order, bearing,
                frequency_hz, channels)
has_reference   whether there are healthy recordings
conditions      file, stated_rpm, stated_nm, true_rpm, true_nm (input shaft), load_share of the rated torque
pair            z1, z2, module_mm
==============  ====================================================================================================

"Pinion" is the gear on the input shaft and "wheel" that on the output shaft, regardless of their size.

Names: `CATALOGUE` (19), `MECHANICAL` (16 of them), `OUTSIDE_CATALOGUE` (10). For the benchmark's own cases:
`RunCondition`, `SHAFTS`.
"""

from sims.blind._cases import BlindCase, CaseRecordings, Fault, draw_case, labels, record_case, write_visible
from sims.blind._changes import (
    CATALOGUE,
    EVERY,
    MECHANICAL,
    OUTSIDE_CATALOGUE,
    ROOT_MODULES,
    crack_compliance,
    wear_shape,
)
from sims.blind._march import march
from sims.blind._rig import (
    MODULES_MM,
    ROLES,
    SHAFTS,
    BlindRig,
    SpurPair,
    draw_rig,
    mass_matrix,
    modes_of,
    output_rows,
    step_coefficients,
    stiffness_matrix,
    teeth_of,
)
from sims.blind._scene import (
    BlindMotion,
    RunCondition,
    Scene,
    accelerations,
    coloured_noise,
    march_arguments,
    measure,
    path_response,
    run,
    scene_of,
)

__all__ = [
    "CATALOGUE",
    "EVERY",
    "MECHANICAL",
    "MODULES_MM",
    "OUTSIDE_CATALOGUE",
    "ROLES",
    "ROOT_MODULES",
    "SHAFTS",
    "BlindCase",
    "BlindMotion",
    "BlindRig",
    "CaseRecordings",
    "Fault",
    "RunCondition",
    "Scene",
    "SpurPair",
    "accelerations",
    "coloured_noise",
    "crack_compliance",
    "draw_case",
    "draw_rig",
    "labels",
    "march",
    "march_arguments",
    "mass_matrix",
    "measure",
    "modes_of",
    "output_rows",
    "path_response",
    "record_case",
    "run",
    "scene_of",
    "step_coefficients",
    "stiffness_matrix",
    "teeth_of",
    "wear_shape",
    "write_visible",
]
