// The chain as a row of small pictures; the one that is chosen opens large below.

const NS = "http://www.w3.org/2000/svg";

export default function ({ data, parentElement, setTriggerValue }) {
  const strip = parentElement.querySelector(".strip");
  strip.setAttribute("role", "group");
  strip.setAttribute("aria-label", "Views");
  strip.replaceChildren(...data.items.map((item) => tile(item, item.name === data.chosen, () => setTriggerValue("view", item.name))));
  strip.onkeydown = (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    const tiles = [...strip.children], next = tiles[tiles.indexOf(strip.getRootNode().activeElement) + step];
    if (step && next) next.focus();
  };
}

function tile({ name, path, fill, picture }, isChosen, open) {
  const made = Object.assign(document.createElement("button"), { type: "button", onclick: open });
  made.setAttribute("aria-pressed", isChosen);
  const svg = document.createElementNS(NS, "svg");
  svg.setAttribute("viewBox", "0 0 100 44");
  svg.setAttribute("aria-hidden", "true");
  const drawn = document.createElementNS(NS, picture ? "image" : "path");
  const looks = picture
    ? { href: picture, width: 100, height: 44, preserveAspectRatio: "none" }
    : { d: path, fill: fill ? "currentColor" : "none", stroke: fill ? "none" : "currentColor", "stroke-width": 1.1, "stroke-linejoin": "round" };
  for (const [key, value] of Object.entries(looks)) drawn.setAttribute(key, value);
  svg.append(drawn);
  made.append(svg, Object.assign(document.createElement("span"), { textContent: name }));
  return made;
}
