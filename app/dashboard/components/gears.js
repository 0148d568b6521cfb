// A gear pair that turns in step with a cursor in its signal: play, or drag the cursor.

const MODULE = 22, RIM = 5 * MODULE, CYCLES_PER_S = 2.5;
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
    wheel(context, -radii[0], radii[0], teeth[0], (k) => ((turned - k) * 2 * Math.PI) / teeth[0], cracked.driver, colours, this.ink);
    wheel(context, radii[1], radii[1], teeth[1], (k) => Math.PI - ((turned - k - 0.5) * 2 * Math.PI) / teeth[1], cracked.driven, colours, this.ink);
    // the force of the line in front, along the line of action
    const line = this.lines[this.lines.length - 1], force = value(line, line.force, this.at);
    const length = (110 * force) / this.data.force, angle = ((90 - 20) * Math.PI) / 180;
    const tip = [length * Math.cos(angle), -length * Math.sin(angle)];
    context.strokeStyle = context.fillStyle = line.colour;
    context.lineWidth = 4;
    context.beginPath();
    context.moveTo(0, 0);
    context.lineTo(...tip);
    context.stroke();
    context.beginPath();
    context.arc(...tip, 6, 0, 2 * Math.PI);
    context.fill();
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

// One gear, of which only the teeth near the mesh are seen; the cracked tooth is in the colour of faults.
function wheel(context, x, radius, n, angleOf, cracked, colours, ink) {
  const step = (2 * Math.PI) / n, root = radius - 1.25 * MODULE, tip = radius + MODULE;
  const profile = [[root, -0.5], [root, -0.33], [radius - 0.4 * MODULE, -0.28], [radius, -0.24], [tip, -0.13], [tip, 0.13], [radius, 0.24], [radius - 0.4 * MODULE, 0.28], [root, 0.33], [root, 0.5]];
  context.save();
  context.translate(x, 0);
  for (let k = 0; k < n; k++) {
    const middle = angleOf(k), isCracked = k + 1 === cracked;
    context.beginPath();
    for (const [r, share] of profile) context.lineTo(r * Math.cos(middle + share * step), -r * Math.sin(middle + share * step));
    const inner = root - RIM;
    context.lineTo(inner * Math.cos(middle + step / 2), -inner * Math.sin(middle + step / 2));
    context.lineTo(inner * Math.cos(middle - step / 2), -inner * Math.sin(middle - step / 2));
    context.closePath();
    context.fillStyle = isCracked ? colours.fault : colours.measured;
    context.globalAlpha = isCracked ? 0.75 : 0.25;
    context.fill();
    context.globalAlpha = 1;
    context.strokeStyle = isCracked ? colours.fault : colours.measured;
    context.lineWidth = 1;
    context.stroke();
    if (isCracked) {
      context.strokeStyle = ink;
      context.lineWidth = 2.5;
      context.beginPath();
      for (const [r, share] of [[root + 3, 0.33], [root - 3, 0.16], [root - 2, 0.05], [root - 7, -0.1]]) context.lineTo(r * Math.cos(middle + share * step), -r * Math.sin(middle + share * step));
      context.stroke();
    }
  }
  context.restore();
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
