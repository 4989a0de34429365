// Axes: round steps, canvases, the visible time span, and pointer events of a time axis.

/** Round steps that divide a range into about `count` parts. */
function roundSteps(low, high, count) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw)), lead = raw / power;
  const step = (lead < 1.5 ? 1 : lead < 3.5 ? 2 : lead < 7.5 ? 5 : 10) * power, steps = [];
  for (let x = Math.ceil(low / step - 1e-9) * step; x <= high + 1e-9 * step; x += step) steps.push(Math.abs(x) < 1e-9 * step ? 0 : x);
  return { step, steps };
}

function stepLabel(x, step) {
  const size = Math.max(Math.abs(x), step);
  if (size >= 1e5 || size < 1e-3) return x === 0 ? "0" : x.toExponential(Math.max(0, Math.floor(Math.log10(Math.abs(x)) + 1e-9) - Math.floor(Math.log10(step) + 1e-9)));
  return x.toFixed(Math.max(0, Math.min(9, -Math.floor(Math.log10(step) + 1e-9))));
}

/** Powers of ten between two exponents, at most five of them. */
function decades(low, high) {
  const step = Math.max(1, Math.ceil((high - low) / 5)), steps = [];
  for (let x = Math.ceil(low); x <= high; x += step) steps.push(x);
  return { step, steps };
}

/** Color of the page's style in the light or dark setting of the browser. */
const ink = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

/** Color of a curve, lighter in the dark setting of the browser. */
function onPaper(color) {
  if (!matchMedia("(prefers-color-scheme: dark)").matches) return color;
  const mixed = [1, 3, 5].map((i) => Math.round(0.55 * parseInt(color.slice(i, i + 2), 16) + 0.45 * 255));
  return `rgb(${mixed.join()})`;
}

/** Resizes a canvas to device pixels, with its context scaled to CSS pixels. */
function fitCanvas(canvas) {
  const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio);
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.font = `11px ${getComputedStyle(document.documentElement).fontFamily}`;
  return { context, width, height };
}

/** Visible part of the run, shared by all time axes. */
class Span {
  constructor(start, end) { Object.assign(this, { full: [start, end], start, end, changed: () => {} }); }

  set(start, end) {
    const [low, high] = this.full, least = Math.max((high - low) * 1e-7, 1e-12), length = Math.min(Math.max(end - start, least), high - low);
    this.start = Math.max(low, Math.min(high - length, start));
    this.end = this.start + length;
    this.changed();
  }

  zoom(factor, around) { this.set(around - (around - this.start) * factor, around + (this.end - around) * factor); }
  pan(by) { this.set(this.start + by, this.end + by); }
  reset() { this.set(...this.full); }

  /** Moves the span so that a time is visible. */
  show(time) {
    if (time >= this.start && time <= this.end) return;
    const length = this.end - this.start;
    this.set(time - 0.1 * length, time + 0.9 * length);
  }
}

/** Horizontal axis of a canvas. The callbacks seek(t) and hover(t or null, event) report the pointer; wheel and shift move the span. */
class TimeAxis {
  constructor(span, canvas, seek, hover) {
    Object.assign(this, { span, left: 8, right: 8 });
    let last = null;
    const held = (event) => Math.max(span.full[0], Math.min(span.full[1], this.time(event.offsetX)));
    canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); last = event; if (!event.shiftKey) seek(held(event)); });
    canvas.addEventListener("pointermove", (event) => {
      hover(held(event), event);
      if (!(event.buttons & 1)) return;
      if (event.shiftKey && last) span.pan(this.time(last.offsetX) - this.time(event.offsetX)); else seek(held(event));
      last = event;
    });
    canvas.addEventListener("pointerleave", () => hover(null));
    canvas.addEventListener("dblclick", () => span.reset());
    canvas.addEventListener("wheel", (event) => {
      if (span.full[1] <= span.full[0]) return;
      event.preventDefault();
      const scale = event.deltaMode ? 0.05 : 0.002;
      if (Math.abs(event.deltaX) > Math.abs(event.deltaY)) span.pan(event.deltaX * scale * 0.3 * (span.end - span.start));
      else span.zoom(Math.exp(Math.max(-0.7, Math.min(0.7, event.deltaY * scale))), this.time(event.offsetX));
    }, { passive: false });
  }

  x(t) {
    const { start, end } = this.span;
    return this.left + (end > start ? (t - start) / (end - start) : 0) * (this.right - this.left);
  }

  time(x) {
    const { start, end } = this.span;
    return start + ((x - this.left) / Math.max(this.right - this.left, 1)) * (end - start);
  }

  /** Draws labels of round times, with lines down to `bottom` if given. */
  draw(c, top, width, lines = null) {
    const { start, end } = this.span, rows = end > start ? roundSteps(start, end, Math.max(2, Math.min(12, (this.right - this.left) / 90))) : { steps: [start], step: 1 };
    c.textBaseline = "top"; c.textAlign = "center";
    for (const step of rows.steps) {
      const x = Math.round(this.x(step)) + 0.5;
      if (lines) { c.strokeStyle = ink("grid"); c.beginPath(); c.moveTo(x, lines[0]); c.lineTo(x, lines[1]); c.stroke(); }
      const label = stepLabel(step, rows.step), half = c.measureText(label).width / 2;
      c.fillStyle = ink("soft");
      c.fillText(label, Math.max(half, Math.min(width - half, x)), top);
    }
  }
}

/** Places the tip at a position in the window, inside its edges. */
function placeTip(tip, clientX, clientY) {
  const stage = tip.parentElement.getBoundingClientRect();
  const left = Math.max(4, Math.min(stage.width - tip.offsetWidth - 4, clientX - stage.left - tip.offsetWidth / 2));
  tip.style.left = `${left}px`;
  tip.style.top = `${Math.max(4, Math.min(stage.height - tip.offsetHeight - 4, clientY - stage.top))}px`;
}
