// A figure of lines or of a map over one axis. Dragging zooms, and the server is told the range shown, so that it sends
// the detail. Cursors, peak table and export need no server. A plane, of paths and points, is sent whole and zoomed
// along both axes. Named bars are drawn in rows over the axis.

const NS = "http://www.w3.org/2000/svg";
const LEFT = 74, RIGHT = 16, SCALE = 76, BOTTOM = 44, ROW = 16, MAX_ROWS = 4, N_HARMONICS = 12, N_SIDEBANDS = 5, N_PEAKS = 12, N_FEW = 300, MOST_SQUARE = 560, LABEL = 26;
const ROW_HEIGHT = 40, NARROW = 460; // of bars in rows
const SUPERSCRIPTS = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };
const DEGREES = [5, 10, 15, 30, 45, 90, 180];
const TOOLS = { cursor: "Cursor", harmonics: "Harmonics", sidebands: "Sidebands" };

export default function ({ data, parentElement, setStateValue }) {
  const root = parentElement.querySelector(".figure");
  const figure = (root.figure ??= new Figure(root));
  figure.tell = (range) => setStateValue("range", range);
  figure.update(data);
}

class Figure {
  constructor(root) {
    this.root = root;
    this.left = LEFT;
    this.tool = "";
    this.at = null; // position of the cursor, or of the first harmonic, or of the carrier
    this.step = null; // distance of the sidebands
    this.peaks = false;
    this.svg = element("svg", { role: "img", tabindex: 0, "aria-keyshortcuts": "ArrowLeft ArrowRight + - 0 Escape" });
    this.bar = html("div", "bar");
    this.words = html("div", "words");
    this.table = html("div", "peaks");
    this.tip = Object.assign(html("div", "tip"), { hidden: true });
    const frame = html("div", "frame");
    frame.append(this.svg, this.tip);
    root.append(this.bar, frame, this.words, this.table);
    this.svg.addEventListener("pointerdown", (event) => this.press(event));
    this.svg.addEventListener("pointermove", (event) => this.hover(event));
    this.svg.addEventListener("pointerleave", () => this.showTip(null));
    this.svg.addEventListener("dblclick", () => this.look(this.whole, null));
    this.svg.addEventListener("keydown", (event) => this.type(event));
    new ResizeObserver(() => this.data && this.root.clientWidth !== this.width && this.draw()).observe(root);
  }

  update(data) {
    const asked = this.asked;
    this.data = data;
    this.lines = data.lines.map((line) => ({ ...line, x: numbers(line.x), y: numbers(line.y), low: numbers(line.low), high: numbers(line.high) }));
    this.levels = data.map && bytes(data.map.levels);
    this.hasScale = data.map && (!data.square || data.map.unit); // points of a recurrence plot are present or not
    this.whole = data.whole;
    // A reply to an earlier request must not undo a zoom in progress.
    if (!asked || same(asked, [...data.shown, ...(data.across ?? [])])) {
      this.view = data.shown;
      this.asked = null;
      this.across = data.across ?? null;
    }
    this.drawBar();
    this.draw();
  }

  // ---------- the range shown

