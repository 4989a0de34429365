// Time axis of the run: a slider, marks of events, and the density of frequent events.

const MIN_MARK_DISTANCE = 6; // minimum distance of separate marks [pixels]

class Timeline {
  constructor(run, span, canvas, tip, seek, hover) {
    Object.assign(this, { run, span, canvas, tip, loop: null });
    const { events } = run;
    this.digits = Math.max(4, digitsFor(span.full[1] - span.full[0]));
    this.track = events.times.length ? 21 : 10;
    canvas.style.height = `${this.track + 27}px`;
    this.axis = new TimeAxis(span, canvas, seek, (t, event) => {
      hover(t);
      this.showTip(t === null ? "" : this.textAt(t), event);
    });
  }

  color(kind) { return (this.run.looks.events[kind] || this.run.looks.events.other).color; }

  /** Text of the events close to a time. */
  textAt(time) {
    const { times, kind, element, kinds, elements, impulse, taken } = this.run.events, near = [];
    const reach = (MIN_MARK_DISTANCE * (this.span.end - this.span.start)) / Math.max(this.axis.right - this.axis.left, 1);
    for (let k = 0; k < times.length; k++) if (Math.abs(times[k] - time) < reach) near.push(k);
    const struck = (k) => (impulse[k] > 0 ? `  ${readable(impulse[k])} N s, ${readable(taken[k])} J` : "");
    const lines = near.slice(0, 6).map((k) => `${times[k].toFixed(this.digits)} s  ${kinds[kind[k]]}  ${elements[element[k]]}${struck(k)}`);
    return lines.concat(near.length > 6 ? [`and ${near.length - 6} more`] : []).join("\n");
  }

  showTip(text, event) {
    this.tip.hidden = !text;
    if (!text) return;
    this.tip.textContent = text;
    placeTip(this.tip, event.clientX, this.canvas.getBoundingClientRect().top - 8 - this.tip.offsetHeight);
  }

  resize(left) {
    const { context: c, width, height } = fitCanvas(this.canvas);
    Object.assign(this, { context: c, width, height });
    Object.assign(this.axis, { left, right: width - 8 });
    if (this.drawn) this.draw(...this.drawn);
  }

  draw(time, hover) {
    this.drawn = [time, hover];
    const { context: c, axis, track } = this, { left, right } = axis;
    if (!c) return;
    c.clearRect(0, 0, this.width, this.height);
    const at = Math.max(left, Math.min(right, axis.x(time)));
    c.lineCap = "round"; c.lineWidth = 6;
    const bar = (color, from, to) => { c.strokeStyle = color; c.beginPath(); c.moveTo(from, track); c.lineTo(to, track); c.stroke(); };
    bar(ink("line"), left, right);
    bar(ink("accent"), left, at);
    c.lineCap = "butt";
    if (this.loop) { c.lineWidth = 2; bar(ink("strong"), Math.max(left, axis.x(this.loop[0])), Math.min(right, axis.x(this.loop[1]))); }
    this.drawEvents(c);
    axis.draw(c, track + 10, this.width);
    if (hover !== null) { c.strokeStyle = ink("faint"); c.lineWidth = 1; c.beginPath(); c.moveTo(axis.x(hover), track - 8); c.lineTo(axis.x(hover), track + 8); c.stroke(); }
    if (this.run.failure) this.drawEnd(c, axis.x(this.span.full[1]));
    if (time < this.span.start || time > this.span.end) return;
    c.fillStyle = ink("paper"); c.strokeStyle = ink("accent"); c.lineWidth = 3;
    c.beginPath(); c.arc(at, track, 6, 0, 2 * Math.PI); c.fill(); c.stroke();
  }

  drawEvents(c) {
    const { times, kind, kinds } = this.run.events, { axis, track } = this, columns = new Map();
    for (let k = 0; k < times.length; k++) {
      if (times[k] < this.span.start || times[k] > this.span.end) continue;
      const column = Math.round(axis.x(times[k]) / MIN_MARK_DISTANCE);
      if (!columns.has(column)) columns.set(column, []);
      columns.get(column).push(k);
    }
    const most = Math.max(1, ...[...columns.values()].map((own) => own.length));
    for (const [column, own] of columns) {
      if (own.length <= 2) {
        for (const k of own) { const x = axis.x(times[k]); c.fillStyle = this.color(kinds[kind[k]]); c.beginPath(); c.moveTo(x, track - 5); c.lineTo(x - 3.5, track - 12); c.lineTo(x + 3.5, track - 12); c.fill(); }
        continue;
      }
      // Frequent events are a column with a height by their number, divided by kind.
      const tall = 4 + 10 * (Math.log(own.length) / Math.log(Math.max(most, 3))), counts = new Map();
      for (const k of own) counts.set(kind[k], (counts.get(kind[k]) || 0) + 1);
      let y = track - 5;
      for (const [which, count] of [...counts].sort()) {
        const part = (count / own.length) * tall;
        c.fillStyle = this.color(kinds[which]); c.fillRect((column - 0.5) * MIN_MARK_DISTANCE, y - part, MIN_MARK_DISTANCE, part);
        y -= part;
      }
    }
  }

  /** Draws a cross at the end of a stopped run. */
  drawEnd(c, x) {
    c.strokeStyle = ink("bad"); c.lineWidth = 2.5;
    for (const s of [-1, 1]) { c.beginPath(); c.moveTo(x - 5, this.track - 5 * s); c.lineTo(x + 5, this.track + 5 * s); c.stroke(); }
  }
}
