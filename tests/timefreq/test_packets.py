"""Wavelet packets: energy, inverse, places, and PyWavelets' own tree."""

import numpy as np
import pytest
import pywt
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.errors import InputError, RefusalError
from gearsig.timefreq import (
    UniformSignal,
    node_path,
    packet_inverse,
    wavelet_packet_map,
    wavelet_packets,
)


@given(n=st.integers(700, 5000), level=st.integers(1, 4), wavelet=st.sampled_from(["haar", "db4", "sym12", "coif3"]))
@settings(max_examples=40, deadline=None)
def test_energy_and_signal_are_kept_for_any_length(n, level, wavelet):
    x = np.random.default_rng(n).normal(size=n)
    packets = wavelet_packets(UniformSignal(x, 1.0), wavelet=wavelet, level=level)
    assert np.sum(packets.values**2) == pytest.approx(np.sum(x**2), rel=1e-10)
    assert packet_inverse(packets) == pytest.approx(x, abs=1e-10)


def test_same_as_the_tree_of_pywavelets():
    x = np.random.default_rng(0).normal(size=2048)
    ours = wavelet_packets(UniformSignal(x, 1.0), wavelet="db4", level=4).values
    tree = pywt.WaveletPacket(x, "db4", "periodization", 4)
    theirs = np.array([node.data for node in tree.get_level(4, order="freq")])
    assert ours == pytest.approx(theirs, abs=1e-12)


def test_power_of_the_map_adds_up_to_the_signals(sine):
    signal = UniformSignal(np.random.default_rng(0).normal(size=64 * 512), 1000.0, unit="m/s^2")
    levels = wavelet_packet_map(signal, scaling="power", n_columns=128)
    assert levels.values.sum(axis=1).mean() == pytest.approx(np.mean(signal.values**2), rel=1e-9)
    assert levels.unit == "(m/s^2)^2"
    tone, _ = sine(1000 * 10.5 / 64, 0.8, n=64 * 512)
    found = wavelet_packet_map(tone)
    assert np.argmax(found.values[5:-5].mean(axis=0)) == 10
    assert np.sqrt(np.mean(found.values[:, 10] ** 2)) == pytest.approx(0.8, rel=0.05)


def test_impulse_is_where_it_was():
    x = np.zeros(20_000)
    x[12_345] = 1.0
    levels = wavelet_packet_map(UniformSignal(x, 1.0), level=5)
    power = levels.values**2
    centres = (power * levels.at[:, None]).sum(axis=0) / power.sum(axis=0)
    assert np.abs(centres - 12_345).max() < 1.5 * 32


def test_bands_of_one_component():
    t = np.arange(8192) / 1000.0
    low, high = np.cos(2 * np.pi * 70 * t), np.cos(2 * np.pi * 380 * t)
    packets = wavelet_packets(UniformSignal(low + high, 1000.0), level=3)
    kept = packet_inverse(packets, [packets.band_of(10.0), packets.band_of(70.0), packets.band_of(150.0)])
    assert np.abs(kept - low)[500:-500].max() < 0.05
    assert packets.band_of(500.0) == 7


def test_order_bands(swept_angle_signal):
    levels = wavelet_packet_map(swept_angle_signal, "a", level=4)
    assert levels.axis == "order"
    assert levels.positions[np.argmax(levels.values.mean(axis=0))] == pytest.approx(7.0)


@pytest.mark.parametrize("level", [1, 3, 5])
def test_nodes_have_the_paths_of_pywavelets(level):
    x = np.random.default_rng(4).normal(size=32 * 32)
    packets = wavelet_packets(UniformSignal(x, 1000.0), wavelet="db2", level=level)
    tree = pywt.WaveletPacket(x, "db2", mode="periodization", maxlevel=level)
    bands = range(packets.n_bands)
    assert [node_path(band, level) for band in bands] == [node.path for node in tree.get_level(level, order="freq")]
    for band in bands:
        np.testing.assert_allclose(packets.values[band], tree[node_path(band, level)].data, atol=1e-12)


def test_energies_of_the_nodes_add_up_to_the_signal(swept_angle_signal):
    packets = wavelet_packets(swept_angle_signal, "a", level=4)
    assert packets.level == 4
    assert packets.energies.sum() == pytest.approx(np.square(swept_angle_signal.values("a")).sum())
    assert packets.limits_of(int(np.argmax(packets.energies))) == (6.0, 8.0)


def test_a_node_that_is_not_there_is_named():
    with pytest.raises(InputError, match="band 4 does not exist"):
        node_path(4, 2)


def test_wrong_input_is_named():
    signal = UniformSignal(np.zeros(1000), 1.0)
    with pytest.raises(RefusalError, match="set level to 5"):
        wavelet_packets(signal, level=6)
    with pytest.raises(InputError, match="did you mean sym12"):
        wavelet_packets(signal, wavelet="symm12")
    with pytest.raises(InputError, match="not orthogonal"):
        wavelet_packets(signal, wavelet="bior2.2", level=2)
    with pytest.raises(InputError, match="1 to 12"):
        wavelet_packets(signal, level=13)
    packets = wavelet_packets(signal, level=2)
    with pytest.raises(InputError, match="band 4"):
        packet_inverse(packets, [4])
    with pytest.raises(InputError, match=r"0 to 0\.5"):
        packets.band_of(0.6)
