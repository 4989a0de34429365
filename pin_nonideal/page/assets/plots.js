// Plots on canvas: one axis each, a cursor at the shown time, a reading at the pointer.

const CURVE_COLORS = ["#ea580c", "#2563eb", "#1e293b", "#059669", "#db2777", "#7c3aed", "#0891b2", "#ca8a04"];

/** Round steps that divide a range into about `count` parts. */
function roundSteps(low, high, count) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw)), lead = raw / power;
  const step = (lead < 1.5 ? 1 : lead < 3.5 ? 2 : lead < 7.5 ? 5 : 10) * power, steps = [];
  for (let x = Math.ceil(low / step - 1e-9) * step; x <= high + 1e-9 * step; x += step) steps.push(Math.abs(x) < 1e-9 * step ? 0 : x);
  return { step, steps };
}

function stepLabel(x, step) {
  const size = Math.max(Math.abs(x), step);
  if (x !== 0 && (size >= 1e5 || size < 1e-3)) return x.toExponential(Math.max(0, Math.floor(Math.log10(Math.abs(x)) + 1e-9) - Math.floor(Math.log10(step) + 1e-9)));
  return x.toFixed(Math.max(0, Math.min(6, -Math.floor(Math.log10(step) + 1e-9))));
}

/** A canvas in device pixels, with its context scaled to CSS pixels. */
function fitCanvas(canvas) {
  const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio);
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.font = `11px ${getComputedStyle(document.documentElement).fontFamily}`;
  return { context, width, height };
}

/** Calls seek(x) with the pointer's place while it is pressed, hover(x) while it is over, hover(null) when it leaves. */
function trackPointer(canvas, seek, hover) {
  canvas.addEventListener("pointerdown", (e) => { canvas.setPointerCapture(e.pointerId); seek(e.offsetX); });
  canvas.addEventListener("pointermove", (e) => { hover(e.offsetX, e); if (e.buttons & 1) seek(e.offsetX); });
  canvas.addEventListener("pointerleave", () => hover(null));
}

class Plot {
  /** seek(t) and hover(t or null) tell the page what the pointer does. */
  constructor(plot, range, parent, seek, hover) {
    Object.assign(this, plot, { range });
    this.curves.forEach((curve, i) => Object.assign(curve, { color: CURVE_COLORS[i % CURVE_COLORS.length], shown: true }));
    const box = document.createElement("div"), heading = document.createElement("h2"), unit = document.createElement("span");
    box.className = "plot";
    heading.textContent = `${this.title} `;
    unit.textContent = `[${this.unit}]`;
    heading.append(unit);
    this.legend = document.createElement("ul");
    this.canvas = document.createElement("canvas");
    box.append(heading, this.legend, this.canvas);
    parent.append(box);
    for (const curve of this.curves) {
      const item = document.createElement("li");
      item.style.setProperty("--swatch", curve.color);
      item.title = "show or hide";
      curve.reading = document.createElement("b");
      item.append(`${curve.label} `, curve.reading);
      item.addEventListener("click", () => { curve.shown = !curve.shown; item.classList.toggle("off", !curve.shown); this.resize(); });
      this.legend.append(item);
    }
    this.background = document.createElement("canvas");
    const time = (x) => this.range[0] + ((x - this.left) / (this.right - this.left)) * (this.range[1] - this.range[0]);
    const within = (t) => Math.max(this.range[0], Math.min(this.range[1], t));
    trackPointer(this.canvas, (x) => seek(within(time(x))), (x) => hover(x === null ? null : within(time(x))));
  }

  /** Height of a value on the axis, between 0 and 1. */
  rise(value) {
    const y = this.log ? Math.log10(Math.max(value, this.floor)) : value;
    return (y - this.low) / (this.high - this.low);
  }

  x(t) {
    const [start, end] = this.range;
    return this.left + (end > start ? (t - start) / (end - start) : 0) * (this.right - this.left);
  }

  y(value) { return this.bottom - this.rise(value) * (this.bottom - this.top); }

  scale() {
    let low = Infinity, high = -Infinity;
    for (const curve of this.curves.filter((c) => c.shown))
      for (const value of curve.values) if (Number.isFinite(value) && (!this.log || value > 0)) { low = Math.min(low, value); high = Math.max(high, value); }
    if (this.log) {
      // Rounding has no lower end worth showing; zero is drawn at the bottom.
      high = Number.isFinite(high) ? Math.ceil(Math.log10(high) + 0.1) : -12;
      low = Number.isFinite(low) ? Math.max(Math.floor(Math.log10(low) - 0.1), high - 12) : high - 4;
      this.floor = 10 ** low;
      return Object.assign(this, { low, high: Math.max(high, low + 2) });
    }
    if (!(high >= low)) [low, high] = [0, 1];
    // A range at the level of rounding is shown as flat.
    const least = Math.max(1e-9 * Math.max(Math.abs(low), Math.abs(high)), 1e-12);
    const margin = high - low > least ? 0.07 * (high - low) : 0.5 * Math.max(Math.abs(high), 1e-3);
    return Object.assign(this, { low: low - margin, high: high + margin });
  }

