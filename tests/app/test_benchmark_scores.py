"""The benchmark's figures against tables counted by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from app.benchmark.answer import Answer
from app.benchmark.cases import Truth
from app.benchmark.diagnosers import bare_report
from app.benchmark.scores import (
    Located,
    Row,
    bins_of,
    brier,
    calibration_error,
    error_by_chance,
    group_of,
    judgement,
    located,
    macro_f1,
    median_of,
    resampled,
    scores,
    share,
    strength,
    strong_only,
)
from gearsig.errors import InputError
from gearsig.gap import GapOutcome, GapPlace, PlaceKind, StructuralFloor
from gearsig.plot import calibration_figure, confusion_figure
from tests.app.answers import cause

PAIR = {"z1": 20, "z2": 40, "module_mm": 2.0}

Z = norm.ppf(0.95)
"""Two-sided 90 % of the normal distribution."""


def answer(outcome, **probabilities):
    ranked = sorted(probabilities.items(), key=lambda item: -item[1])
    return Answer(outcome, tuple(cause(name, p) for name, p in ranked))


def row(kind, effects, said, strength_floors=5.0, with_reference=True, where=None):
    truths = {"none": ("none",), "unknown": ("unknown",)}.get(kind, tuple(effects))
    return Row(
        1, "blind", kind, tuple(effects), truths, 0.5, strength_floors, with_reference, 1, said, where or Located()
    )


CRACK, SPALL = {"root_crack": 0.7, "tooth_spall": 0.2, "none": 0.1}, {"tooth_spall": 0.6, "root_crack": 0.4}
ROWS = [
    row("single", ["root_crack"], answer("effect", **CRACK), where=Located(tooth=True, shaft=True)),
    row("single", ["root_crack"], answer("effect", **SPALL), where=Located(tooth=False, shaft=True)),
    row("single", ["root_crack"], answer("no gap", none=0.9, root_crack=0.1), 0.5),
    row("single", ["tooth_spall"], answer("effect", **SPALL)),
    row("single", ["unbalance"], answer("unknown", unknown=0.8, unbalance=0.2)),
    row("single", ["mains_hum"], answer("effect", mains_hum=0.9, none=0.1)),
    row("single", ["clipping"], answer("effect", **CRACK)),
    row("none", [], answer("no gap", none=1.0), float("nan")),
    row("none", [], answer("effect", **CRACK), float("nan")),
    row("unknown", ["belt_line"], answer("unknown", unknown=0.5, none=0.5)),
    row("unknown", ["belt_line"], answer("cannot separate", none=0.6, unbalance=0.4)),
    row("pair", ["root_crack", "unbalance"], answer("effect", unbalance=0.6, root_crack=0.3, none=0.1)),
    row("pair", ["root_crack", "unbalance"], answer("effect", **CRACK)),
    row("single", ["unbalance"], Answer("", error="no speed")),
]


def hits(key):
    score = scores(ROWS, 1)[key]
    return round(score.value * score.n), score.n


@pytest.mark.parametrize(
    ("key", "counted"),
    [
        ("top_1", (2, 6)),
        ("top_2", (5, 6)),
        ("group", (3, 6)),
        ("top_1_of_16", (4, 6)),
        ("named", (3, 6)),
        ("named_on_none", (1, 2)),
        ("unknown_recognised", (1, 2)),
        ("named_on_unknown", (0, 2)),
        ("named_on_chain", (1, 2)),
        ("chain_right", (1, 2)),
        ("pair_top_1", (2, 2)),
        ("pair_top_2", (1, 2)),
        ("tooth", (1, 2)),
        ("shaft", (2, 2)),
        ("answered", (13, 14)),
    ],
)
def test_shares_counted_by_hand(key, counted):
    assert hits(key) == counted


def test_two_that_cannot_be_separated_name_the_mechanical_one():
    said = Answer("cannot separate", ROWS[0].answer.causes, ("transfer_path", "tooth_wear"))
    assert row("none", [], said).named == "tooth_wear"
    assert row("none", [], Answer("cannot separate", said.causes, ("transfer_path", "none"))).named == ""


def test_the_likeliest_is_so_by_probability_whatever_the_outcome_puts_first():
    # As the diagnosis orders it: both effects are named, though none is the likeliest single cause.
    named_first = cause("root_crack", 0.36), cause("none", 0.39), cause("tooth_spall", 0.25)
    said = Answer("cannot separate", named_first, ("root_crack", "tooth_spall"))
    found = row("single", ["root_crack"], said)
    assert found.ranked == ("none", "root_crack", "tooth_spall")
    assert (found.first, found.confidence, found.named) == ("none", 0.39, "root_crack")
    assert scores([found], 1)["top_1"].value == 0.0
    assert scores([found], 1)["ece"].value == pytest.approx(0.39)
    # What a verdict names is what stands first, not what is likeliest.
    assert row("single", ["root_crack"], Answer("effect", named_first)).named == "root_crack"


def test_of_two_as_likely_the_first_stays_first():
    alike = Answer("undecided", tuple(cause(name, 0.5) for name in ("tooth_spall", "root_crack")))
    assert row("none", [], alike).ranked == ("tooth_spall", "root_crack")


def test_macro_f1_is_the_mean_over_effects_with_cases():
    # root_crack: 1 hit, 2 misses, 2 false (clipping, none); tooth_spall: 1 hit, 1 false; unbalance: nothing.
    singles = [r for r in ROWS if r.kind != "pair"]
    assert macro_f1(singles) == pytest.approx(np.mean([2 / (3 + 3), 2 / (1 + 2), 0.0]))


def test_weak_faults_are_left_out_and_healthy_cases_are_not():
    kept = strong_only(ROWS, 3.0)
    assert len(kept) == len(ROWS) - 1
    assert sum(r.kind == "none" for r in kept) == 2


def test_regret_counts_what_the_named_effect_shrinks_less():
    wrong = Answer("effect", (cause("tooth_spall", 0.6, shrink=0.3), cause("root_crack", 0.4, shrink=0.8)))
    right = Answer("effect", (cause("root_crack", 0.6, shrink=0.7), cause("tooth_spall", 0.4, shrink=0.9)))
    untried = Answer("effect", (cause("tooth_spall", 0.6, shrink=0.3), cause("root_crack", 0.4)))
    found = scores([row("single", ["root_crack"], said) for said in (wrong, right, untried)], 1)
    assert found["regret"].value == pytest.approx((0.5 + 0.0) / 2)
    assert found["regret"].n == 2
    assert found["shrink_true"].value == pytest.approx(0.75)
    assert found["shrink_named"].value == pytest.approx(0.3)


def test_what_the_true_effect_closes_counts_beyond_the_best_wrong_one():
    def tried(name, of_all):
        return cause(name, 0.3, shrink=0.9, of_all=of_all)

    both = Answer("effect", (tried("tooth_spall", 0.25), tried("root_crack", 0.6), tried("unbalance", -0.2)))
    alone = Answer("effect", (tried("root_crack", 0.6), cause("tooth_spall", 0.2)))
    found = scores([row("single", ["root_crack"], said) for said in (both, alone)], 1)["closed"]
    assert (found.value, found.n) == (pytest.approx(0.35), 1)


def test_an_effect_without_placebos_has_none_that_shrinks_by_nothing():
    def said(placebo, n_placebos):
        return Answer("effect", (cause("root_crack", 1.0, shrink=0.8, placebo=placebo, n_placebos=n_placebos),))

    rows = [row("single", ["root_crack"], said(*one)) for one in ((0.0, 0), (0.0, 0), (0.2, 3), (0.0, 3))]
    assert scores(rows, 1)["placebo"].n == 2
    assert scores(rows, 1)["placebo"].value == pytest.approx(0.1)


def test_the_interval_of_a_median_is_narrower_than_its_values():
    values = [float(v) for v in range(1, 102)]
    found = median_of([*values, float("nan")], np.random.default_rng(1))
    assert (found.value, found.n) == (51.0, 101)
    # The median of n values spread evenly over a span w has the standard error w/(2√n).
    assert found.high - found.low == pytest.approx(2 * Z * 100 / (2 * np.sqrt(101)), rel=0.25)
    assert found.low < found.value < found.high
    assert median_of([], np.random.default_rng(1)).n == 0


@given(st.integers(0, 60), st.integers(1, 60))
def test_wilsons_ends_are_where_the_share_is_z_standard_errors_away(k, n):
    k = min(k, n)
    found = share(k, n)
    assert 0.0 <= found.low <= k / n <= found.high <= 1.0
    for end in (found.low, found.high):
        assert abs(k / n - end) == pytest.approx(Z * np.sqrt(end * (1 - end) / n), abs=1e-7)


def test_resampling_a_mean_gives_its_standard_error():
    values = np.random.default_rng(1).normal(size=400)
    found = resampled(list(values), lambda drawn: float(np.mean(drawn)), np.random.default_rng(2))
    assert found.value == pytest.approx(values.mean())
    assert found.high - found.low == pytest.approx(2 * Z * values.std() / 20.0, rel=0.1)


def test_the_interval_of_a_sum_of_errors_holds_its_value():
    signs = list(np.linspace(-1.0, 1.0, 101))  # of mean 0
    away = resampled(signs, lambda d: abs(float(np.mean(d))), np.random.default_rng(2))
    held = resampled(signs, lambda d: abs(float(np.mean(d))), np.random.default_rng(2), centred=True)
    assert away.value == held.value < 1e-12 < away.low
    assert held.low <= held.value < held.high < away.high


def test_calibration_error_in_closed_form():
    # Two bins: 0.2 with 1 of 4 right, 0.9 with 3 of 4 right: (0.05 + 0.15)/2.
    confidence, right = [0.2] * 4 + [0.9] * 4, [True] + [False] * 3 + [True] * 3 + [False]
    assert calibration_error(confidence, right, 2) == pytest.approx(0.10)
    assert calibration_error([1.0] * 5, [False] * 5) == pytest.approx(1.0)
    assert calibration_error([1.0] * 5, [True] * 5) == 0.0
    assert [b.n for b in bins_of(confidence, right, 3)] == [3, 3, 2]


def test_true_probabilities_err_by_chance_as_a_binomial_does():
    # One bin of n: E|mean − p| of a binomial, sqrt(2 p (1 − p)/(π n)) for large n.
    n, p = 4_000, 0.5
    expected = 10 * np.sqrt(2 * p * (1 - p) / (np.pi * n / 10)) / 10
    found = error_by_chance([p] * n, np.random.default_rng(3))
    assert found == pytest.approx(expected, rel=0.05)


def test_brier_by_hand():
    assert brier({"a": 0.5, "b": 0.3, "c": 0.2}, "a") == pytest.approx(0.25 + 0.09 + 0.04)
    assert brier({"a": 1.0}, "b") == 2.0
    assert brier({"a": 1.0}, "a") == 0.0


def test_targets_are_met_missed_or_open():
    assert judgement(share(99, 100), 0.8, is_least=True) == "met"
    assert judgement(share(50, 100), 0.8, is_least=True) == "missed"
    assert judgement(share(80, 100), 0.8, is_least=True) == "open"
    assert judgement(share(0, 200), 0.05, is_least=False) == "met"
    assert judgement(share(0, 10), 0.05, is_least=False) == "open"
    assert judgement(share(0, 0), 0.05, is_least=False) == ""


def place(kind, **where):
    return GapPlace(kind, "", 0.0, 1.0, 1.0, 1.0, **where)


def test_places():
    def said(options=None, places=()):
        return Answer("effect", (cause("root_crack", 1.0, options),), places=tuple(places))

    def tooth(angle_deg, number):
        return place(PlaceKind.TOOTH, shaft="input", angle_deg=angle_deg, tooth=number)

    label = {"gear": "pinion", "shaft": "input", "tooth": 3, "angle_deg": 66.0}  # a pitch is 18 degrees
    at = tooth(90.0, 5)
    assert located(label, "root_crack", said(places=[at]), PAIR) == Located(tooth=True, shaft=True)
    far = tooth(95.0, 6)
    assert located(label, "root_crack", said({"gear": "driven"}, [far]), PAIR) == Located(tooth=False, shaft=False)
    assert located(label, "root_crack", said({"gear": "driver", "tooth": 4.0}), PAIR).tooth
    assert located(label, "root_crack", said(), PAIR) == Located(tooth=False, shaft=False)
    around = {"shaft": "input", "angle_deg": 359.0}
    assert located(around, "root_crack", said(places=[tooth(2.0, 1)]), PAIR).tooth


def test_orders_are_counted_on_the_input_shaft_and_bearings_of_a_shaft_are_alike():
    label = {"shaft": "output", "bearing": "bearing 3", "order": 3.0}  # 1.5 of the input shaft
    race = cause("bearing_outer_race", 1.0, {"bearing": "bearing 4"})
    line = place(PlaceKind.ENVELOPE, orders=(1.51, 3.02))
    found = located(label, "bearing_outer_race", Answer("effect", (race,), places=(line,)), PAIR)
    assert found == Located(shaft=True, bearing=True, order=True)
    ripple = Answer("effect", (cause("torque_ripple", 1.0, {"order": 3.0}),))
    assert located({"shaft": "output", "order": 3.0}, "torque_ripple", ripple, PAIR).order is False


def truth(changes):
    return Truth({"has_reference": True, "effects": []}, tuple(changes))


def test_strength_is_that_of_the_gap_size_in_a_floor():
    rng = np.random.default_rng(5)
    names = ("mesh.total", "hum", "shaft.driver.1")
    rows = [{name: float(rng.normal()) for name in names} for _ in range(40)]
    floors = {True: StructuralFloor.of_healthy(names, np.array([[*row.values()] for row in rows]))}
    change = dict.fromkeys(names, 10.0)
    size = strength(truth([change]), floors)
    assert strength(truth([dict.fromkeys(names, 30.0)]), floors) == pytest.approx(3.0 * size)
    assert strength(truth([change, dict.fromkeys(names, 20.0)]), floors) == pytest.approx(2.0 * size)
    # One healthy machine in twenty exceeds a floor.
    own = [strength(truth([row]), floors) for row in rows]
    assert 0 <= sum(s > 1.0 for s in own) <= 4
    assert np.isnan(strength(truth([]), floors))


def test_groups():
    assert group_of("root_crack") == group_of("tooth_spall")
    assert group_of("unknown") == "unknown"


def test_figures_show_every_case_and_check_their_table():
    figure = confusion_figure(("a", "b"), ("a", "b", "c"), np.array([[3, 0, 1], [0, 2, 0]]), title="x")
    texts = [t.get_text() for t in figure.axes[0].texts]
    assert sorted(texts) == ["1", "2", "3"]
    assert [t.get_text() for t in figure.axes[0].get_yticklabels()] == ["a (4)", "b (2)"]
    with pytest.raises(InputError, match="counts"):
        confusion_figure(("a",), ("a", "b"), np.zeros((2, 2)))
    half = np.array([0.5])
    curve = calibration_figure({"gap": (half, half, half - 0.1, half + 0.1)})
    assert curve.axes[0].lines[-1].get_xydata().tolist() == [[50.0, 50.0]]


def test_a_diagnoser_of_probabilities_alone_names_what_it_cannot_tell_apart():
    """As the product's verdict does, also where no gap is likelier than either."""
    said = {"none": 0.4, "root_crack": 0.3, "chipped_tooth": 0.2, "unknown": 0.1}
    report = bare_report("forest", said, outcome=GapOutcome.CANNOT_SEPARATE)
    assert report.inseparable == ("root_crack", "chipped_tooth")
    assert bare_report("forest", said).inseparable is None
