// What a page adds to its bare address before the user has done anything replaces the bare address: Back has one step
// for each user action.
if (!history.hasOneStepEach) {
  history.hasOneStepEach = true;
  const push = history.pushState.bind(history), replace = history.replaceState.bind(history);
  let isNew = true; // nothing has been done on the page yet
  for (const kind of ["pointerdown", "keydown"]) addEventListener(kind, () => (isNew = false), true);
  history.pushState = (state, title, url) => {
    const isOther = new URL(url, location).pathname !== location.pathname;
    (isNew && !isOther ? replace : push)(state, title, url);
    isNew ||= isOther;
  };

  // Results for other values than those of the sliders fade at once, not only when the server notices.
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
