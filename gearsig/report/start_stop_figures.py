"""The figures of a machine that starts and stops: its course, the teeth in their play, impacts, force from motion."""

from __future__ import annotations

from collections.abc import Iterator

from gearsig.errors import RefusalError
from gearsig.motion.start_stop import StartStop
from gearsig.plot.embed import Captioned


def start_stop_figures(examined: StartStop) -> Iterator[Captioned]:
    """Draw the figures; what the record does not show has none."""
    yield _course(examined)
    yield _planes(examined)
    if examined.impacts:
        yield _impacts(examined)
    yield from _forces(examined)


def _course(examined: StartStop) -> Captioned:
    from gearsig.plot.start_stop_course import course_figure

    return Captioned(
        course_figure(examined, title="Speed, torque and compression in their phases"),
        "Look when the compression changes sides: between the dashed lines the flanks do not touch, beyond them they "
        "carry. A run-down that grows shorter tells of friction.",
        f"Driver's speed, torque and compression over {examined.motion.time_s[-1]:.4g} s, phases shaded.",
    )


def _planes(examined: StartStop) -> Captioned:
    from gearsig.plot.start_stop import start_stop_figure

    return Captioned(
        start_stop_figure(examined, title="Speed with the impacts"),
        "The walls of the phase plane stand a backlash apart. Torque over twist at the driver: the flat middle is the "
        "play, the slopes are the teeth's stiffness, the area is what is lost.",
        "Speed with impacts, phase plane of the teeth, torque over twist.",
    )


def _impacts(examined: StartStop) -> Captioned:
    from gearsig.plot.impacts import impacts_figure

    motion = examined.motion
    return Captioned(
        impacts_figure(examined.impacts, motion.path.teeth[0], restitution=motion.contact.restitution),
        "Look whether the same teeth meet each time the machine starts or stops: they wear first. Energies are on a "
        "logarithmic scale; a restitution is missing where the flanks stayed together.",
        f"{len(examined.impacts)} impacts: energy over time and tooth, restitution over speed.",
    )


def _forces(examined: StartStop) -> Iterator[Captioned]:
    from gearsig.motion.force import FROM_TORQUE, HUNT_CROSSLEY, PIECEWISE, estimate_forces
    from gearsig.plot.force import force_figure

    if examined.motion.torque_nm is None:
        return
    try:
        estimate = estimate_forces(examined.motion)
    except RefusalError:  # no sample carries a load
        return
    shares = [100.0 * estimate.error(model, FROM_TORQUE).relative_rms for model in (PIECEWISE, HUNT_CROSSLEY)]
    yield Captioned(
        force_figure(estimate, title="Force from the motion, beside the torque's"),
        f"The piecewise model, which knows both flanks and one or two pairs, is {shares[0]:.3g} % rms off torque over "
        f"base radius; Hunt–Crossley, one pair on one flank, {shares[1]:.3g} %. Where the first is far off, the rig's "
        "[contact] table does not fit, or the encoders are too coarse (gearsig force --noise).",
        "Force by two models beside torque over base radius, and their errors; beside it the hardest blow backwards.",
    )
