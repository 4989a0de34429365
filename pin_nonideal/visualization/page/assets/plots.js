// Plots on canvas: one axis each, a cursor at the current time, and readings at the pointer.

const DASHES = [[5, 3], [2, 2], [8, 3, 2, 3], [10, 4], [3, 5], [8, 2, 2, 2, 2, 2], [1, 3]]; // for the second and later runs, or the ninth and later curves

/** Returns a color and dash without a curve in the plot: solid colors first, then dashed colors. */
function freeLook(curves, colors) {
  const taken = new Set(curves.map((curve) => `${curve.color} ${curve.dash}`));
  for (const dash of [[], ...DASHES]) for (const color of colors) if (!taken.has(`${color} ${dash}`)) return { color, dash };
  return { color: colors[curves.length % colors.length], dash: [] };
}

/** Writes a text into an element, and shortens its middle if the element is too narrow. */
function fitText(box, text) {
  box.textContent = text;
  for (let kept = text.length - 1; kept > 3 && box.scrollWidth > box.clientWidth; kept--)
    box.textContent = `${text.slice(0, Math.ceil(kept / 2))}…${text.slice(text.length - Math.floor(kept / 2))}`;
}

/** Margin of an axis around curves that are flat; zero has an axis from -1 to 1. */
function flatMargin(low, high) { return low === 0 && high === 0 ? 1 : 0.5 * Math.max(Math.abs(high), 1e-3); }

/** CSS background of a dashed line, or of a solid line without dashes. */
function stroke(dash, color) {
  let at = 0;
  const stops = dash.map((length, i) => `${i % 2 ? "transparent" : color} ${at}px ${(at += length)}px`);
  return dash.length ? `repeating-linear-gradient(90deg, ${stops.join(", ")})` : color;
}

class Plot {
  /** The callbacks seek(t) and hover(t or null) report the pointer. */
  constructor(plot, span, parent, colors, seek, hover) {
    Object.assign(this, plot, { logarithmic: plot.log });
    this.colors = colors;
    const first = this.curves.filter((curve) => !curve.run), looks = [];
    this.curves.forEach((curve) => {
      curve.base = curve.run ? first.find((own) => own.label === curve.of) : null;
      // A plot of one curve distinguishes runs by colors, other plots by dashes.
      const apart = curve.base && first.length > 1 && first.length <= colors.length;
      const look = apart ? { color: curve.base.color, dash: DASHES[(curve.run - 1) % DASHES.length] } : freeLook(looks, colors);
      looks.push(look);
      Object.assign(curve, look, { shown: true, t: curve.t || plot.t, plain: curve.values });
    });
    this.makeBox(parent);
    for (const curve of this.curves) this.addToLegend(curve);
    this.background = document.createElement("canvas");
    this.listen(span, seek, hover);
  }

  listen(span, seek, hover) { this.axis = new TimeAxis(span, this.canvas, seek, (t) => hover(t)); }

  /** Words after the title. */
  about() { return `[${this.unit}]`; }

