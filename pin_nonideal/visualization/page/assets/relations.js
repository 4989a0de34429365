// Plots of one quantity over another: a ball marks the state of the run, and small dots mark the limits of the law.

class Relation extends Plot {
  constructor(relation, parent, colors, seek) {
    const curves = relation.curves.map((curve) => ({ ...curve, values: curve.y }));
    const { x: over, y: unit, ...rest } = relation; // y() is the height on the canvas
    super({ ...rest, over, unit, curves, log: false, t: curves.length ? curves[0].t : [] }, null, parent, colors, seek, () => {});
  }

  /** A click seeks the time of the nearest point. */
  listen(span, seek) {
    this.axis = { left: 52, right: 0 };
    this.canvas.addEventListener("pointerdown", (event) => {
      let best = Infinity, time = null;
      for (const { shown, t, x, y } of this.curves) {
        if (!shown) continue;
        for (let i = 0; i < t.length; i++) {
          const away = Math.hypot(this.across(x[i]) - event.offsetX, this.y(y[i]) - event.offsetY);
          if (away < best) { best = away; time = t[i]; }
        }
      }
      if (time !== null) seek(time);
    });
  }

  about() { return `${this.unit} over ${this.over}${this.bounds.length ? ", dots: the limit" : ""}`; }

  /** The title names a single curve. */
  addToLegend(curve) {
    super.addToLegend(curve);
    if (this.curves.length === 1) this.legend.hidden = true;
  }

  showDifferences() {} // only the first run has relations

  across(value) { return this.axis.left + ((value - this.from) / (this.to - this.from)) * (this.axis.right - this.axis.left); }

  scale() {
    const range = (parts) => {
      let low = Infinity, high = -Infinity;
      for (const values of parts) for (const value of values) if (Number.isFinite(value)) { low = Math.min(low, value); high = Math.max(high, value); }
      if (!(high >= low)) [low, high] = [0, 1];
      const margin = high - low > 1e-9 * Math.max(Math.abs(low), Math.abs(high)) ? 0.07 * (high - low) : flatMargin(low, high);
      return [low - margin, high + margin];
    };
    const shown = this.curves.filter((curve) => curve.shown), bounds = this.shownBounds();
    [this.from, this.to] = range([...shown.map((curve) => curve.x), ...bounds.map((bound) => bound.x)]);
    [this.low, this.high] = range([...shown.map((curve) => curve.y), ...bounds.map((bound) => bound.y)]);
  }

  shownBounds() { return this.bounds.filter((bound) => this.curves.some((curve) => curve.shown && curve.label === bound.label)); }

  drawAxes(c) {
    const { left, right } = this.axis, rows = roundSteps(this.low, this.high, 4), columns = roundSteps(this.from, this.to, Math.max(2, Math.min(8, (right - left) / 70)));
    c.fillStyle = ink("soft");
    for (const step of columns.steps) {
      const x = Math.round(this.across(step)) + 0.5;
      c.strokeStyle = ink(step === 0 ? "zero" : "grid");
      c.beginPath(); c.moveTo(x, this.top); c.lineTo(x, this.bottom); c.stroke();
      c.textBaseline = "top"; c.textAlign = "center";
      const label = stepLabel(step, columns.step), half = c.measureText(label).width / 2;
      c.fillText(label, Math.max(half, Math.min(this.width - half, x)), this.bottom + 5);
    }
    for (const step of rows.steps) {
      const y = Math.round(this.y(step)) + 0.5;
      c.strokeStyle = ink(step === 0 ? "zero" : "grid");
      c.beginPath(); c.moveTo(left, y); c.lineTo(right, y); c.stroke();
      c.textBaseline = "middle"; c.textAlign = "right";
      c.fillText(stepLabel(step, rows.step), left - 6, y);
    }
  }

  drawCurve(c, curve) {
    for (const bound of this.bounds.filter(({ label }) => label === curve.label)) {
      c.fillStyle = ink("soft");
      for (let i = 0; i < bound.x.length; i++) c.fillRect(this.across(bound.x[i]) - 0.8, this.y(bound.y[i]) - 0.8, 1.6, 1.6);
    }
    c.strokeStyle = onPaper(curve.color); c.setLineDash(curve.dash); c.globalAlpha = 0.75;
    this.path(c, curve, curve.t.length);
    c.setLineDash([]); c.globalAlpha = 1;
  }

  /** Draws the first points of a curve; NaN separates its parts. */
  path(c, { x, y }, count) {
    let open = false;
    c.beginPath();
    for (let i = 0; i < count; i++) {
      const known = Number.isFinite(x[i]) && Number.isFinite(y[i]);
      if (known && open) c.lineTo(this.across(x[i]), this.y(y[i])); else if (known) c.moveTo(this.across(x[i]), this.y(y[i]));
      open = known;
    }
    c.stroke();
  }

  /** Draws a ball at the state of the shown time. */
  draw(time, hover) {
    this.drawn = [time, hover];
    const { context: c } = this, read = hover === null ? time : hover;
    for (const curve of this.curves) curve.reading.textContent = steady(this.value(curve, read));
    if (!c || !this.canvas.clientWidth) return;
    c.save(); c.setTransform(1, 0, 0, 1, 0, 0);
    c.clearRect(0, 0, this.canvas.width, this.canvas.height);
    c.drawImage(this.background, 0, 0);
    c.restore();
    for (const curve of this.curves.filter((one) => one.shown)) {
      const [x, y] = [curve.x, curve.y].map((values) => this.value({ t: curve.t, values }, read));
      if (!Number.isFinite(x) || !Number.isFinite(y)) continue;
      c.fillStyle = onPaper(curve.color); c.strokeStyle = ink("paper"); c.lineWidth = 1.5;
      c.beginPath(); c.arc(this.across(x), this.y(y), 4, 0, 2 * Math.PI); c.fill(); c.stroke();
    }
  }
}
