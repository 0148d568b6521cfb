// A gear pair that turns in step with a cursor in its signal: play, or drag the cursor.

const MODULE = 22, RIM = 5 * MODULE, CYCLES_PER_S = 2.5, PRESSURE = (20 * Math.PI) / 180;
const HALF = 0.24; // of a pitch: half of a tooth's thickness at the pitch circle, the rest is backlash
const APPROACH = 0.8; // mesh cycles from a tooth's entry to its middle on the line of centres, at a contact ratio of 1.6

export default function ({ data, parentElement }) {
  const root = parentElement.querySelector(".gears");
  (root.gears ??= new Gears(root)).update(data);
  return () => root.gears.stop();
}

class Gears {
  constructor(root) {
    this.root = root;
    this.at = null;
    this.wheels = Object.assign(document.createElement("canvas"), { className: "wheels" });
    this.signal = Object.assign(document.createElement("canvas"), { className: "signal", tabIndex: 0 });
    this.signal.setAttribute("role", "slider");
    this.signal.setAttribute("aria-label", "Cursor in the signal, in mesh cycles");
    this.button = Object.assign(document.createElement("button"), { type: "button", onclick: () => (this.playing ? this.stop() : this.play()) });
    this.words = document.createElement("span");
    const bar = document.createElement("div");
    bar.append(this.button, this.words);
    root.append(this.wheels, bar, this.signal);
    this.signal.addEventListener("pointerdown", (event) => {
      this.stop();
      this.signal.setPointerCapture(event.pointerId);
      this.grab(event);
    });
    this.signal.addEventListener("pointermove", (event) => event.buttons && this.grab(event));
    this.signal.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -0.1, ArrowRight: 0.1 }[event.key];
      if (step) this.go(this.at + step);
    });
    new ResizeObserver(() => this.data && this.draw()).observe(root);
  }

  update(data) {
    this.data = data;
    this.lines = data.lines.map((line) => ({ ...line, x: numbers(line.x), y: numbers(line.y), force: numbers(line.force) }));
    this.shapes = data.teeth.map(shape);
    const x = this.lines[0].x;
    this.range = [x[0], x[x.length - 1]];
    if (this.at === null || this.at < this.range[0] || this.at > this.range[1]) this.at = data.start;
    this.stop();
  }

  play() {
    this.playing = true;
    let last = performance.now();
    const frame = (now) => {
      if (!this.playing || !this.root.isConnected) return;
      const [low, high] = this.range, next = this.at + ((now - last) / 1000) * CYCLES_PER_S;
      last = now;
      this.go(next > high ? low : next);
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  stop() {
    this.playing = false;
    if (this.data) this.draw();
  }

  grab(event) {
    const width = this.signal.clientWidth, [low, high] = this.range;
    this.go(low + (event.offsetX / width) * (high - low));
  }

  go(at) {
    this.at = Math.min(Math.max(at, this.range[0]), this.range[1]);
    this.draw();
  }

  draw() {
    const style = getComputedStyle(this.root);
    this.ink = style.color;
    this.paper = style.getPropertyValue("--st-background-color");
    this.button.textContent = this.playing ? "Stop" : "Rotate";
    this.signal.setAttribute("aria-valuenow", this.at.toFixed(2));
    const parts = [`mesh cycle ${this.at.toFixed(2)}`, `tooth ${(((Math.floor(this.at) % this.data.teeth[0]) + this.data.teeth[0]) % this.data.teeth[0]) + 1} of the driver enters`];
    for (const line of this.lines) parts.push(`${line.name}: ${(value(line, line.force, this.at) / 1000).toFixed(2)} kN`);
    this.words.textContent = parts.join(" · ");
    this.drawWheels();
    this.drawSignal();
  }

  drawWheels() {
    const [context, width, height] = ready(this.wheels), { teeth, cracked, colours } = this.data;
    const radii = teeth.map((n) => (n * MODULE) / 2), turned = this.at - APPROACH;
    context.save();
    // the driver is above the driven gear: the mesh lies along the width
    context.translate(width / 2, height / 2);
    context.rotate(Math.PI / 2);
    wheel(context, -radii[0], this.shapes[0], 0, -turned, cracked.driver, colours, this.ink);
    // the driving flanks touch: the driven tooth is a thickness ahead
    wheel(context, radii[1], this.shapes[1], Math.PI, turned + 2 * HALF, -cracked.driven, colours, this.ink);
    // the force of the line in front, along the line of action
    const line = this.lines[this.lines.length - 1], force = value(line, line.force, this.at);
    context.rotate(PRESSURE - Math.PI / 2);
    context.strokeStyle = context.fillStyle = line.colour;
    context.lineWidth = 4;
    arrow(context, (110 * force) / this.data.force);
    context.restore();
    this.write(context, `driver, ${teeth[0]} teeth`, 10, 18);
    this.write(context, `driven, ${teeth[1]} teeth`, 10, 0.64 * height);
  }

  // Text over a drawing, with an outline in the background colour around the letters.
  write(context, words, x, y) {
    context.font = `13px ${getComputedStyle(this.root).fontFamily}`;
    context.lineJoin = "round";
    context.lineWidth = 4;
    context.strokeStyle = this.paper;
    context.strokeText(words, x, y);
    context.fillStyle = this.ink;
    context.fillText(words, x, y);
  }

  drawSignal() {
    const [context, width, height] = ready(this.signal), [low, high] = this.range;
    const largest = Math.max(...this.lines.flatMap(({ y }) => [Math.max(...y), -Math.min(...y)])) || 1;
    const across = (x) => ((x - low) / (high - low)) * width, up = (y) => height / 2 - (0.46 * height * y) / largest;
    for (const { x, y, colour } of this.lines) {
      context.strokeStyle = colour;
      context.lineWidth = 1.2;
      context.beginPath();
      for (let i = 0; i < x.length; i++) context.lineTo(across(x[i]), up(y[i]));
      context.stroke();
    }
    this.write(context, this.data.label, 4, 13);
    context.fillRect(across(this.at) - 1, 0, 2, height);
  }
}

function arrow(context, length) {
  context.beginPath();
  context.moveTo(0, 0);
  context.lineTo(length, 0);
  context.stroke();
  context.beginPath();
  for (const [back, aside] of [[12, -7], [0, 0], [12, 7]]) context.lineTo(length + 4 - Math.sign(length) * back, aside);
  context.fill();
}

const involute = (radius, base) => Math.sqrt((radius / base) ** 2 - 1) - Math.acos(base / radius);

// The outlines of a gear's involute teeth near the mesh, of one tooth, and of a crack in its root, about the x axis.
function shape(n) {
  const step = (2 * Math.PI) / n, radius = (n * MODULE) / 2, root = radius - 1.25 * MODULE, base = radius * Math.cos(PRESSURE);
  const radii = [...Array(9).keys()].map((i) => root + (i / 8) * 2.25 * MODULE);
  const flank = radii.map((r) => [r, HALF * step + involute(radius, base) - involute(Math.max(r, base), base)]);
  const tooth = [...flank.map(([r, angle]) => [r, -angle]), ...flank.reverse()];
  const beside = Math.ceil(0.2 * n), end = (beside + 0.5) * step;
  const outline = [...Array(2 * beside + 1).keys()].flatMap((k) => tooth.map(([r, angle]) => [r, angle + (k - beside) * step]));
  const body = path(outline);
  body.arc(0, 0, root - RIM, end, -end, true);
  const crack = [[root + 3, -0.33], [root - 3, -0.16], [root - 2, -0.05], [root - 7, 0.1]];
  return { step, outline: path(outline), body, tooth: path(tooth), crack: path(crack.map(([r, share]) => [r, share * step])) };
}

function path(points) {
  const result = new Path2D();
  for (const [r, angle] of points) result.lineTo(r * Math.cos(angle), r * Math.sin(angle));
  return result;
}

// One gear, of which only the teeth near the mesh are seen. It is turned by a number of teeth from where its first one is in
// mesh at the angle `facing`; the number of the cracked tooth is negative where teeth are counted the other way round.
function wheel(context, x, { step, outline, body, tooth, crack }, facing, turned, cracked, colours, ink) {
  context.save();
  context.translate(x, 0);
  context.rotate(facing + (turned % 1) * step);
  context.lineWidth = 1;
  paint(context, body, outline, colours.measured, 0.25);
  if (cracked) {
    context.rotate((Math.trunc(turned) + cracked - Math.sign(cracked)) * step);
    paint(context, tooth, tooth, colours.fault, 0.75);
    context.strokeStyle = ink;
    context.lineWidth = 2.5;
    context.stroke(crack);
  }
  context.restore();
}

function paint(context, body, outline, colour, opacity) {
  context.fillStyle = context.strokeStyle = colour;
  context.globalAlpha = opacity;
  context.fill(body);
  context.globalAlpha = 1;
  context.stroke(outline);
}

function ready(canvas) {
  const { clientWidth: width, clientHeight: height } = canvas, dense = devicePixelRatio || 1;
  canvas.width = width * dense;
  canvas.height = height * dense;
  const context = canvas.getContext("2d");
  context.scale(dense, dense);
  return [context, width, height];
}

function value({ x }, y, at) {
  let low = 0, high = x.length - 1;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (x[middle] < at) low = middle + 1;
    else high = middle;
  }
  return y[low];
}
