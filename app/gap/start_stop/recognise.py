"""Which diagnosis a recording is for: starts and stops, or running that goes on."""

from __future__ import annotations

from collections.abc import Sequence

from gearsig.errors import GearsigError, RefusalError
from gearsig.recording.types import Recording
from gearsig.rig.types import Rig

MODEL = "forging"


def refuse_start_stop(recordings: Sequence[Recording], rigs: Sequence[Rig], names: Sequence[str], model: str) -> None:
    """Refuse recordings of starts and stops for a model of running that goes on.

    Raises
    ------
    RefusalError
        With the model that they are for.
    """
    for recording, rig, name in zip(recordings, rigs, names, strict=True):
        if is_start_stop_recording(recording, rig):
            raise RefusalError(
                f"{name} starts and stops: orders, which the model {model} is compared by, need a shaft that goes on "
                "turning",
                remedy=f"--model {MODEL}",
            )


def is_start_stop_recording(recording: Recording, rig: Rig) -> bool:
    """Whether a recording holds the motion of both gears of a machine that starts and stops."""
    from gearsig.motion.course import is_start_stop
    from gearsig.motion.measure import measure_motion
    from gearsig.motion.start_stop import course_of_angle

    if rig.contact is None:
        return False
    try:
        motion = measure_motion(recording, rig)
        return is_start_stop(course_of_angle(motion.driver_angle_rad, motion.sampling_rate_hz))
    except GearsigError:
        return False
