import numpy as np
import pytest

from gearsig.diagnosis import OrderLevel
from gearsig.errors import InputError
from gearsig.plot import order_levels_figure

RPM = np.linspace(600.0, 3000.0, 100)


def level(order: float) -> OrderLevel:
    return OrderLevel(f"order {order:g}", order, RPM, 1.0 + np.exp(-(((RPM - 1800.0) / 100.0) ** 2)), "m/s^2", 0.3)


def texts(figure) -> list[str]:
    return [text.get_text() for axes in figure.axes for text in axes.texts] + [t.get_text() for t in figure.texts]


def test_each_order_is_marked_where_it_crosses_a_resonance():
    figure = order_levels_figure([level(10.0), level(20.0), level(200.0)], resonances_hz=[400.0], title="Levels")
    assert texts(figure).count("A") == 2  # order 10 at 2400 rpm, 20 at 1200; 200 would be below the range
    assert any("A 400 Hz" in text for text in texts(figure))
    assert figure.axes[0].get_xlabel() == "speed (rpm)"
    assert figure.axes[0].get_ylabel() == "amplitude (m/s²)"


def test_without_resonances_nothing_is_marked():
    assert "A" not in texts(order_levels_figure([level(10.0)], title="Levels"))


@pytest.mark.parametrize("n", [0, 9])
def test_the_number_of_orders_is_limited(n):
    with pytest.raises(InputError, match="levels"):
        order_levels_figure([level(k + 1.0) for k in range(n)])
