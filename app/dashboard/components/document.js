// A separate page in a frame without rights: no script in it runs, and it cannot reach the page around it.

export default function ({ data, parentElement }) {
  const root = parentElement.querySelector(".document");
  const frame = root.querySelector("iframe") ?? root.appendChild(document.createElement("iframe"));
  frame.setAttribute("sandbox", "");
  frame.title = data.title;
  if (root.html === data.html) return; // keeps the scroll position
  root.html = data.html;
  frame.srcdoc = data.html;
}
