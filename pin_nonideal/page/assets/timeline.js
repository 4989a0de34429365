// The time line: position, marks of events, and a band for each element that sticks or slips.

const MODE_COLORS = { "1": "#fb923c", "-1": "#60a5fa", "0": "#475569" };
const MODE_NAMES = { "1": "slip +", "-1": "slip −", "0": "stick" };
const EVENT_COLORS = { stick: "#475569", slip: "#ea580c", reverse: "#7c3aed", pull: "#dc2626", chatter: "#0891b2", several: "#db2777" };
const BAND = 11; // height of a band with its gap [pixels]

class Timeline {
  constructor(run, range, canvas, tip, seek, hover) {
    Object.assign(this, { run, range, canvas, tip, bands: run.modes });
    this.bandHeight = this.bands.length > 12 ? Math.max(3, Math.floor((12 * BAND) / this.bands.length)) : BAND;
    canvas.style.height = `${(run.events.length ? 26 : 20) + this.bands.length * this.bandHeight + 18}px`;
    const time = (x) => Math.max(range[0], Math.min(range[1], range[0] + ((x - this.left) / (this.right - this.left)) * (range[1] - range[0])));
    trackPointer(canvas, (x) => seek(time(x)), (x, event) => {
      hover(x === null ? null : time(x));
      this.showTip(x === null ? "" : this.textAt(time(x), event.offsetY), event);
    });
  }

  x(t) {
    const [start, end] = this.range;
    return this.left + (end > start ? (t - start) / (end - start) : 0) * (this.right - this.left);
  }

  resize() {
    const { context: c, width, height } = fitCanvas(this.canvas);
    const widest = Math.max(0, ...this.bands.map((band) => c.measureText(band.name).width));
    Object.assign(this, { context: c, width, height, left: this.bands.length ? Math.min(widest, 190) + 14 : 8, right: width - 8 });
    this.track = this.run.events.length ? 17 : 10;
    if (this.shown) this.draw(...this.shown);
  }

  /** What the pointer is on: events close to it, or the band under it. */
  textAt(time, y) {
    const reach = (6 * (this.range[1] - this.range[0])) / Math.max(this.right - this.left, 1);
    const row = Math.floor((y - this.track - 8) / this.bandHeight), band = this.bands[row];
    if (band) {
      const [start, end, mode] = band.runs[lastBelow(band.runs.map((piece) => piece[0]), time)];
      return `${band.name}: ${MODE_NAMES[mode] || `mode ${mode}`}, ${readable(start)} to ${readable(end)} s`;
    }
    const near = this.run.events.filter((event) => Math.abs(event.time - time) < reach);
    const lines = near.slice(0, 6).map((event) => `${event.time.toFixed(4)} s  ${event.kind}  ${event.element}`);
    return lines.concat(near.length > 6 ? [`and ${near.length - 6} more`] : []).join("\n");
  }

  showTip(text, event) {
    this.tip.hidden = !text;
    if (!text) return;
    this.tip.textContent = text;
    const box = this.canvas.getBoundingClientRect();
    placeTip(this.tip, event.clientX, box.top - 8 - this.tip.offsetHeight);
  }

  draw(time, hover) {
    this.shown = [time, hover];
    const { context: c, left, right, track } = this;
    if (!c) return;
    c.clearRect(0, 0, this.width, this.height);
    const at = this.x(time);
    c.lineCap = "round"; c.lineWidth = 6;
    c.strokeStyle = "#e2e8f0"; c.beginPath(); c.moveTo(left, track); c.lineTo(right, track); c.stroke();
    c.strokeStyle = "#2563eb"; c.beginPath(); c.moveTo(left, track); c.lineTo(at, track); c.stroke();
    c.lineCap = "butt";
    for (const event of this.run.events) {
      const x = this.x(event.time);
      c.fillStyle = EVENT_COLORS[event.kind] || "#64748b";
      c.beginPath(); c.moveTo(x, track - 5); c.lineTo(x - 3.5, track - 12); c.lineTo(x + 3.5, track - 12); c.fill();
    }
    this.bands.forEach((band, row) => this.drawBand(c, band, track + 8 + row * this.bandHeight));
    this.drawTicks(c, track + 10 + this.bands.length * this.bandHeight);
    const bottom = track + 8 + this.bands.length * this.bandHeight;
    if (hover !== null) { c.strokeStyle = "#94a3b8"; c.lineWidth = 1; c.beginPath(); c.moveTo(this.x(hover), track - 8); c.lineTo(this.x(hover), bottom); c.stroke(); }
    if (this.bands.length) { c.strokeStyle = "#2563eb"; c.lineWidth = 1; c.beginPath(); c.moveTo(at, track); c.lineTo(at, bottom); c.stroke(); }
    c.fillStyle = "#fff"; c.strokeStyle = "#2563eb"; c.lineWidth = 3;
    c.beginPath(); c.arc(at, track, 6, 0, 2 * Math.PI); c.fill(); c.stroke();
  }

  drawBand(c, band, top) {
    if (this.bandHeight >= 8) {
      c.fillStyle = "#64748b"; c.textAlign = "right"; c.textBaseline = "middle";
      c.save(); c.beginPath(); c.rect(0, top, this.left - 4, this.bandHeight); c.clip();
      c.fillText(band.name, this.left - 10, top + this.bandHeight / 2); c.restore();
    }
    for (const [start, end, mode] of band.runs) {
      c.fillStyle = MODE_COLORS[mode] || "#f1f5f9";
      c.fillRect(this.x(start), top + 1, Math.max(this.x(end) - this.x(start), 0.5), this.bandHeight - (this.bandHeight > 4 ? 2 : 0));
    }
  }

  drawTicks(c, top) {
    const [start, end] = this.range;
    if (!(end > start)) return;
    const rows = roundSteps(start, end, Math.max(2, (this.right - this.left) / 90));
    c.fillStyle = "#64748b"; c.textAlign = "center"; c.textBaseline = "top";
    for (const step of rows.steps) {
      const label = stepLabel(step, rows.step), x = this.x(step), half = c.measureText(label).width / 2;
      c.fillText(label, Math.max(half, Math.min(this.width - half, x)), top);
    }
  }
}

/** Puts the tip at a place in the window, inside its edges. */
function placeTip(tip, clientX, clientY) {
  const stage = tip.parentElement.getBoundingClientRect();
  const left = Math.max(4, Math.min(stage.width - tip.offsetWidth - 4, clientX - stage.left - tip.offsetWidth / 2));
  tip.style.left = `${left}px`;
  tip.style.top = `${Math.max(4, Math.min(stage.height - tip.offsetHeight - 4, clientY - stage.top))}px`;
}