  look(range, across = this.across) {
    const widest = this.whole[1] - this.whole[0];
    let [low, high] = range;
    const span = Math.max(high - low, widest * 1e-6);
    low = Math.max(this.whole[0], Math.min(low, this.whole[1] - span));
    this.view = span < widest ? [low, low + span] : [...this.whole]; // low + span may round to less than the whole
    this.across = across; // of a plane: the y range shown
    const asked = (this.asked = [...this.view, ...(across ?? [])]);
    this.draw();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.tell(asked), 200);
  }

  type(event) {
    const [low, high] = this.view, span = high - low, middle = (low + high) / 2;
    const moved = (by) => [low + by * span, high + by * span];
    const push = (way) => {
      if (this.at === null) this.look(moved(0.2 * way));
      else if (event.shiftKey && this.tool === "sidebands") this.moveTo(this.at + this.step + (way * span) / 2000, { of: "step", times: 1 });
      else this.moveTo(this.at + (way * span) / 400);
    };
    const { plane } = this.data, [bottom, top] = this.limits, tall = top - bottom;
    const next = plane && {
      ArrowUp: () => this.look(this.view, [bottom + 0.2 * tall, top + 0.2 * tall]),
      ArrowDown: () => this.look(this.view, [bottom - 0.2 * tall, top - 0.2 * tall]),
      "+": () => this.look([middle - span / 4, middle + span / 4], [bottom + tall / 4, top - tall / 4]),
      "-": () => this.look([middle - span, middle + span], [bottom - tall / 2, top + tall / 2]),
    }[event.key] || {
      ArrowLeft: () => push(-1),
      ArrowRight: () => push(1),
      "+": () => this.look([middle - span / 4, middle + span / 4]),
      "-": () => this.look([middle - span, middle + span]),
      0: () => this.look(this.whole, null),
      Escape: () => this.choose(""),
    }[event.key];
    if (next) {
      event.preventDefault();
      next();
    }
  }

  press(event) {
    const start = this.position(event);
    if (start === null) return;
    event.preventDefault();
    this.svg.focus({ preventScroll: true });
    this.svg.setPointerCapture(event.pointerId);
    const held = this.held(start), before = [...this.view], from = event.offsetX, height = event.offsetY;
    const tall = (e) => (this.data.plane && Math.abs(e.offsetY - height) > 5 ? [height, e.offsetY].sort((a, b) => a - b) : null);
    const move = (e) => {
      const now = this.unscale(e.offsetX);
      if (held) this.moveTo(now, held);
      else if (event.shiftKey) {
        const by = ((from - e.offsetX) / this.plotWidth) * (before[1] - before[0]);
        this.look([before[0] + by, before[1] + by]);
      } else this.band(start, now, tall(e));
    };
    const stop = (e) => {
      this.svg.removeEventListener("pointermove", move);
      this.svg.removeEventListener("pointerup", stop);
      this.svg.removeEventListener("pointercancel", stop);
      this.band(null);
      if (held || event.shiftKey || e.type === "pointercancel") return;
      const across = tall(e)?.map((py) => this.fall(py)).reverse();
      if (Math.abs(e.offsetX - from) > 5) this.look([start, this.unscale(e.offsetX)].sort((a, b) => a - b), across);
      else if (this.tool) this.moveTo(start);
    };
    this.svg.addEventListener("pointermove", move);
    this.svg.addEventListener("pointerup", stop);
    this.svg.addEventListener("pointercancel", stop);
  }

  // ---------- cursors that are dragged

  choose(tool) {
    this.tool = this.tool === tool ? "" : tool;
    const [low, high] = this.view;
    if (!this.tool) this.at = null;
    else this.at ??= this.highest(low + 0.02 * (high - low), high)?.[0] ?? (low + high) / 2;
    this.step ??= this.data.step || (high - low) / 12;
    this.drawBar();
    this.draw();
  }

  own() {
    if (this.at === null) return [];
    if (this.tool === "harmonics") return range(1, N_HARMONICS).map((k) => [k * this.at, k === 1 ? "1×" : `${k}×`]);
    if (this.tool === "sidebands")
      return range(-N_SIDEBANDS, N_SIDEBANDS).map((k) => [this.at + k * this.step, k ? `${k > 0 ? "+" : "−"}${Math.abs(k)}` : "C"]);
    return [[this.at, ""]];
  }

  held(position) {
    const away = this.own().map(([at]) => Math.abs(this.scale(at) - this.scale(position))), least = Math.min(...away);
    if (!(least < 7)) return null;
    const index = away.indexOf(least);
    if (this.tool === "harmonics") return { of: "at", times: index + 1 };
    const k = index - N_SIDEBANDS;
    return this.tool === "sidebands" && k ? { of: "step", times: k } : { of: "at", times: 1 };
  }

  moveTo(position, held = { of: "at", times: 1 }) {
    const least = (3 / this.plotWidth) * (this.view[1] - this.view[0]);  // any closer, they could not be distinguished
    if (held.of === "step") this.step = Math.max((position - this.at) / held.times, least);
    else this.at = position / held.times;
    this.draw();
  }

  // The highest value between two positions of a line, by default the one in front: [position, value].
  highest(low, high, line = this.lines.at(-1)) {
    if (!line) return null;
    let best = null;
    for (let i = lowerBound(line.x, low); i < line.x.length && line.x[i] <= high; i++)
      if (best === null || line.y[i] > line.y[best]) best = i;
    return best === null ? null : [line.x[best], line.y[best]];
  }

  // ---------- drawing

  scale(x) {
    const [low, high] = this.view;
    const share = this.data.log_x ? Math.log(Math.max(x, 1e-300) / low) / Math.log(high / low) : (x - low) / (high - low);
    return this.left + share * this.plotWidth;
  }

  unscale(px) {
    const [low, high] = this.view, share = (px - this.left) / this.plotWidth;
    return this.data.log_x ? low * (high / low) ** share : low + share * (high - low);
  }
  rise(y) {
    const [low, high] = this.limits;
    const share = this.data.log ? Math.log(Math.max(y, 1e-300) / low) / Math.log(high / low) : (y - low) / (high - low);
    return this.top + (1 - share) * this.plotHeight;
  }

  fall(py) { return this.ofShare(1 - (py - this.top) / this.plotHeight); }

  ofShare(share) {
    const [low, high] = this.limits;
    return this.data.log ? low * (high / low) ** share : low + share * (high - low);
  }

  draw() {
    const { data, root } = this, style = getComputedStyle(root);
    this.width = root.clientWidth;
    if (!this.width) return;
    if (data.rows) return this.drawRows(style);
    this.plotWidth = Math.max(this.width - LEFT - (this.hasScale ? SCALE : RIGHT), 60);
    if (data.square) this.plotWidth = Math.min(this.plotWidth, MOST_SQUARE);
    this.plotHeight = data.square ? this.plotWidth : data.height;
    const named = this.placed();
    this.top = 10 + ROW * named.rows;
    const height = this.top + this.plotHeight + BOTTOM;
    this.ink = style.getPropertyValue("--ink").trim() || style.color;
    this.rule = style.getPropertyValue("--rule").trim() || "#8884";
    this.limits = data.map ? data.map.limits : (data.plane && this.across) || data.limits || this.ownLimits();
    const { svg } = this;
    svg.replaceChildren();
    set(svg, { width: this.width, height, viewBox: `0 0 ${this.width} ${height}`, "font-family": style.fontFamily, "font-size": 13, "aria-label": data.alternative });
    const clip = `clip${Math.random().toString(36).slice(2)}`;
    const rect = { x: LEFT, y: this.top, width: this.plotWidth, height: this.plotHeight };
    add(add(add(svg, "defs"), "clipPath", { id: clip }), "rect", rect);
    this.drawAxes();
    const inside = add(svg, "g", { "clip-path": `url(#${clip})` });
    for (const [from, to, colour] of data.spans ?? [])
      add(inside, "rect", { x: this.scale(from), width: Math.max(this.scale(to) - this.scale(from), 1), y: this.top, height: this.plotHeight, fill: colour, opacity: 0.14 });
    if (data.map) this.drawMap(inside);
    for (const line of this.lines) this.drawLine(inside, line);
    for (const [x, y] of data.marked)
      add(inside, "circle", { cx: this.scale(x), cy: this.rise(y), r: 7, fill: "none", stroke: data.fault, "stroke-width": 2 });
    this.drawCursors(inside, named);
    this.drawOwn(inside);
    if (this.hasScale) this.drawScale();
    this.selection = add(inside, "rect", { y: this.top, height: this.plotHeight, width: 0, fill: this.ink, opacity: 0.12 });
    this.drawPeaks();
  }

  // Bars one below the other, with names on the left, or above where there is little room, and values on the right.
  drawRows(style) {
    const { data, svg } = this, isAbove = data.above || this.width < NARROW, beside = 16 + Math.max(...data.rows.map((row) => Math.max(7.8 * row.beside.length, 6.8 * row.below.length)));
    this.ink = style.getPropertyValue("--ink").trim() || style.color;
    this.rule = style.getPropertyValue("--rule").trim() || "#8884";
    this.left = isAbove ? 8 : Math.min(0.42 * this.width, 14 + 6.6 * Math.max(...data.rows.map((row) => row.name.length)));
    this.plotWidth = Math.max(this.width - this.left - beside, 60);
    this.top = 6;
    const room = (isAbove ? this.width - this.left : this.left - 14) / 6.3, names = data.rows.map((row) => wrapped(row.name, room, 3));
    const nAbove = isAbove ? Math.max(...names.map((lines) => lines.length)) : 0, above = 14 * nAbove;
    this.rowHeight = ROW_HEIGHT + (isAbove ? above - 6 : 0);
    this.plotHeight = this.rowHeight * data.rows.length;
    const bottom = this.top + this.plotHeight, right = this.left + this.plotWidth, height = bottom + BOTTOM, quiet = { fill: this.ink, opacity: 0.75 };
    svg.replaceChildren();
    set(svg, { width: this.width, height, viewBox: `0 0 ${this.width} ${height}`, "font-family": style.fontFamily, "font-size": 13, "aria-label": data.alternative });
    const clip = `clip${Math.random().toString(36).slice(2)}`;
    add(add(add(svg, "defs"), "clipPath", { id: clip }), "rect", { x: this.left, y: this.top, width: this.plotWidth, height: this.plotHeight });
    const inside = add(svg, "g", { "clip-path": `url(#${clip})` });
    const box = (low, high, y, tall, looks) => add(inside, "rect", { x: this.scale(Math.min(low, high)), width: Math.abs(this.scale(high) - this.scale(low)), y, height: tall, ...looks });
    if (data.span) box(...data.span, this.top, this.plotHeight, { fill: data.quiet, opacity: 0.18 });
    for (const value of ticks(...this.view, this.plotWidth / 75)) {
      const x = this.scale(value);
      add(svg, "line", { x1: x, x2: x, y1: this.top, y2: bottom + 5, stroke: this.rule });
      text(svg, x, bottom + 18, plain(value, ...this.view), { ...quiet, "text-anchor": "middle" });
    }
    add(svg, "line", { x1: this.left, x2: right, y1: bottom, y2: bottom, stroke: this.ink, opacity: 0.5 });
    const middle = Math.max(Math.min(this.left + this.plotWidth / 2, this.width - 3.4 * data.x.length), 3.4 * data.x.length);
    text(svg, middle, bottom + 37, data.x, { ...quiet, "text-anchor": "middle" });
    add(inside, "line", { x1: this.scale(0), x2: this.scale(0), y1: this.top, y2: bottom, stroke: this.ink, opacity: 0.5 });
    data.rows.forEach((row, i) => {
      const y = this.top + i * this.rowHeight, tall = isAbove ? 13 : 18, at = y + (isAbove ? 13 + above : (this.rowHeight - tall) / 2), centre = at + tall / 2;
      const bold = row.strong ? { "font-weight": 600 } : {};
      const lines = names[i], looks = { fill: this.ink, ...bold };
      lines.forEach((line, k) => {
        if (isAbove) text(svg, this.left, y + 19 + 14 * (k + nAbove - lines.length), line, looks);
        else text(svg, this.left - 8, centre + 4 + 13 * (k - (lines.length - 1) / 2), line, { ...looks, "text-anchor": "end" });
      });
      if (row.band !== null) box(-row.band, row.band, at - 6, tall + 12, { fill: data.quiet, opacity: 0.24 });
      box(row.start, row.end, at, tall, { fill: row.colour, opacity: 0.85, rx: 2 });
      if (row.interval) {
        const [low, high] = row.interval.map((end) => this.scale(Math.min(Math.max(end, this.view[0] - 1), this.view[1] + 1)));
        add(inside, "path", { d: `M${low},${centre}H${high}M${low},${centre - 4}v8M${high},${centre - 4}v8`, stroke: this.ink, fill: "none", "stroke-width": 1.2 });
      }
      if (row.mark !== null) add(inside, "path", { d: `M${this.scale(row.mark)},${centre - 6}l6,6l-6,6l-6,-6z`, fill: style.getPropertyValue("--paper").trim() || "#fff", stroke: data.mark_colour, "stroke-width": 2 });
      if (row.beside) text(svg, right + 8, centre + (row.below ? -2 : 4), row.beside, { fill: row.verdict ?? this.ink, "font-weight": 600 });
      if (row.below) text(svg, right + 8, centre + 13, row.below, quiet);
    });
    this.selection = add(inside, "rect", { y: this.top, height: this.plotHeight, width: 0, fill: this.ink, opacity: 0.12 });
    this.drawPeaks();
  }

  // The text of a row, with its unit.
  rowWords(row) {
    const { data } = this, unit = ` ${data.x_unit}`, said = [row.name];
    const isChange = row.start !== 0;
    said.push(`${data.bar}: ${isChange ? `${figure(row.start)} → ` : ""}${figure(row.end)}${unit}`);
    if (row.interval) {
      const [low, high] = row.interval;
      said.push(`90 % interval: ${high < 1e299 ? `${figure(low)} to ${figure(high)}` : `at least ${figure(low)}`}${unit}`);
    }
    if (row.mark !== null) said.push(`${data.mark}: ${figure(row.mark)}${unit}`);
    if (row.band !== null) said.push(`${data.band}: ±${figure(row.band)}${unit}`);
    return said;
  }

  ownLimits() {
    let low = Infinity, high = -Infinity;
    for (const line of this.lines) {
      const { x, y, low: floor } = line, { plane } = this.data;
      for (let i = plane ? 0 : lowerBound(x, this.view[0]); i < x.length && (plane || x[i] <= this.view[1]); i++) {
        if (Number.isNaN(y[i])) continue;
        low = Math.min(low, floor.length ? floor[i] : y[i]);
        high = Math.max(high, floor.length ? line.high[i] : y[i]);
      }
    }
    if (this.data.log && high > 0) return [Math.max(low, high * 1e-6) / 1.3, high * 1.3];
    if (!(high > low)) [low, high] = Number.isFinite(low) ? [low - 1, low + 1] : [0, 1];
    const margin = 0.06 * (high - low);
    return [low - margin, high + margin];
  }

  drawAxes() {
    const { svg, data, plotWidth, plotHeight, top } = this, [low, high] = this.limits, bottom = top + plotHeight;
    const quiet = { fill: this.ink, opacity: 0.75 };
    const powers = data.log && decades(low, high).some((value) => value < 0.001 || value >= 10000);
    for (const value of data.log ? decades(low, high) : ticks(low, high, plotHeight / 45)) {
      const y = this.rise(value);
      add(svg, "line", { x1: LEFT, x2: LEFT + plotWidth, y1: y, y2: y, stroke: this.rule });
      text(svg, LEFT - 7, y + 4, data.log ? short(value, powers) : plain(value, low, high), { ...quiet, "text-anchor": "end" });
    }
    for (const value of data.dates ? days(...this.view, plotWidth / 95) : this.places()) {
      const x = this.scale(value), words = data.dates ? date(value) : data.log_x ? short(value, false) : plain(value, ...this.view);
      add(svg, "line", { x1: x, x2: x, y1: bottom, y2: bottom + 5, stroke: this.ink, opacity: 0.5 });
      text(svg, Math.min(x, this.width - 3.6 * words.length), bottom + 18, words, { ...quiet, "text-anchor": "middle" });
    }
    add(svg, "line", { x1: LEFT, x2: LEFT + plotWidth, y1: bottom, y2: bottom, stroke: this.ink, opacity: 0.5 });
    text(svg, LEFT + plotWidth / 2, bottom + 37, data.x, { ...quiet, "text-anchor": "middle" });
    const label = text(svg, 0, 0, data.y, { ...quiet, "text-anchor": "middle" });
    label.setAttribute("transform", `translate(13,${top + plotHeight / 2}) rotate(-90)`);
  }

  // Positions of the numbers along the x axis: as many as their width leaves room for.
  places() {
    if (this.data.log_x) return decades(...this.view);
    const steps = this.data.x_unit === "deg" ? DEGREES : null, n = (room) => Math.min(this.plotWidth / room, 12);
    const wide = Math.max(...ticks(...this.view, n(95), steps).map((value) => String(plain(value, ...this.view)).length), 1);
    return ticks(...this.view, n(Math.max(28 + 7 * wide, 48)), steps);
  }

  named(x) {
    return this.data.dates ? date(x) : measure(x, this.data.x_unit);
  }

  drawLine(inside, line) {
    const { x, y, low } = line, parts = [], { plane } = this.data, from = plane ? 0 : Math.max(lowerBound(x, this.view[0]) - 1, 0);
    const to = plane ? x.length : Math.min(lowerBound(x, this.view[1]) + 1, x.length), band = [];
    let pen = "M";
    for (let i = from; i < to; i++) {
      if (Number.isNaN(y[i])) { pen = "M"; continue; }
      parts.push(`${pen}${this.scale(x[i]).toFixed(1)},${this.rise(y[i]).toFixed(1)}${line.dots ? "h0" : ""}`);
      if (!line.dots) pen = "L";
    }
    if (low.length) {
      for (let i = from; i < to; i++) band.push(`${this.scale(x[i]).toFixed(1)},${this.rise(line.high[i]).toFixed(1)}`);
      for (let i = to - 1; i >= from; i--) band.push(`${this.scale(x[i]).toFixed(1)},${this.rise(low[i]).toFixed(1)}`);
      add(inside, "polygon", { points: band.join(" "), fill: line.colour, opacity: 0.22 });
    }
    add(inside, "path", { d: parts.join(""), fill: "none", stroke: line.colour, "stroke-width": line.dots ? (plane && this.lines.length > 1 && x.length > N_FEW ? 2.5 : 4.5) : plane ? 0.8 : 1.2, opacity: plane && !line.dots ? 0.6 : null, "stroke-linecap": line.dots ? "round" : null, "stroke-linejoin": "round", "stroke-dasharray": line.dotted ? "2 3" : null });
  }

  // The machine's cursors, most important first, and the rows of their labels. A sideband is labelled only in the row of
  // the mesh lines, so that none is named unless the others are. Quiet ones are named only at the pointer.
  placed() {
    const rows = Array.from({ length: MAX_ROWS }, () => []), labels = [];
    const seen = this.data.cursors.filter((cursor) => cursor.at >= this.view[0] && cursor.at <= this.view[1]);
    for (const cursor of seen.filter(({ is_quiet }) => !is_quiet)) {
      const x = this.scale(cursor.at), half = cursor.label.length * 3.4 + 4;
      const row = rows.findIndex((taken) => taken.every(([low, high]) => x + half < low || x - half > high));
      if (row < 0 || (cursor.is_sideband && row > 0) || x + half > this.width || x - half < 0) continue;
      rows[row].push([x - half, x + half]);
      labels.push({ ...cursor, x, row });
    }
    return { seen, labels, rows: rows.filter((taken) => taken.length).length };
  }

  drawCursors(inside, { seen, labels }) {
    for (const { at, colour, dash, is_quiet } of seen)
      add(inside, "line", { x1: this.scale(at), x2: this.scale(at), y1: this.top, y2: this.top + this.plotHeight, stroke: colour, opacity: is_quiet ? 0.3 : 0.6, "stroke-dasharray": dash });
    for (const { x, row, label, colour } of labels)
      text(this.svg, x, this.top - 5 - ROW * row, label, { fill: colour, "text-anchor": "middle" });
  }

  drawOwn(inside) {
    const away = ([at]) => Math.abs(at - this.at), lettered = [];
    const shown = this.own().filter(([at]) => at >= this.view[0] && at <= this.view[1]).sort((a, b) => away(a) - away(b));
    for (const [at, label] of shown) {
      const x = this.scale(at);
      add(inside, "line", { x1: x, x2: x, y1: this.top, y2: this.top + this.plotHeight, stroke: this.ink, "stroke-width": 1.5, class: "own" });
      if (!label || lettered.some((other) => Math.abs(other - x) < LABEL)) continue;
      lettered.push(x);
      text(inside, x + 3, this.top + 12, label, { fill: this.ink });
    }
    this.words.replaceChildren();
    if (this.at === null) return;
    const near = 0.004 * (this.view[1] - this.view[0]), value = this.highest(this.at - near, this.at + near);
    const [factor, unit] = this.data.per_unit ?? [0, ""];
    const say = [this.named(this.at) + (factor ? ` (${measure(this.at * factor, unit)})` : "")];
    if (value) say.push(`${figure(value[1])} ${this.data.y_unit}`);
    if (this.tool === "sidebands") say.push(`sidebands every ${figure(this.step)} ${this.data.x_unit}`);
    this.words.textContent = `${TOOLS[this.tool]}: ${say.join(" · ")}`;
  }

  drawMap(inside) {
    const { map } = this.data, canvas = document.createElement("canvas"), lut = bytes(map.colours);
    canvas.width = map.columns;
    canvas.height = map.rows;
    const context = canvas.getContext("2d"), image = context.createImageData(map.columns, map.rows);
    for (let i = 0; i < this.levels.length; i++) {
      const row = map.rows - 1 - Math.floor(i / map.columns), at = 4 * (row * map.columns + (i % map.columns));
      image.data.set(lut.subarray(3 * this.levels[i], 3 * this.levels[i] + 3), at);
      image.data[at + 3] = map.blank && !this.levels[i] ? 0 : 255;
    }
    context.putImageData(image, 0, 0);
    const [low, high] = map.span;
    add(inside, "image", { href: canvas.toDataURL(), x: this.scale(low), width: this.scale(high) - this.scale(low), y: this.top, height: this.plotHeight, preserveAspectRatio: "none" });
  }

  drawScale() {
    const { map } = this.data, lut = bytes(map.colours), x = LEFT + this.plotWidth + 14, n = 48, step = this.plotHeight / n;
    for (let i = 0; i < n; i++) {
      const k = 3 * Math.round((255 * (n - 1 - i)) / (n - 1));
      add(this.svg, "rect", { x, y: this.top + i * step, width: 10, height: step + 0.5, fill: `rgb(${lut.slice(k, k + 3)})`, "shape-rendering": "crispEdges" });
    }
    const quiet = { fill: this.ink, opacity: 0.75 };
    for (const value of ticks(map.low, map.high, this.plotHeight / 60)) {
      const y = this.top + (1 - (value - map.low) / (map.high - map.low)) * this.plotHeight;
      add(this.svg, "line", { x1: x + 10, x2: x + 13, y1: y, y2: y, stroke: this.ink, opacity: 0.5 });
      text(this.svg, x + 16, y + 4, plain(value, map.low, map.high), quiet);
    }
    const unit = text(this.svg, 0, 0, map.unit, { ...quiet, "text-anchor": "middle" });
    unit.setAttribute("transform", `translate(${x + 56},${this.top + this.plotHeight / 2}) rotate(-90)`);
  }

  band(from, to, tall = null) {
    if (from === null) return set(this.selection, { width: 0 });
    const [low, high] = [this.scale(from), this.scale(to)].sort((a, b) => a - b), [top, bottom] = tall ?? [this.top, this.top + this.plotHeight];
    set(this.selection, { x: low, width: high - low, y: top, height: bottom - top });
  }

  // ---------- readout

  position(event) {
    const x = event.offsetX;
    return x < this.left || x > this.left + this.plotWidth ? null : this.unscale(x);
  }

  hover(event) {
    const x = this.position(event), { data } = this;
    if (data.rows) {
      const row = data.rows[Math.floor((event.offsetY - this.top) / this.rowHeight)];
      return this.showTip(row && event.offsetY >= this.top ? this.rowWords(row) : null, event);
    }
    if (x === null || event.offsetY < this.top || event.offsetY > this.top + this.plotHeight) return this.showTip(null);
    this.svg.style.cursor = this.held(x) ? "ew-resize" : "crosshair";
    const near = this.unscale(this.scale(x) + 4) - x, lines = [];
    const cursors = data.cursors.filter(({ at }) => Math.abs(at - x) < near).slice(0, 6);
    if (data.map) lines.push(this.levelAt(x, event.offsetY));
    if (data.plane) lines.push(this.nearest(event.offsetX, event.offsetY));
    for (const line of data.plane ? [] : this.lines) {
      const value = this.highest(x - near, x + near, line);
      if (value) lines.push(`${this.lines.length > 1 ? line.name + ": " : ""}${this.named(value[0])}, ${figure(value[1])} ${data.y_unit}`);
    }
    for (const { label, at } of cursors) lines.push(`${label}: ${this.named(at)}`);
    this.showTip(lines, event);
  }

  // The point of a plane under the pointer, in words.
  nearest(px, py) {
    let best = 144, words = "";
    for (const { name, x, y } of this.lines)
      for (let i = 0; i < x.length; i++) {
        const away = (this.scale(x[i]) - px) ** 2 + (this.rise(y[i]) - py) ** 2;
        if (away < best) {
          best = away;
          words = `${this.data.legend ? `${name}: ` : ""}${this.named(x[i])}, ${figure(y[i])} ${this.data.y_unit}`;
        }
      }
    return words;
  }

  levelAt(x, py) {
    const { map } = this.data, [low, high] = map.span;
    const column = Math.floor(((x - low) / (high - low)) * map.columns);
    const share = 1 - (py - this.top) / this.plotHeight, row = Math.min(map.rows - 1, Math.floor(share * map.rows));
    if (column < 0 || column >= map.columns) return "";
    const step = this.levels[row * map.columns + column], level = map.low + (step / 255) * (map.high - map.low);
    const y = this.ofShare(share), isBlank = map.blank && !step;
    const also = map.also ? `, ${figure(map.also[row])} ${map.also_unit}` : "";
    return `${measure(x, this.data.x_unit)}, ${measure(y, this.data.y_unit)}${also}${this.hasScale && !isBlank ? `: ${withMinus(level.toFixed(digits(map)))} ${map.unit}` : ""}`;
  }

  showTip(lines, event) {
    this.tip.replaceChildren(...(lines ?? []).filter(Boolean).map((line) => Object.assign(html("div"), { textContent: line })));
    this.tip.hidden = !lines?.length;
    if (!event) return;
    const left = event.offsetX > this.width / 2;
    Object.assign(this.tip.style, { left: left ? "" : `${event.offsetX + 14}px`, right: left ? `${this.width - event.offsetX + 14}px` : "", top: `${event.offsetY + 10}px` });
  }

  // The highest local maxima in the range shown, of the line in front.
  found() {
    const line = this.lines.at(-1), found = [];
    if (!line) return found;
    const { x, y } = line;
    for (let i = Math.max(lowerBound(x, this.view[0]), 1); i < x.length - 1 && x[i] <= this.view[1]; i++)
      if (y[i] > y[i - 1] && y[i] >= y[i + 1]) found.push([x[i], y[i]]);
    const apart = (this.view[1] - this.view[0]) / 200, kept = [];
    for (const peak of found.sort((a, b) => b[1] - a[1])) {
      if (kept.every(([at]) => Math.abs(at - peak[0]) > apart)) kept.push(peak);
      if (kept.length === N_PEAKS) break;
    }
    return kept;
  }

  drawPeaks() {
    this.table.replaceChildren();
    if (!this.peaks) return;
    const { data } = this, table = html("table"), near = (this.view[1] - this.view[0]) * 0.004;
    const row = (cells, kind = "td") => {
      const line = html("tr");
      line.append(...cells.map((cell) => Object.assign(html(kind), { textContent: cell })));
      table.append(line);
    };
    row(["", data.x, data.y, "line"], "th");
    this.found().forEach(([x, y], i) => {
      const named = data.cursors.filter(({ at }) => Math.abs(at - x) <= near).sort((a, b) => Math.abs(a.at - x) - Math.abs(b.at - x));
      row([i + 1, figure(x), figure(y), named.slice(0, 2).map(({ label }) => label).join(", ")]);
    });
    this.table.append(table);
  }

  // ---------- the bar of buttons, and files

  drawBar() {
    const button = (label, act, about, on = null) => {
      const made = Object.assign(html("button"), { textContent: label, title: about, type: "button", onclick: act });
      if (on !== null) made.setAttribute("aria-pressed", on);
      return made;
    };
    const left = html("span"), right = html("span");
    const named = this.lines.filter(({ name, dotted }, i, all) => name && all.findIndex((line) => line.name === name && line.dotted === dotted) === i);
    if (this.lines.length > 1 && this.data.legend)
      for (const line of this.data.front_first ? named.reverse() : named) {
        const key = html("i");
        key.style.background = line.dotted ? `repeating-linear-gradient(90deg, ${line.colour} 0 3px, transparent 3px 5px)` : line.colour;
        const entry = html("span", "key");
        entry.append(key, line.name);
        left.append(entry);
      }
    for (const [name, colour] of this.keys()) {
      const key = html("i");
      key.style.background = colour;
      const entry = html("span", "key");
      entry.append(key, name);
      left.append(entry);
    }
    const isNarrow = this.root.clientWidth > 0 && this.root.clientWidth < 330; // one of several side by side
    if (this.data.has_tools && !isNarrow) {
      for (const [tool, label] of Object.entries(TOOLS).slice(0, this.data.dates ? 1 : 3)) // a date has no harmonics
        right.append(button(label, () => this.choose(tool), `${label}: drag, or use the arrow keys${tool === "sidebands" ? ", with Shift for the spacing" : ""}`, this.tool === tool));
      if (this.lines.length)
        right.append(button("Peaks", () => { this.peaks = !this.peaks; this.drawBar(); this.draw(); }, "Table of the highest peaks shown", this.peaks));
    }
    right.append(button("Reset zoom", () => this.look(this.whole, null), "Show the whole figure (double-click, or key 0)"));
    for (const kind of ["PNG", "SVG", "CSV"]) right.append(button(kind, () => this.save(kind), `Save what is shown as ${kind}`));
    this.bar.replaceChildren(left, right);
  }

  // Legend of bars beside what they are compared with.
  keys() {
    const { data } = this;
    if (!data.rows || !data.mark) return [];
    return [[data.bar, data.rows[0].colour], [data.mark, data.mark_colour], [data.band, data.quiet]];
  }

  async save(kind) {
    if (kind === "CSV") return give(new Blob([this.csv()], { type: "text/csv" }), `${this.data.name}.csv`);
    const copy = this.svg.cloneNode(true), paper = getComputedStyle(this.root).getPropertyValue("--paper").trim() || "#fff";
    copy.setAttribute("xmlns", NS);
    copy.prepend(element("rect", { width: "100%", height: "100%", fill: paper }));
    const source = new XMLSerializer().serializeToString(copy);
    const blob = new Blob([source], { type: "image/svg+xml" });
    if (kind === "SVG") return give(blob, `${this.data.name}.svg`);
    const image = new Image(), times = 2;
    image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(source)}`;
    await image.decode();
    const canvas = Object.assign(document.createElement("canvas"), { width: times * this.width, height: times * this.svg.clientHeight });
    canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
    canvas.toBlob((png) => give(png, `${this.data.name}.png`));
  }

  csv() {
    const { data } = this, quoted = (value) => `"${String(value).replaceAll('"', '""').replace(/^[=+\-@]/, "'$&")}"`;
    if (data.rows) {
      const named = ["row", "from", data.x, "low end", "high end", data.mark || "mark", data.band || "band"];
      const line = ({ name, start, end, interval, mark, band }) => [quoted(name), start, end, interval?.[0] ?? "", interval?.[1] ?? "", mark ?? "", band ?? ""];
      return [named.map(quoted), ...data.rows.map(line)].map((row) => row.join(",")).join("\n");
    }
    if (data.map) {
      const { map } = data, [low, high] = map.span, rows = [[data.x, data.y, map.unit].map(quoted)];
      for (let i = 0; i < this.levels.length; i++) {
        if (map.blank && !this.levels[i]) continue;
        const x = low + ((i % map.columns) + 0.5) / map.columns * (high - low);
        const y = this.ofShare((Math.floor(i / map.columns) + 0.5) / map.rows);
        rows.push([exact(x), exact(y), (map.low + this.levels[i] / 255 * (map.high - map.low)).toFixed(digits(map) + 1)]);
      }
      return rows.map((row) => row.join(",")).join("\n");
    }
    const rows = [["line", data.x, data.y].map(quoted).join(",")];
    for (const { name, x, y } of this.lines)
      for (let i = data.plane ? 0 : lowerBound(x, this.view[0]); i < x.length && (data.plane || x[i] <= this.view[1]); i++) rows.push(`${quoted(name)},${x[i]},${y[i]}`);
    return rows.join("\n");
  }
}

// ---------- small helpers

const element = (name, looks = {}) => set(document.createElementNS(NS, name), looks);
const add = (parent, name, looks) => parent.appendChild(element(name, looks));
const html = (name, kind = "") => Object.assign(document.createElement(name), { className: kind });
const range = (low, high) => Array.from({ length: high - low + 1 }, (_, i) => low + i);
// For one range, or a plane's two.
const same = (a, b) => a.length === b.length && a.every((value, i) => Math.abs(value - b[i]) <= 1e-9 * Math.abs(a[i | 1] - a[i & ~1]) + 1e-15);
// A number as written to files, and as displayed: with the minus sign of axes.
const exact = (value) => String(Number(value.toPrecision(6)));
const figure = (value) => withMinus(exact(value));
// A position on an axis with its unit, or as "order 2.5" on an axis of orders.
const measure = (value, unit) => (unit === "orders" ? `order ${figure(value)}` : `${figure(value)} ${unit}`);
// Number of decimals that distinguish a map's colours.
const digits = ({ low, high }) => Math.min(Math.max(Math.ceil(2 - Math.log10(high - low)), 1), 9);
// A number on a logarithmic axis; if some of them are far from one, all as powers of ten.
function short(value, powers) {
  const exponent = Math.round(Math.log10(value));
  if (!powers || Math.abs(Math.log10(value) - exponent) > 1e-9) return String(Number(value.toPrecision(2)));
  return `10${[...String(exponent)].map((digit) => SUPERSCRIPTS[digit]).join("")}`;
}

function set(made, looks) {
  for (const [name, value] of Object.entries(looks)) if (value !== null && value !== undefined) made.setAttribute(name, value);
  return made;
}

function text(parent, x, y, words, looks) {
  const made = add(parent, "text", { x, y, ...looks });
  made.textContent = words;
  return made;
}

// At most so many lines, the last cut if necessary.
function wrapped(words, n, mostLines) {
  if (words.length <= n || mostLines < 2) return [cut(words, n)];
  const at = words.lastIndexOf(" ", n), first = at > 0 ? at : Math.floor(n);
  return [words.slice(0, first), ...wrapped(words.slice(first).trim(), n, mostLines - 1)];
}

const cut = (words, n) => (words.length <= n ? words : `${words.slice(0, Math.max(Math.floor(n) - 1, 1))}…`);

function lowerBound(x, value) {
  let low = 0, high = x.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (x[middle] < value) low = middle + 1;
    else high = middle;
  }
  return low;
}

// At whole multiples of a round step, or of one of `steps` if the span allows.
function ticks(low, high, n, steps = null) {
  const rough = (high - low) / Math.max(n, 1), power = 10 ** Math.floor(Math.log10(rough));
  const round = power * [1, 2, 5, 10].find((times) => times * power >= rough * 0.999);
  const step = (steps && rough > steps[0] / 2 && steps.find((length) => length >= rough * 0.999)) || round;
  const first = Math.ceil(low / step - 1e-9), last = Math.floor(high / step + 1e-9);
  return range(first, Math.min(last, first + 50)).map((k) => k * step);
}

// Days since 1970, in steps of hours, days or weeks, which begin on Mondays; beyond that, starts of months or years.
function days(low, high, n) {
  const rough = (high - low) / Math.max(n, 1), step = [1 / 24, 1 / 4, 1, 2, 7, 14].find((length) => length >= rough);
  if (step) {
    const start = step < 7 ? 0 : 4; // 1970-01-05 was a Monday
    return range(Math.ceil((low - start) / step - 1e-9), Math.floor((high - start) / step + 1e-9)).map((k) => start + k * step);
  }
  const months = [1, 2, 3, 6, 12, 24, 60, 120, 240].find((count) => 30.5 * count >= rough) ?? 600;
  const monthOf = (day) => new Date(day * 864e5).getUTCFullYear() * 12 + new Date(day * 864e5).getUTCMonth();
  return range(Math.floor(monthOf(low) / months), Math.ceil((monthOf(high) + 1) / months)).map((k) => Date.UTC(2000, k * months - 24000) / 864e5).filter((day) => day >= low && day <= high);
}

function date(day) {
  const words = new Date(Math.round(day * 1440) * 60000).toISOString();
  return words.slice(11, 16) === "00:00" ? words.slice(0, 10) : `${words.slice(5, 10)} ${words.slice(11, 16)}`;
}

function decades(low, high) {
  const first = Math.ceil(Math.log10(low) - 1e-9), last = Math.floor(Math.log10(high) + 1e-9);
  const every = Math.max(1, Math.ceil((last - first + 1) / 9));
  const whole = range(first, last).filter((k) => (k - first) % every === 0).map((k) => 10 ** k);
  if (whole.length > 3) return whole;
  if (!whole.length) return ticks(low, high, 5).filter((value) => value > 0);
  return range(first - 1, last).flatMap((k) => [1, 2, 5].map((times) => times * 10 ** k)).filter((value) => value >= low * 0.999 && value <= high * 1.001);
}

function plain(value, low, high) {
  const span = Math.abs(high - low), digits = Math.min(Math.max(Math.ceil(1 - Math.log10(span)) + 1, 0), 9);
  const largest = Math.max(Math.abs(low), Math.abs(high));
  if (largest < 1e-3 || largest >= 1e6) return withMinus(Number(value.toPrecision(4)).toExponential().replace("e+0", ""));
  return withMinus(Number(value.toFixed(digits)));
}

function give(blob, name) {
  const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
