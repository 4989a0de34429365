// Player: one time for the view, the time axis and the plots, controlled by buttons and keys.

const ICONS = { play: "M7 4.5v15l13-7.5z", pause: "M6 5h4v14H6zM14 5h4v14h-4z" };
const SPEEDS = Array.from({ length: 27 }, (_, i) => Number(`${[1, 2, 5][i % 3]}e${Math.floor(i / 3) - 4}`)).slice(0, 25);
const MIN_CANVAS_HEIGHT = 124; // minimum height of a plot [pixels]: 100 for its curves, and the labels of its axis
const PLAY_SECONDS = [5, 15]; // shortest and longest duration of playback at the default speed [s]
const element = (id) => document.getElementById(id);

class Player {
  constructor(THREE, run) {
    this.run = run;
    const ends = [run, ...run.others].map(({ times }) => [times[0], times[times.length - 1]]);
    this.start = Math.min(...ends.map(([start]) => start)); this.end = Math.max(...ends.map(([, end]) => end));
    Object.assign(this, { time: this.start, playing: false, hover: null, loop: null, speed: this.usualSpeed() });
    this.span = new Span(this.start, this.end);
    this.span.changed = () => this.resizePlots();
    this.seekByHand = (t) => { this.pause(); this.seek(t); };
    this.hovered = (t) => { this.hover = t; this.drawPlots(); };
    this.stage = new Stage(THREE, run, element("scene"), element("labels"));
    this.timeline = new Timeline(run, this.span, element("timeline"), element("tip"), this.seekByHand, this.hovered);
    this.bands = new Bands(run, this.span, element("bands"), element("tip"), this.seekByHand, this.hovered);
    this.plots = run.plots.map((plot) => this.newPlot(plot));
    this.table = new ForceTable(run, this.stage.arrows, element("forces"));
    this.writeTexts();
    this.listen();
    this.seek(this.start);
    this.resize();
    this.stage.resetView();
    this.panel = new Panel(this);
    this.address = new UrlState(this);
    this.capture = new Capture(this);
  }

  newPlot(plot) { return new Plot(plot, this.span, element("plots"), this.run.looks.curves, this.seekByHand, this.hovered); }

  /** Speed at which the run takes 5 to 15 s; 1 if its duration is in this range. */
  usualSpeed() {
    const length = this.end - this.start, fits = (speed) => length / speed >= PLAY_SECONDS[0] && length / speed <= PLAY_SECONDS[1];
    return !(length > 0) || fits(1) ? 1 : SPEEDS.find(fits) || (length / SPEEDS[0] < PLAY_SECONDS[0] ? SPEEDS[0] : SPEEDS[SPEEDS.length - 1]);
  }

  writeTexts() {
    const { run } = this;
    element("heading").querySelector("h1").textContent = run.title;
    element("subtitle").textContent = run.subtitle;
    element("failure").hidden = !run.failure;
    if (run.failure) element("failure").textContent = `stopped at ${readable(this.end)} s: ${run.failure}`;
    if (this.stage.cell) element("grid-size").textContent = `grid ${readable(this.stage.cell)} m`;
    for (const [name, value] of run.facts) {
      const term = document.createElement("dt"), text = document.createElement("dd");
      term.textContent = name; text.textContent = value;
      element("facts").append(term, text);
    }
    for (const speed of SPEEDS) element("speed").add(new Option(`${speed}×`, speed, speed === this.speed, speed === this.speed));
    if (!run.plots.length) element("plots-toggle").hidden = true;
    element("runs").hidden = !run.others.length;
    if (run.others.length) this.addRuns();
    element("run-list").open = run.others.length < 8;
    element("run-list").querySelector("summary").textContent = `${run.others.length + 1} runs`;
    if (!run.events.times.length) for (const id of ["event-back", "event-forth"]) element(id).hidden = true;
    const legend = element("legend"), entry = ({ color, name }, title, shape) => {
      const item = legend.appendChild(document.createElement("span")), swatch = item.appendChild(document.createElement("i"));
      swatch.style.background = color;
      if (shape) swatch.style.clipPath = `inset(${100 * shape[0]}% 0 ${100 * (1 - shape[0] - shape[1])}% 0)`;
      item.append(name);
      item.title = title || name;
    };
    const modes = new Set(run.modes.flatMap((band) => [...new Set(band.modes)]));
    for (const mode of [1, -1, 0, 3, 2]) if (modes.has(mode)) entry(mode === OPEN ? { ...run.looks.modes[mode], color: "var(--open)" } : run.looks.modes[mode], null, SHAPES[mode]);
    for (const kind of run.events.kinds) { const look = run.looks.events[kind] || run.looks.events.other; entry({ color: look.color, name: `▾ ${kind}` }, look.means); }
  }

