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
}