  makeBox(parent) {
    this.box = document.createElement("div");
    const heading = document.createElement("h2"), unit = document.createElement("span");
    this.box.className = "plot";
    heading.textContent = `${this.title} `;
    unit.textContent = `${this.about()}${this.note ? ` · ${this.note}` : ""}`;
    heading.append(unit);
    heading.title = heading.textContent;
    this.heading = heading;
    this.legend = document.createElement("ul");
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `${this.title} ${this.about()}`);
    const inner = this.box.appendChild(document.createElement("div"));
    inner.append(heading, this.canvas, this.legend);
    parent.append(this.box);
  }

  addToLegend(curve) {
    const item = document.createElement("li"), button = item.appendChild(document.createElement("button")), name = document.createElement("span");
    Object.assign(curve, { item, button, reading: document.createElement("b") });
    name.textContent = curve.label;
    curve.name = name;
    button.title = `${curve.label}: show or hide the curve`;
    button.setAttribute("aria-pressed", "true");
    button.append(name, " ", curve.reading);
    button.addEventListener("click", () => {
      curve.shown = !curve.shown;
      item.classList.toggle("off", !curve.shown);
      button.setAttribute("aria-pressed", String(curve.shown));
      this.resize();
    });
    this.legend.append(item);
  }

  /** Adds a curve with a color and dashes that no other curve has. */
  add(curve) {
    Object.assign(curve, freeLook(this.curves, this.colors), { base: null, shown: true, plain: curve.values });
    this.curves.push(curve);
    this.addToLegend(curve);
    return curve;
  }

  remove(curve) {
    this.curves.splice(this.curves.indexOf(curve), 1);
    curve.item.remove();
  }

  /** Shows curves of other runs as differences from the first run, which is then hidden, or unchanged. */
  showDifferences(on) {
    if (!this.curves.some((curve) => curve.base)) return;
    for (const curve of this.curves) {
      curve.shown = !on || Boolean(curve.base);
      if (curve.base) curve.values = on ? curve.plain.map((value, i) => value - this.value(curve.base, curve.t[i])) : curve.plain;
    }
    this.log = on ? false : this.logarithmic;
    this.resize();
  }

  /** Height of a value on the axis, between 0 and 1. */
  rise(value) {
    const y = this.log ? Math.log10(Math.max(value, this.floor)) : value;
    return (y - this.low) / (this.high - this.low);
  }

  y(value) { return this.bottom - this.rise(value) * (this.bottom - this.top); }

  scale() {
    let low = Infinity, high = -Infinity;
    for (const curve of this.curves.filter((c) => c.shown))
      for (const value of curve.values) if (Number.isFinite(value) && (!this.log || value > 0)) { low = Math.min(low, value); high = Math.max(high, value); }
    if (this.log) {
      // Rounding has no meaningful lower end; zero is drawn at the bottom.
      high = Number.isFinite(high) ? Math.ceil(Math.log10(high) + 0.1) : -12;
      low = Number.isFinite(low) ? Math.max(Math.floor(Math.log10(low) - 0.1), high - 12) : high - 4;
      this.floor = 10 ** low;
      return Object.assign(this, { low, high: Math.max(high, low + 2) });
    }
    if (!(high >= low)) [low, high] = [0, 1];
    // A range at the level of rounding is shown as flat.
    const least = Math.max(1e-9 * Math.max(Math.abs(low), Math.abs(high)), 1e-12);
    const margin = high - low > least ? 0.07 * (high - low) : flatMargin(low, high);
    return Object.assign(this, { low: low - margin, high: high + margin });
  }

  resize() {
    if (!this.canvas.clientWidth) return;
    for (const { name, label } of this.curves) fitText(name, label);
    this.scale();
    for (const curve of this.curves) {
      curve.button.style.setProperty("--swatch", onPaper(curve.color));
      curve.button.style.setProperty("--stroke", stroke(curve.dash, "var(--swatch)"));
    }
    const { context: c, width, height } = fitCanvas(this.canvas), { axis } = this;
    Object.assign(this, { context: c, width, height, top: 6, bottom: height - 18 });
    Object.assign(axis, { left: 52, right: width - 8 });
    c.clearRect(0, 0, width, height);
    c.lineWidth = 1;
    this.drawAxes(c);
    c.save();
    c.beginPath(); c.rect(axis.left, this.top - 2, axis.right - axis.left, this.bottom - this.top + 4); c.clip();
    c.lineWidth = 1.6; c.lineJoin = "round";
    for (const curve of this.curves.filter((item) => item.shown)) this.drawCurve(c, curve);
    c.restore();
    this.background.width = this.canvas.width; this.background.height = this.canvas.height;
    this.background.getContext("2d").drawImage(this.canvas, 0, 0);
    if (this.drawn) this.draw(...this.drawn);
  }

  drawCurve(c, curve) {
    const { t, values } = curve, { start, end } = this.axis.span;
    const first = Math.max(lastBelow(t, start) - 1, 0), last = Math.min(lastBelow(t, end) + 2, t.length - 1);
    c.strokeStyle = onPaper(curve.color); c.setLineDash(curve.dash || []);
    c.globalAlpha = this.crowded(values, first, last) ? 0.55 : 1; // a dense curve is transparent
    c.beginPath();
    for (let i = first; i <= last; i++) if (Number.isFinite(values[i])) c.lineTo(this.axis.x(t[i]), this.y(values[i]));
    c.stroke(); c.setLineDash([]); c.globalAlpha = 1;
    if (t.length === 1) { c.fillStyle = onPaper(curve.color); c.fillRect(this.axis.left - 3, this.y(values[0]) - 3, 6, 6); }
  }

  /** Checks if a curve changes direction more often than every third pixel. */
  crowded(values, first, last) {
    let turns = 0;
    for (let i = first + 1; i < last; i++) {
      const rise = this.rise(values[i + 1]) - this.rise(values[i]);
      if (Math.abs(rise) > 0.02 && (values[i] - values[i - 1]) * rise < 0) turns++;
    }
    return turns > (this.axis.right - this.axis.left) / 3;
  }

  drawAxes(c) {
    const rows = this.log ? decades(this.low, this.high) : roundSteps(this.low, this.high, 4), { left, right } = this.axis;
    for (const step of rows.steps) {
      const y = Math.round(this.bottom - ((step - this.low) / (this.high - this.low)) * (this.bottom - this.top)) + 0.5;
      c.strokeStyle = !this.log && step === 0 ? ink("zero") : ink("grid");
      c.beginPath(); c.moveTo(left, y); c.lineTo(right, y); c.stroke();
      c.fillStyle = ink("soft"); c.textBaseline = "middle"; c.textAlign = "right";
      c.fillText(this.log ? `1e${step}` : stepLabel(step, rows.step), left - 6, y);
    }
    this.axis.draw(c, this.bottom + 5, this.width, [this.top, this.bottom]);
  }

  /** Value of a curve at a time, between the samples. */
  value(curve, time) {
    const { k, next, part } = bracket(curve.t, time);
    return part === 0 ? curve.values[k] : (1 - part) * curve.values[k] + part * curve.values[next];
  }

  /** Draws the cursor at the current time; readings are at the pointer's time if there is one. */
  draw(time, hover) {
    this.drawn = [time, hover];
    const { context: c, axis } = this, read = hover === null ? time : hover;
    for (const curve of this.curves) curve.reading.textContent = steady(this.value(curve, read));
    if (!c || !this.canvas.clientWidth) return;
    c.save(); c.setTransform(1, 0, 0, 1, 0, 0);
    c.clearRect(0, 0, this.canvas.width, this.canvas.height);
    c.drawImage(this.background, 0, 0);
    c.restore();
    const inside = (t) => t >= axis.span.start && t <= axis.span.end;
    const line = (t, color, dash) => {
      if (!inside(t)) return;
      c.strokeStyle = color; c.lineWidth = 1; c.setLineDash(dash);
      const x = Math.round(axis.x(t)) + 0.5;
      c.beginPath(); c.moveTo(x, this.top - 4); c.lineTo(x, this.bottom); c.stroke(); c.setLineDash([]);
    };
    if (hover !== null) line(hover, ink("faint"), [3, 3]);
    line(time, ink("accent"), []);
    for (const curve of this.curves) {
      const value = this.value(curve, read);
      if (!curve.shown || !Number.isFinite(value) || !inside(read)) continue;
      c.fillStyle = onPaper(curve.color); c.strokeStyle = ink("paper"); c.lineWidth = 1.5;
      c.beginPath(); c.arc(axis.x(read), this.y(value), 3.4, 0, 2 * Math.PI); c.fill(); c.stroke();
    }
  }
}