  /** Adds a button for each run, and the buttons for placement and differences. */
  addRuns() {
    const all = [{ name: this.run.name, color: ink("soft") }, ...this.stage.ghosts.items.map(({ name, tint: [r, g, b] }) => ({ name, color: `rgb(${255 * r} ${255 * g} ${255 * b})` }))];
    all.forEach(({ name, color }, i) => {
      const button = document.createElement("button"), swatch = button.appendChild(document.createElement("i"));
      swatch.style.background = color;
      button.append(name);
      button.title = "show or hide this run";
      button.setAttribute("aria-pressed", "true");
      button.addEventListener("click", () => {
        const shown = button.getAttribute("aria-pressed") !== "true";
        button.setAttribute("aria-pressed", String(shown));
        for (const item of this.stage.bodies.items) if (item.run === i) item.shown = shown;
        this.stage.dirty = true;
      });
      element("run-list").append(button);
    });
  }

  toggleApart() {
    this.stage.setApart(!this.stage.ghosts.apart);
    this.showToggles();
  }

  /** Switches between the curves of the other runs and their differences from the first. */
  toggleDifferences() {
    this.differing = !this.differing;
    for (const plot of this.plots) plot.showDifferences(this.differing);
    this.showToggles();
  }

  listen() {
    const on = (id, action) => element(id).addEventListener("click", action);
    on("play", () => this.toggle());
    on("back", () => this.step(-1));
    on("forth", () => this.step(1));
    on("event-back", () => this.toEvent(-1));
    on("event-forth", () => this.toEvent(1));
    on("from-here", () => this.setLoop(0));
    on("to-here", () => this.setLoop(1));
    on("reset", () => this.stage.resetView());
    on("follow", () => this.toggleFollow());
    on("forces-toggle", () => this.toggleForces());
    on("plots-toggle", () => this.togglePlots());
    on("apart", () => this.toggleApart());
    on("differences", () => this.toggleDifferences());
    on("about", () => element("help").showModal());
    element("speed").addEventListener("change", (e) => { this.speed = Number(e.target.value); });
    element("force-scale").querySelector("input").addEventListener("input", (e) => {
      this.stage.arrows.scale = 4 ** Number(e.target.value);
      this.seek(this.time);
    });
    this.listenToSplitter();
    window.addEventListener("keydown", (e) => this.key(e));
    new ResizeObserver(() => this.resize()).observe(element("stage"));
    window.addEventListener("resize", () => this.resize());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.resize());
    const canvas = element("scene"), tip = element("tip");
    canvas.addEventListener("pointermove", (e) => {
      const name = e.buttons ? null : this.stage.nearest(e.offsetX, e.offsetY);
      tip.hidden = !name;
      if (name) { tip.textContent = name; placeTip(tip, e.clientX, e.clientY - 34); }
    });
    canvas.addEventListener("pointerleave", () => { tip.hidden = true; });
    if (innerWidth < 640) this.toggleForces();
    this.showToggles();
  }

  key(event) {
    if (event.key === "Escape" && !element("panel").hidden) { this.panel.toggle(); element("panel-toggle").focus(); return; }
    if (event.ctrlKey || event.metaKey || event.altKey || element("help").open) return;
    const { tagName, type } = event.target;
    if (tagName === "SELECT" || type === "range" || type === "search" || type === "text") return;
    if ((event.key === " " || event.key === "Enter") && (tagName === "BUTTON" || tagName === "INPUT" || tagName === "SUMMARY")) return;
    const actions = {
      " ": () => this.toggle(), ArrowLeft: () => this.step(event.shiftKey ? -10 : -1), ArrowRight: () => this.step(event.shiftKey ? 10 : 1),
      Home: () => this.seekByHand(this.start), End: () => this.seekByHand(this.end),
      PageUp: () => this.seekByHand(this.time - 0.1 * (this.span.end - this.span.start)), PageDown: () => this.seekByHand(this.time + 0.1 * (this.span.end - this.span.start)),
      ArrowUp: () => this.changeSpeed(1), ArrowDown: () => this.changeSpeed(-1),
      n: () => this.toEvent(1), b: () => this.toEvent(-1), "[": () => this.setLoop(0), "]": () => this.setLoop(1), "\\": () => this.setLoop(null),
      "+": () => this.span.zoom(0.5, this.time), "-": () => this.span.zoom(2, this.time), 0: () => this.span.reset(),
      l: () => { element("loop").checked = !element("loop").checked; }, f: () => this.toggleForces(), p: () => this.togglePlots(),
      c: () => this.toggleFollow(), t: () => this.panel.toggle(), r: () => this.stage.resetView(), "?": () => element("help").showModal(),
    };
    const action = actions[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    event.preventDefault();
    action();
  }

  /** Shows the state at a time, clamped to the run. */
  seek(time) {
    this.time = Math.max(this.start, Math.min(this.end, Number(time)));
    this.stage.setTime(this.time);
    const digits = digitsFor(this.end - this.start), text = this.time.toFixed(digits), gap = this.stage.marks.gap();
    element("clock").querySelector("span").textContent = text;
    element("clock").querySelector("small").textContent = `/ ${this.end.toFixed(digits)} s`;
    element("gap").textContent = gap === null ? "" : `gap drawn ${readable(gap)} m`;
    for (const [name, value] of [["aria-valuemin", this.start], ["aria-valuemax", this.end], ["aria-valuenow", this.time], ["aria-valuetext", `${text} s`]])
      element("timeline").setAttribute(name, value);
    this.table.update();
    this.drawPlots();
  }

  drawPlots() {
    for (const view of [this.timeline, this.bands, ...this.plots]) view.draw(this.time, this.hover);
  }

  /** Moves by a number of frames. */
  step(frames) {
    const { times } = this.run, here = lastBelow(times, this.time + 1e-9 * (this.end - this.start));
    this.seekByHand(times[Math.max(0, Math.min(times.length - 1, here + frames))]);
    this.span.show(this.time);
  }

  /** Moves to the next event, or to the previous one. */
  toEvent(way) {
    const times = [...this.run.events.times].sort((a, b) => a - b), near = 1e-9 * (this.end - this.start);
    const found = way > 0 ? times.find((t) => t > this.time + near) : times.reverse().find((t) => t < this.time - near);
    if (found === undefined) return;
    this.seekByHand(found);
    this.span.show(found);
  }

  /** Sets the start (0) or the end (1) of the repeated part to the current time; null repeats the whole run. */
  setLoop(end) {
    const loop = this.loop || [this.start, this.end];
    if (end !== null) loop[end] = this.time;
    this.loop = end === null || !(loop[1] > loop[0]) ? null : loop;
    this.timeline.loop = this.loop;
    if (this.loop) element("loop").checked = true;
    this.drawPlots();
  }

  play() {
    if (this.end <= this.start) return;
    if (this.time >= this.end) this.seek(this.start);
    this.playing = true; this.clock = performance.now();
    this.showToggles();
  }

  pause() { this.playing = false; this.showToggles(); }

  toggle() { if (this.playing) this.pause(); else this.play(); }

  changeSpeed(by) {
    this.speed = SPEEDS[Math.max(0, Math.min(SPEEDS.length - 1, SPEEDS.indexOf(this.speed) + by))];
    element("speed").value = this.speed;
  }

  toggleFollow() {
    this.stage.follow(this.stage.following ? null : this.stage.followed);
    this.showToggles();
  }

  toggleForces() {
    this.stage.arrows.shown = !this.stage.arrows.shown;
    element("forces").classList.toggle("off", !this.stage.arrows.shown);
    element("forces-toggle").textContent = this.stage.arrows.shown ? "hide" : "show";
    this.seek(this.time);
  }

  togglePlots() {
    element("plots").classList.toggle("off");
    this.resize();
    this.showToggles();
  }

  showToggles() {
    element("play").querySelector("path").setAttribute("d", this.playing ? ICONS.pause : ICONS.play);
    element("play").setAttribute("aria-label", this.playing ? "pause" : "play");
    for (const [id, on] of [["follow", this.stage.following], ["plots-toggle", !element("plots").classList.contains("off")], ["apart", this.stage.ghosts.apart], ["differences", Boolean(this.differing)]]) {
      element(id).classList.toggle("on", on);
      element(id).setAttribute("aria-pressed", String(on));
    }
  }

  /** A height of the plots by hand [pixels], or null for that of the style. */
  setDock(height) {
    const dock = element("dock"), room = document.querySelector("main").clientHeight, least = 120;
    this.dock = height === null ? null : Math.max(least, Math.min(room - 140, height));
    dock.style.flexBasis = this.dock === null ? "" : `${this.dock}px`;
    dock.style.maxHeight = this.dock === null ? "" : "none";
    element("splitter").setAttribute("aria-valuenow", String(Math.round((100 * dock.offsetHeight) / Math.max(room, 1))));
    this.resize();
  }

  listenToSplitter() {
    const splitter = element("splitter");
    for (const [name, value] of [["aria-valuemin", 0], ["aria-valuemax", 100], ["aria-valuenow", 50]]) splitter.setAttribute(name, String(value));
    splitter.addEventListener("pointerdown", (event) => splitter.setPointerCapture(event.pointerId));
    splitter.addEventListener("pointermove", (event) => { if (event.buttons & 1) this.setDock(innerHeight - event.clientY + splitter.offsetHeight / 2); });
    splitter.addEventListener("dblclick", () => this.setDock(null));
    splitter.addEventListener("keydown", (event) => {
      const by = { ArrowUp: 24, ArrowDown: -24 }[event.key];
      if (!by) return;
      event.preventDefault(); event.stopPropagation();
      this.setDock(element("dock").offsetHeight + by);
    });
  }

  /** Sets the height of curves: the style's height, or the space for a single row of plots in a resized dock. */
  fitPlots() {
    const plots = element("plots"), last = this.plots[this.plots.length - 1];
    plots.style.removeProperty("--tall");
    if (!this.dock || !last || last.box.offsetTop !== this.plots[0].box.offsetTop) return;
    const more = plots.clientHeight - last.box.offsetTop + plots.offsetTop - last.box.offsetHeight;
    plots.style.setProperty("--tall", `${Math.max(MIN_CANVAS_HEIGHT, last.canvas.clientHeight + more)}px`);
  }

  resize() {
    const box = element("forces"), { clientWidth: width, clientHeight: height } = element("stage"), narrow = width < 640, folded = box.classList.contains("off");
    // The view is framed between the heading and the buttons that cover it, and beside the table of forces if there is space.
    const taken = (card, side, room) => (card[side] ? card[side] + room : 0);
    // The panel begins below the heading, and ends above the buttons if they lie under it.
    const heading = element("heading"), beside = narrow || box.hidden ? 0 : box.offsetWidth;
    const room = `${Math.max(width - beside - 36, 200)}px`;  // a low stage has space for few, long lines only
    heading.style.maxWidth = beside ? (height < 330 ? room : `min(60%, ${room})`) : "";
    const tools = element("tools"), panel = element("panel"), under = tools.offsetLeft < panel.offsetLeft + panel.offsetWidth;
    panel.style.top = `${height < 330 && element("runs").hidden ? 8 : heading.offsetTop + heading.offsetHeight + 8}px`;
    panel.style.bottom = under ? `${tools.offsetHeight + 16}px` : "";
    const below = taken(element("tools"), "offsetHeight", 12) + (narrow && folded ? taken(box, "offsetHeight", 6) : 0);
    this.stage.covered = {
      right: folded || narrow ? 0 : Math.min(taken(box, "offsetWidth", 12) / Math.max(width, 1), 0.4),
      top: Math.min(taken(element("heading"), "offsetHeight", 14) / Math.max(height, 1), 0.35), bottom: Math.min(below / Math.max(height, 1), 0.3),
    };
    this.table.fit();
    this.stage.resize();
    this.fitPlots();
    this.resizePlots();
  }

  resizePlots() {
    const left = this.bands.margin();
    this.timeline.resize(left);
    this.bands.resize(left);
    for (const plot of this.plots) plot.resize();
    this.drawPlots();
  }

  /** One frame of the screen. */
  tick() {
    if (this.playing) {
      const now = performance.now(), repeats = element("loop").checked, [from, to] = (repeats && this.loop) || [this.start, this.end];
      let time = this.time + ((now - this.clock) / 1000) * this.speed;
      this.clock = now;
      if (time >= to) {
        if (repeats) time = from + ((time - from) % (to - from));
        else { time = to; this.pause(); }
      }
      this.seek(time);
      if (this.playing) this.span.show(this.time);
    }
    this.stage.render();
    if (this.capture.drawn) this.capture.drawn();
  }
}
