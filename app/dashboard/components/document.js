// A page of its own in a frame without rights: no script in it runs, and it reaches nothing of the page around it.

export default function ({ data, parentElement }) {
  const root = parentElement.querySelector(".document");
  const frame = root.querySelector("iframe") ?? root.appendChild(document.createElement("iframe"));
  frame.setAttribute("sandbox", "");
  frame.title = data.title;
  if (root.html === data.html) return; // where it was scrolled to stays
  root.html = data.html;
  frame.srcdoc = data.html;
}
