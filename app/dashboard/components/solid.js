// A solid of flat quadrilaterals, rotated by dragging, coloured by a value at its corners, and animated in a mode.

const LIGHT = [-0.3, -0.6, 0.74]; // from the upper left, towards the eye; y points down

export default function ({ data, parentElement }) {
  const root = parentElement.querySelector(".solid");
  (root.solid ??= new Solid(root)).update(data);
  return () => (root.solid.swinging = false);
}

class Solid {
  constructor(root) {
    this.root = root;
    this.canvas = Object.assign(document.createElement("canvas"), { tabIndex: 0 });
    this.canvas.setAttribute("role", "img");
    this.button = Object.assign(document.createElement("button"), { type: "button", onclick: () => this.swing(!this.swinging) });
    const bar = document.createElement("div");
    [this.low, this.scale, this.high, this.words] = ["span", "i", "span", "small"].map((kind) => document.createElement(kind));
    bar.append(this.button, this.low, this.scale, this.high, this.words);
    root.append(this.canvas, bar);
    Object.assign(this, { yaw: -1.1, pitch: 0.9, zoom: 1, at: [0, 0], phase: Math.PI / 2 });
    this.canvas.addEventListener("pointerdown", (event) => this.canvas.setPointerCapture(event.pointerId));
    this.canvas.addEventListener("pointermove", (event) => event.buttons && this.turn(event.movementX / 150, event.movementY / 150));
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.magnify(Math.exp(-event.deltaY / 600), [event.offsetX - this.canvas.clientWidth / 2, event.offsetY - this.canvas.clientHeight / 2]);
    }, { passive: false });
    this.canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
      const grows = { "+": 1.25, "=": 1.25, "-": 0.8 }[event.key];
      if (step) { event.preventDefault(); this.turn(...step); }
      if (grows) { event.preventDefault(); this.magnify(grows, [0, 0]); }
    });
    new ResizeObserver(() => this.data && this.draw()).observe(root);
  }

  update(data) {
    this.data = data;
    this.points = numbers(data.points);
    this.quads = numbers(data.quads);
    this.motion = numbers(data.motion);
    this.values = numbers(data.values);
    this.size = 0;
    for (let i = 0; i < this.points.length; i += 3) this.size = Math.max(this.size, Math.hypot(this.points[i], this.points[i + 1]));
    this.canvas.setAttribute("aria-label", data.words);
    [this.low.textContent, this.high.textContent] = data.legend;
    this.scale.style.background = `linear-gradient(to right, ${data.colours.map((colour) => `rgb(${colour})`)})`;
    this.words.textContent = data.help;
    this.swing(data.swings);
  }

  turn(across, up) {
    this.yaw += across;
    this.pitch = Math.min(Math.max(this.pitch + up, 0), Math.PI);
    this.draw();
  }

  // What lies at `from`, in pixels from the middle, stays there.
  magnify(factor, from) {
    const zoom = Math.min(Math.max(this.zoom * factor, 0.5), 20), grows = zoom / this.zoom;
    this.at = this.at.map((place, axis) => (zoom > 1 ? from[axis] - grows * (from[axis] - place) : 0));
    this.zoom = zoom;
    this.draw();
  }

  swing(on) {
    this.swinging = on;
    this.button.style.display = this.data.swings ? "" : "none";
    if (!on) { this.phase = Math.PI / 2; this.draw(); return; }
    if (this.running) return;
    this.running = true;
    const frame = () => {
      if (!this.swinging || !this.root.isConnected) { this.running = false; return; }
      this.phase = performance.now() / 250;
      this.draw();
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  draw() {
    const { clientWidth: width, clientHeight: height } = this.canvas, dense = devicePixelRatio || 1;
    if (!width) return;
    this.canvas.width = width * dense;
    this.canvas.height = height * dense;
    const context = this.canvas.getContext("2d");
    context.setTransform(dense, 0, 0, dense, width * dense / 2, height * dense / 2);
    this.button.textContent = this.swinging ? "Stop" : "Animate";
    const { points, quads, motion, values } = this, n = points.length / 3;
    const scale = (0.46 * Math.min(width, height) * this.zoom) / this.size, share = this.data.stretch * Math.sin(this.phase);
    const [cy, sy, cp, sp] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
    // Screen: x to the right, y down, depth towards the eye; z of the gear is up where the pitch is 0.
    const x = new Float32Array(n), y = new Float32Array(n), depth = new Float32Array(n);
    for (let i = 0; i < n; i++) {
      const px = points[3 * i] + share * motion[3 * i], py = points[3 * i + 1] + share * motion[3 * i + 1], pz = points[3 * i + 2] + share * motion[3 * i + 2];
      const across = cy * px - sy * py, along = sy * px + cy * py;
      x[i] = this.at[0] + scale * across;
      y[i] = this.at[1] - scale * (sp * along + cp * pz);
      depth[i] = sp * pz - cp * along;
    }
    // From back to front; faces that point away are hidden by others of a closed solid.
    const seen = [];
    for (let q = 0; q < quads.length; q += 4) {
      const [a, b, c, d] = [quads[q], quads[q + 1], quads[q + 2], quads[q + 3]];
      const turned = (x[c] - x[a]) * (y[d] - y[b]) - (y[c] - y[a]) * (x[d] - x[b]);
      if (turned < 0) seen.push([depth[a] + depth[b] + depth[c] + depth[d], q]);
    }
    seen.sort((one, two) => one[0] - two[0]);
    context.lineWidth = 0.6;
    for (const [, q] of seen) {
      const corners = [quads[q], quads[q + 1], quads[q + 2], quads[q + 3]];
      const [a, b, c, d] = corners;
      const u = [x[c] - x[a], y[c] - y[a], scale * (depth[c] - depth[a])], v = [x[d] - x[b], y[d] - y[b], scale * (depth[d] - depth[b])];
      const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
      const long = Math.hypot(...normal) || 1;
      const towards = (normal[2] < 0 ? -1 : 1) / long;
      const light = 0.5 + 0.5 * Math.max(0, towards * (LIGHT[0] * normal[0] + LIGHT[1] * normal[1] + LIGHT[2] * normal[2]));
      const colour = this.colour((values[a] + values[b] + values[c] + values[d]) / 4, light);
      context.fillStyle = context.strokeStyle = colour;
      context.beginPath();
      for (const i of corners) context.lineTo(x[i], y[i]);
      context.closePath();
      context.fill();
      context.stroke();
    }
  }

  colour(value, light) {
    const steps = this.data.colours, at = Math.min(Math.max(value, 0), 1) * (steps.length - 1), i = Math.min(Math.floor(at), steps.length - 2), t = at - i;
    const part = (k) => Math.round(light * (steps[i][k] + t * (steps[i + 1][k] - steps[i][k])));
    return `rgb(${part(0)},${part(1)},${part(2)})`;
  }
}
