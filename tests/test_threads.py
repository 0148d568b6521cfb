"""Every method from several threads at once, as the dashboard's sessions call them: the same numbers as alone."""

from concurrent.futures import ThreadPoolExecutor
from io import BytesIO

import numpy as np
import pytest

from gearsig.angle import ShaftAngle, resample_to_angle
from gearsig.decompose import VmdSettings, denoise, suggest_modes, vmd
from gearsig.orders import order_map, track_vold_kalman
from gearsig.phase import phase_plane
from gearsig.plot import kurtogram_figure, time_frequency_figure
from gearsig.recording import Channel, Recording
from gearsig.spectra import kurtogram, kurtogram_envelope, order_coherence, spectral_coherence
from gearsig.timefreq import (
    component,
    cwt,
    cwt_map,
    packet_inverse,
    ridges,
    squeezed_cwt,
    squeezed_cwt_map,
    squeezed_stft_map,
    stft_map,
    wavelet_packets,
)

FS, N, N_THREADS = 8192.0, 8192, 4


@pytest.fixture(scope="module")
def recording():
    t = np.arange(N) / FS
    x = np.cos(2 * np.pi * 20 * (29 * t + 0.5 * t**2)) + 0.5 * np.cos(2 * np.pi * 1300 * t)
    x += 0.3 * np.random.default_rng(5).normal(size=N)
    return Recording(x[None, :], FS, (Channel("a", "acceleration", "m/s^2"),))


@pytest.fixture(scope="module")
def angle():
    t = np.linspace(0.0, N / FS, 201)
    return ShaftAngle("input", t, 20 * (t + 0.01 * t**2), 20 * (1 + 0.02 * t), "pulses")


def along_the_ridge(recording):
    (found,) = ridges(squeezed_cwt_map(recording, lowest=900, highest=2000, n_columns=300))
    return component(recording, found).analytic


def of_figure(figure):
    file = BytesIO()
    figure.savefig(file, format="raw")
    return np.frombuffer(file.getvalue(), np.uint8)


METHODS = {
    "stft": lambda r, _: stft_map(r, n_columns=200).values,
    "squeezed stft": lambda r, _: squeezed_stft_map(r, n_columns=200).values,
    "cwt": lambda r, _: cwt_map(r, n_columns=200).values,
    "cwt coefficients": lambda r, _: cwt(r, lowest=100, step=16).values,
    "squeezed cwt": lambda r, _: squeezed_cwt(r, lowest=100, step=16).values,
    "ridge and component": lambda r, _: along_the_ridge(r),
    "cwt over angle": lambda r, a: cwt_map(resample_to_angle(r, a), n_columns=200).values,
    "wavelet packets": lambda r, _: packet_inverse(wavelet_packets(r, level=4), [2, 3]),
    "kurtogram": lambda r, _: kurtogram_envelope(r, "a", preparation="tones removed").spectrum.values,
    "coherence": lambda r, _: spectral_coherence(r, "a", highest_alpha_hz=100, n_bands=16).coherence_squared,
    "order coherence": lambda r, a: order_coherence(r, "a", a, highest_order=4, n_bands=16).coherence_squared,
    "modes": lambda r, _: vmd(r.values("a"), FS, VmdSettings(3)).waveforms,
    "suggested modes": lambda r, _: np.array(
        suggest_modes(r.values("a"), FS, max_modes=2, penalties=(2000.0,), longest=2048).chosen.centres
    ),
    "denoising": lambda r, _: denoise(r, "a").values,
    "orders": lambda r, a: track_vold_kalman(r, "a", (29.0, 30.0), bandwidth_hz=5, shaft_angle=a).residual,
    "order map": lambda r, a: order_map(resample_to_angle(r, a), "a").values,
    "phase plane": lambda r, _: phase_plane(r, "a", low_cut_hz=50.0).points,
    "map figure": lambda r, _: of_figure(time_frequency_figure(stft_map(r, n_columns=50, highest=1000))),
    "kurtogram figure": lambda r, _: of_figure(kurtogram_figure(kurtogram(r, "a", n_levels=3))),
}


@pytest.mark.slow
def test_four_threads_get_what_one_gets(recording, angle):
    """Two threads begin with one method, two with another: the same kernels and different ones run at once."""
    alone = {name: method(recording, angle) for name, method in METHODS.items()}
    names = list(METHODS)

    def session(first):
        return {name: METHODS[name](recording, angle) for name in names[first:] + names[:first]}

    with ThreadPoolExecutor(N_THREADS) as pool:
        for found in pool.map(session, (0, 0, len(names) // 2, len(names) // 2)):
            for name in names:
                np.testing.assert_array_equal(found[name], alone[name], err_msg=name)
