"""The dashboard without a mouse: everything is reached by Tab, shows that it is, and does what it says."""

import re
from typing import Any

import pytest

from tests.browser.conftest import playwright, settle

pytestmark = pytest.mark.browser

# What the eye sees of the focused element and what is around it, with and without the focus.
SEEN = """async () => {
  const drawn = () => new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(go)));
  await drawn();
  let e = document.activeElement;
  while (e?.shadowRoot?.activeElement) e = e.shadowRoot.activeElement;
  if (!e || e === document.body) return null;
  const looks = () => {
    const found = [];
    for (let n = e, k = 0; n && n !== document.body && k < 5; n = n.parentElement ?? n.getRootNode().host, k++) {
      const s = getComputedStyle(n);
      found.push([s.outlineStyle, s.outlineWidth, s.boxShadow, s.borderTopColor, s.backgroundColor].join());
    }
    return found.join(";");
  };
  const name = (e.getAttribute("aria-label") || e.title || e.innerText || e.value || e.tagName).trim();
  const focused = looks();
  e.blur();
  await drawn();
  const unfocused = looks();
  e.focus({ preventScroll: true, focusVisible: true });
  return { name, tag: e.tagName, isSeen: focused !== unfocused };
}"""
# What a browser or Streamlit puts into the order besides: the page as a whole, to be scrolled, and players.
NOT_MARKED = {"MAIN", "AUDIO"}


def tab_to(page: playwright.Page, name: str) -> list[dict[str, Any]]:
    """Press Tab until an element of that name has the focus; return all on the way."""
    page.add_style_tag(content="* { transition: none !important; }")
    stops: list[dict[str, Any]] = []
    for _ in range(80):
        page.keyboard.press("Tab")
        stop = page.evaluate(SEEN)
        if stop is None:
            continue
        stops.append(stop)
        if re.match(name, stop["name"]):
            return stops
    pytest.fail(f"{name} is not reached: {[stop['name'] for stop in stops]}")


def test_from_the_start_page_to_a_cursor_without_a_mouse(page: playwright.Page) -> None:
    stops = tab_to(page, "Open the recording")
    page.keyboard.press("Enter")
    page.locator(".st-key-verdict img").wait_for()
    settle(page)
    stops += tab_to(page, "Order spectrum")
    page.keyboard.press("Enter")
    page.locator(".strip button[aria-pressed=true]").filter(has_text="Order spectrum").wait_for()
    settle(page)
    stops += tab_to(page, "Sidebands")
    page.keyboard.press("Enter")
    view = page.locator(".st-key-view .figure").first
    words = view.locator(".words")
    first = words.inner_text()
    assert "sidebands every" in first
    stops += tab_to(page, "amplitude")
    assert not [stop["name"] for stop in stops if not stop["isSeen"] and stop["tag"] not in NOT_MARKED]
    page.keyboard.press("ArrowRight")
    moved = words.inner_text()
    assert moved.split("·")[0] != first.split("·")[0]
    assert moved.split("sidebands")[1] == first.split("sidebands")[1]
    page.keyboard.press("Shift+ArrowRight")
    assert words.inner_text().split("sidebands")[1] != moved.split("sidebands")[1]
    page.keyboard.press("Escape")
    assert not words.inner_text()
    page.keyboard.press("+")
    page.wait_for_function("new URL(location).searchParams.has('zoom')")
    settle(page)
    page.keyboard.press("0")
    page.wait_for_function("!new URL(location).searchParams.has('zoom')")


def test_a_plane_is_zoomed_by_keys_along_both_axes(page: playwright.Page) -> None:
    page.get_by_role("button", name="Open the recording").click()
    page.locator(".strip button").filter(has_text="Phase").first.click()
    figure = page.locator(".st-key-view .figure svg").first
    figure.wait_for()
    settle(page)
    numbers = "svg => [...svg.querySelectorAll('text')].map(t => t.textContent).join()"
    whole = figure.evaluate(numbers)
    figure.focus()
    page.keyboard.press("+")
    near = figure.evaluate(numbers)
    assert near != whole
    page.keyboard.press("ArrowUp")
    assert figure.evaluate(numbers) != near
    zoomed = "new URL(location).searchParams.get('zoom')?.split('_').length === 5"
    page.wait_for_function(zoomed)
    page.keyboard.press("0")
    assert figure.evaluate(numbers) == whole
    page.wait_for_function("!new URL(location).searchParams.has('zoom')")  # else what follows finds the old zoom there
    settle(page)
    box = figure.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 0.3 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 0.5 * box["height"], steps=3)
    page.mouse.up()
    near = figure.evaluate(numbers)
    assert near != whole
    page.wait_for_function(zoomed)
    page.reload()  # the address keeps both axes
    figure.wait_for()
    settle(page)
    assert figure.evaluate(numbers) == near
