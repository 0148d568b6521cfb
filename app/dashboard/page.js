// What a page adds to its bare address before the user has done anything takes the bare address's place: Back has one
// step for each thing that was done.
if (!history.hasOneStepEach) {
  history.hasOneStepEach = true;
  const push = history.pushState.bind(history), replace = history.replaceState.bind(history);
  let isNew = true; // the page, and nothing was done on it
  for (const kind of ["pointerdown", "keydown"]) addEventListener(kind, () => (isNew = false), true);
  history.pushState = (state, title, url) => {
    const isOther = new URL(url, location).pathname !== location.pathname;
    (isNew && !isOther ? replace : push)(state, title, url);
    isNew ||= isOther;
  };

  // What is shown of other numbers than the sliders beside it stand at fades at once, not when the server hears of it.
  const stands = (key) => document.querySelector(`.${CSS.escape(key)} input[type=range]`);
  const isAway = ([key, value]) => {
    const slider = stands(key);
    return slider && Math.abs(Number(slider.getAttribute("aria-valuetext")) - value) > 0.5 * Number(slider.step);
  };
  const compare = () => {
    for (const said of document.querySelectorAll(".st-key-results .of-sliders"))
      said.closest(".st-key-results").dataset.isBehind = Object.entries(JSON.parse(said.dataset.values)).some(isAway);
  };
  const looks = { subtree: true, childList: true, attributes: true, attributeFilter: ["aria-valuetext", "data-values"] };
  new MutationObserver(compare).observe(document.body, looks);
}
