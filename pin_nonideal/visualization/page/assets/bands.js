// Band for each friction element, colored by its mode; pixels with several modes show their shares.

const OPEN = 2; // mode of an open contact
const BAND = 13; // height of a band with its gap [pixels]
// Offset of the bar of a mode from the top of its band, and height of the bar: slip + is above, slip - below, stick between them.
const SHAPES = { 1: [0, 0.5], [-1]: [0.5, 0.5], 0: [0.3, 0.4], 2: [0.45, 0.1], 3: [0, 1] };

/** Text without its middle, if it is wider than the room [pixels]. */
function shortened(c, text, room) {
  let short = text;
  for (let kept = text.length - 1; kept > 3 && c.measureText(short).width > room; kept--)
    short = `${text.slice(0, Math.ceil(kept / 2))}…${text.slice(text.length - Math.floor(kept / 2))}`;
  return short;
}

class Bands {
  constructor(run, span, canvas, tip, seek, hover) {
    Object.assign(this, { bands: run.modes.filter((band) => !band.point), looks: run.looks, end: run.times[run.times.length - 1], canvas, tip });
    canvas.parentElement.hidden = !this.bands.length;
    canvas.style.height = `${this.bands.length * BAND}px`;
    canvas.parentElement.addEventListener("scroll", () => this.writeRange());
    this.axis = new TimeAxis(span, canvas, seek, (t, event) => {
      hover(t);
      this.showTip(t === null ? "" : this.textAt(t, event.offsetY), event);
    });
  }

  look(mode) { return mode === OPEN ? { ...this.looks.modes[OPEN], color: ink("open") } : this.looks.modes[mode] || this.looks.no_mode; }

  textAt(time, y) {
    const band = this.bands[Math.floor(y / BAND)];
    if (!band) return "";
    const k = lastBelow(band.starts, time), end = k + 1 < band.starts.length ? band.starts[k + 1] : this.end;
    return `${band.name}: ${this.look(band.modes[k]).name}, ${readable(band.starts[k])} to ${readable(end)} s`;
  }

  showTip(text, event) {
    this.tip.hidden = !text;
    if (!text) return;
    this.tip.textContent = text;
    placeTip(this.tip, event.clientX, this.canvas.parentElement.getBoundingClientRect().top - 8 - this.tip.offsetHeight);
  }

  /** Width of the names at the left. */
  margin() {
    if (!this.bands.length) return 8;
    const c = this.canvas.getContext("2d");
    c.font = `11px ${getComputedStyle(document.documentElement).fontFamily}`;
    const room = Math.min(0.3 * innerWidth, 220);
    for (const band of this.bands) band.label = c.measureText(band.name).width > room ? band.name.replace(/^\w+\((.*)\)$/, "$1") : band.name;
    for (const band of this.bands) band.label = shortened(c, band.label, room);
    return Math.min(Math.max(...this.bands.map((band) => c.measureText(band.label).width)), room) + 14;
  }

  writeRange() { writeRange(element("lanes-range"), this.canvas.parentElement, this.bands.map((_, row) => (row + 1) * BAND)); }

  resize(left) {
    this.writeRange();
    const { context: c, width, height } = fitCanvas(this.canvas);
    if (!this.bands.length || !width) return;
    Object.assign(this.axis, { left, right: width - 8 });
    Object.assign(this, { context: c, height });
    c.clearRect(0, 0, width, height);
    this.bands.forEach((band, row) => this.drawBand(c, band, row * BAND));
    this.background = this.background || document.createElement("canvas");
    this.background.width = this.canvas.width; this.background.height = this.canvas.height;
    this.background.getContext("2d").drawImage(this.canvas, 0, 0);
    if (this.drawn) this.draw(...this.drawn);
  }

  drawBand(c, band, top) {
    const { axis } = this, shares = new Map(), tall = BAND - 2;
    c.fillStyle = ink("soft"); c.textAlign = "right"; c.textBaseline = "middle";
    c.save(); c.beginPath(); c.rect(0, top, axis.left - 4, BAND); c.clip();
    c.fillText(band.label, axis.left - 8, top + BAND / 2); c.restore();
    const first = lastBelow(band.starts, axis.span.start);
    for (let k = first; k < band.starts.length && (k === first || band.starts[k] <= axis.span.end); k++) {
      const from = Math.max(axis.x(band.starts[k]), axis.left), to = Math.min(axis.x(k + 1 < band.starts.length ? band.starts[k + 1] : this.end), axis.right);
      const { color } = this.look(band.modes[k]), [rise, part] = SHAPES[band.modes[k]] || [0, 1];
      if (to - from >= 1.5) { c.fillStyle = color; c.fillRect(from, top + 1 + rise * tall, to - from, part * tall); continue; }
      const column = Math.floor((from + to) / 2), own = shares.get(column) || new Map();
      own.set(color, (own.get(color) || 0) + Math.max(to - from, 1e-4));
      shares.set(column, own);
    }
    for (const [column, own] of shares) {
      const whole = [...own.values()].reduce((a, b) => a + b, 0);
      let y = top + 1;
      for (const [color, share] of [...own].sort()) { c.fillStyle = color; c.fillRect(column, y, 1.2, (share / whole) * tall); y += (share / whole) * tall; }
    }
  }

  draw(time, hover) {
    this.drawn = [time, hover];
    const { context: c, axis } = this;
    if (!c || !this.bands.length || !this.background) return;
    c.save(); c.setTransform(1, 0, 0, 1, 0, 0);
    c.clearRect(0, 0, this.canvas.width, this.canvas.height);
    c.drawImage(this.background, 0, 0);
    c.restore();
    for (const [t, color] of [[hover, ink("faint")], [time, ink("accent")]]) {
      if (t === null || t < axis.span.start || t > axis.span.end) continue;
      c.strokeStyle = color; c.lineWidth = 1;
      c.beginPath(); c.moveTo(axis.x(t), 0); c.lineTo(axis.x(t), this.height); c.stroke();
    }
  }
}
