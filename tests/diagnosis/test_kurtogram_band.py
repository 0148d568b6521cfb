"""The kurtogram's own band: it finds where a race rings, bears a finding out, and is shown where it does."""

from dataclasses import replace

import pytest

from gearsig.diagnosis import Analysis, Kind, analyze
from gearsig.report import page_html
from tests.diagnosis.machines import GOOD, RIG, codes, finding, good_analysis, record
from tests.kinematic.model import BearingFault

RINGS_AT_HZ = 4100.0


def damaged(impact: float, ring_hz: float = RINGS_AT_HZ) -> Analysis:
    fault = BearingFault("front", "inner", impact, ring_hz, 0.02, 0.01, 0.2)
    return analyze(record(replace(GOOD, bearing_faults=(fault,)), seconds=8.0))


@pytest.fixture(scope="module")
def found() -> Analysis:
    return damaged(8.0)


def test_the_own_band_holds_the_resonance_at_which_the_race_rings(found: Analysis) -> None:
    channel = found.channels[0]
    assert channel.kurtogram_band is not None
    low, high = channel.kurtogram_band.band_hz
    assert low < RINGS_AT_HZ < high
    assert channel.kurtogram_band.kurtosis > 1.0


@pytest.mark.slow
def test_the_finding_says_what_the_own_band_shows(found: Analysis) -> None:
    race = finding(found, "bearing-inner-race")
    assert race.kind is Kind.FAULT
    assert sum("kurtogram's own band" in text for text in race.evidence) == 1
    assert any("over its floor" in text for text in race.evidence)
    assert any("with steady tones removed" in text for text in race.evidence)
    assert "spectral kurtosis of bands" in page_html(found)


def test_a_good_bearing_has_no_kurtogram_to_show() -> None:
    good = good_analysis()
    assert codes(good, Kind.FAULT, Kind.SUSPICION) == []
    assert good.channels[0].kurtogram is None


def test_without_bearings_no_band_is_sought() -> None:
    analysis = analyze(record(rig=replace(RIG, bearings=())))
    assert analysis.channels[0].kurtogram_band is None
