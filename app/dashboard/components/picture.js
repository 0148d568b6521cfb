// A vector picture that is zoomed by dragging, and a ring of teeth with a readout. It is shown as an image, in which no
// script can run.

const LEAST = 1 / 40; // minimum range shown, over the whole width

export default function ({ data, parentElement, setStateValue }) {
  const root = parentElement.querySelector(".picture");
  const picture = (root.picture ??= new Picture(root));
  picture.tell = (range) => setStateValue("range", range);
  picture.update(data);
}

class Picture {
  constructor(root) {
    this.frame = made("div", { className: "frame", tabIndex: 0 });
    this.frame.setAttribute("role", "img");
    this.frame.setAttribute("aria-keyshortcuts", "ArrowLeft ArrowRight ArrowUp ArrowDown + - 0");
    this.image = made("img", { alt: "", draggable: false });
    this.box = made("div", { className: "box", hidden: true });
    this.tip = made("div", { className: "tip", hidden: true });
    this.button = made("button", { type: "button", textContent: "Reset zoom", title: "Show the whole picture (double-click, or key 0)", hidden: true });
    this.button.onclick = () => this.look(this.whole);
    this.frame.append(this.image, this.box, this.tip);
    root.style.position = "relative";
    root.append(this.frame, this.button);
    this.frame.addEventListener("pointerdown", (event) => this.press(event));
    this.frame.addEventListener("pointermove", (event) => this.read(event));
    this.frame.addEventListener("pointerleave", () => (this.tip.hidden = true));
    this.frame.addEventListener("dblclick", () => this.look(this.whole));
    this.frame.addEventListener("keydown", (event) => this.type(event));
  }

  update(data) {
    const isNew = this.data?.svg !== data.svg;
    this.data = data;
    this.curves = data.ring?.curves.map(({ name, values }) => [name, numbers(values)]);
    this.image.classList.toggle("turned", data.turned);
    this.frame.setAttribute("aria-label", data.words);
    if (isNew) {
      const [x, y, width, height] = data.svg.match(/viewBox="([^"]*)"/)[1].split(/[ ,]+/).map(Number);
      this.whole = [x, x + width, y, y + height];
    }
    const shown = data.shown ?? this.whole;
    // A reply to an earlier request must not undo a zoom in progress.
    if (!isNew && this.asked && !same(this.asked, shown)) return;
    this.asked = null;
    if (isNew || !same(this.view, shown)) this.show(shown);
  }

  // left, right, top, bottom: widened to the proportions of the whole picture, and kept within it.
  show([left, right, top, bottom]) {
    const [x, x1, y, y1] = this.whole, across = x1 - x, down = y1 - y;
    const share = Math.min(Math.max((right - left) / across, (bottom - top) / down, LEAST), 1);
    const width = share * across, height = share * down;
    left = Math.min(Math.max((left + right - width) / 2, x), x1 - width);
    top = Math.min(Math.max((top + bottom - height) / 2, y), y1 - height);
    this.view = [left, left + width, top, top + height];
    this.button.hidden = share === 1;
    const svg = this.data.svg.replace(/viewBox="[^"]*"/, `viewBox="${left} ${top} ${width} ${height}"`);
    this.image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(svg)}`;
  }

  look(view) {
    this.show(view);
    clearTimeout(this.timer);
    const told = this.button.hidden ? this.whole.slice(0, 2) : this.view;
    this.asked = this.view;
    this.timer = setTimeout(() => this.tell(told), 200);
  }

  moved(across, down) {
    const [left, right, top, bottom] = this.view, x = across * (right - left), y = down * (bottom - top);
    this.look([left + x, right + x, top + y, bottom + y]);
  }

  grown(times) {
    const [left, right, top, bottom] = this.view, x = ((times - 1) / 2) * (right - left), y = ((times - 1) / 2) * (bottom - top);
    this.look([left - x, right + x, top - y, bottom + y]);
  }

  type(event) {
    const act = {
      ArrowLeft: () => this.moved(-0.2, 0),
      ArrowRight: () => this.moved(0.2, 0),
      ArrowUp: () => this.moved(0, -0.2),
      ArrowDown: () => this.moved(0, 0.2),
      "+": () => this.grown(0.5),
      "-": () => this.grown(2),
      0: () => this.look(this.whole),
    }[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  }

  // Where an event is, in the picture's units.
  at({ offsetX, offsetY }) {
    const [left, right, top, bottom] = this.view, { clientWidth, clientHeight } = this.frame;
    return [left + (offsetX / clientWidth) * (right - left), top + (offsetY / clientHeight) * (bottom - top)];
  }

  press(event) {
    event.preventDefault();
    this.frame.focus({ preventScroll: true });
    this.frame.setPointerCapture(event.pointerId);
    const from = event, [x, y] = this.at(event);
    let last = event;
    const move = (e) => {
      if (from.shiftKey) {
        this.moved((last.offsetX - e.offsetX) / this.frame.clientWidth, (last.offsetY - e.offsetY) / this.frame.clientHeight);
        last = e;
        return;
      }
      const [left, top] = [Math.min(from.offsetX, e.offsetX), Math.min(from.offsetY, e.offsetY)];
      const size = [Math.abs(e.offsetX - from.offsetX), Math.abs(e.offsetY - from.offsetY)];
      this.box.hidden = false;
      Object.assign(this.box.style, { left: `${left}px`, top: `${top}px`, width: `${size[0]}px`, height: `${size[1]}px` });
    };
    const stop = (e) => {
      for (const kind of ["pointerup", "pointercancel"]) this.frame.removeEventListener(kind, stop);
      this.frame.removeEventListener("pointermove", move);
      this.box.hidden = true;
      if (from.shiftKey || e.type === "pointercancel" || Math.hypot(e.offsetX - from.offsetX, e.offsetY - from.offsetY) < 6) return;
      const [x1, y1] = this.at(e);
      this.look([Math.min(x, x1), Math.max(x, x1), Math.min(y, y1), Math.max(y, y1)]);
    };
    this.frame.addEventListener("pointermove", move);
    for (const kind of ["pointerup", "pointercancel"]) this.frame.addEventListener(kind, stop);
  }

  // Of a ring: angle, tooth and values under the pointer.
  read(event) {
    const { ring } = this.data;
    if (!ring) return;
    const [x, y] = this.at(event), [left, right, top, bottom] = this.whole;
    const turn = Math.atan2(x - (left + right) / 2, (top + bottom) / 2 - y) / (2 * Math.PI), share = turn < 0 ? turn + 1 : turn;
    const number = (value) => `${withMinus(Number(value.toPrecision(4)))} ${ring.unit}`.trimEnd();
    const values = this.curves.map(([name, curve]) => `${name ? `${name} ` : ""}${number(curve[Math.floor(share * curve.length)])}`);
    const tooth = ring.teeth ? `, tooth ${Math.floor(share * ring.teeth) + 1}` : "";
    this.tip.textContent = `${(360 * share).toFixed(1)}°${tooth}: ${values.join(", ")}`;
    this.tip.hidden = event.buttons > 0;
    const isRight = event.offsetX > this.frame.clientWidth / 2;
    Object.assign(this.tip.style, { left: isRight ? "" : `${event.offsetX + 14}px`, right: isRight ? `${this.frame.clientWidth - event.offsetX + 14}px` : "", top: `${event.offsetY + 10}px` });
  }
}

const same = (a, b) => a.every((value, i) => Math.abs(value - b[i]) < 1e-6);
const made = (name, looks) => Object.assign(document.createElement(name), looks);