  resize() {
    if (!this.canvas.clientWidth) return;
    this.scale();
    const { context: c, width, height } = fitCanvas(this.canvas);
    Object.assign(this, { context: c, width, height, left: 52, right: width - 8, top: 6, bottom: height - 18 });
    c.clearRect(0, 0, width, height);
    c.lineWidth = 1;
    this.drawAxes(c);
    c.save();
    c.beginPath(); c.rect(this.left, this.top - 2, this.right - this.left, this.bottom - this.top + 4); c.clip();
    c.lineWidth = 1.6; c.lineJoin = "round";
    for (const curve of this.curves.filter((item) => item.shown)) {
      c.strokeStyle = curve.color;
      c.beginPath();
      curve.values.forEach((value, i) => { if (Number.isFinite(value)) c.lineTo(this.x(this.t[i]), this.y(value)); });
      c.stroke();
      if (this.t.length === 1) { c.fillStyle = curve.color; c.fillRect(this.left - 3, this.y(curve.values[0]) - 3, 6, 6); }
    }
    c.restore();
    this.background.width = this.canvas.width; this.background.height = this.canvas.height;
    this.background.getContext("2d").drawImage(this.canvas, 0, 0);
    if (this.shown) this.draw(...this.shown);
  }

  drawAxes(c) {
    c.fillStyle = "#64748b"; c.textBaseline = "middle"; c.textAlign = "right";
    const rows = this.log ? decades(this.low, this.high) : roundSteps(this.low, this.high, 4);
    for (const step of rows.steps) {
      const y = Math.round(this.bottom - ((step - this.low) / (this.high - this.low)) * (this.bottom - this.top)) + 0.5;
      c.strokeStyle = !this.log && step === 0 ? "#cbd5e1" : "#eef2f6";
      c.beginPath(); c.moveTo(this.left, y); c.lineTo(this.right, y); c.stroke();
      c.fillText(this.log ? `1e${step}` : stepLabel(step, rows.step), this.left - 6, y);
    }
    c.textBaseline = "top"; c.textAlign = "center";
    const [start, end] = this.range, columns = end > start ? roundSteps(start, end, Math.max(2, Math.min(8, this.width / 70))) : { steps: [start], step: 1 };
    for (const step of columns.steps) {
      const x = Math.round(this.x(step)) + 0.5;
      c.strokeStyle = "#eef2f6";
      c.beginPath(); c.moveTo(x, this.top); c.lineTo(x, this.bottom); c.stroke();
      const label = stepLabel(step, columns.step), half = c.measureText(label).width / 2;
      c.fillText(label, Math.min(x, this.width - half), this.bottom + 5);
    }
  }

  /** Value of a curve at a time, between the samples. */
  at(curve, time) {
    const { k, next, part } = bracket(this.t, time);
    return part === 0 ? curve.values[k] : (1 - part) * curve.values[k] + part * curve.values[next];
  }

  /** Cursor at the shown time; the readings belong to the pointer's time when there is one. */
  draw(time, hover) {
    this.shown = [time, hover];
    const c = this.context;
    if (!c || !this.canvas.clientWidth) return;
    c.save(); c.setTransform(1, 0, 0, 1, 0, 0);
    c.clearRect(0, 0, this.canvas.width, this.canvas.height);
    c.drawImage(this.background, 0, 0);
    c.restore();
    const line = (t, color, dash) => {
      c.strokeStyle = color; c.lineWidth = 1; c.setLineDash(dash);
      const x = Math.round(this.x(t)) + 0.5;
      c.beginPath(); c.moveTo(x, this.top - 4); c.lineTo(x, this.bottom); c.stroke(); c.setLineDash([]);
    };
    if (hover !== null) line(hover, "#94a3b8", [3, 3]);
    line(time, "#2563eb", []);
    const read = hover === null ? time : hover;
    for (const curve of this.curves) {
      const value = this.at(curve, read);
      curve.reading.textContent = steady(value);
      if (!curve.shown || !Number.isFinite(value)) continue;
      c.fillStyle = curve.color; c.strokeStyle = "#fff"; c.lineWidth = 1.5;
      c.beginPath(); c.arc(this.x(read), this.y(value), 3.4, 0, 2 * Math.PI); c.fill(); c.stroke();
    }
  }
}

/** Powers of ten between two exponents, at most five of them. */
function decades(low, high) {
  const step = Math.max(1, Math.ceil((high - low) / 5)), steps = [];
  for (let x = Math.ceil(low); x <= high; x += step) steps.push(x);
  return { step, steps };
}
