// The player: one time for the view, the time line and the plots; buttons, keys and window.replay drive it.

const SPEEDS = [0.05, 0.1, 0.25, 0.5, 1, 2, 4, 10];
const ICONS = { play: "M7 4.5v15l13-7.5z", pause: "M6 5h4v14H6zM14 5h4v14h-4z" };
const element = (id) => document.getElementById(id);

class Player {
  constructor(THREE, run) {
    this.run = run;
    this.start = run.times[0]; this.end = run.times[run.times.length - 1];
    this.time = this.start; this.playing = false; this.hover = null; this.speed = 1;
    const range = [this.start, this.end], seek = (t) => { this.pause(); this.seek(t); }, hover = (t) => { this.hover = t; this.drawPlots(); };
    this.scene = new ReplayScene(THREE, run, element("scene"), element("labels"));
    this.timeline = new Timeline(run, range, element("timeline"), element("tip"), seek, hover);
    this.plots = run.plots.map((plot) => new Plot(plot, range, element("plots"), seek, hover));
    this.writeTexts();
    this.addForceTable();
    this.listen();
    this.resize();
    this.scene.resetView();
    this.seek(this.start);
  }

  writeTexts() {
    const { run } = this;
    element("heading").querySelector("h1").textContent = run.title;
    element("heading").querySelector("p").textContent = run.subtitle;
    element("grid-size").textContent = `grid ${readable(this.scene.cell)} m`;
    for (const [name, value] of run.facts) {
      const term = document.createElement("dt"), text = document.createElement("dd");
      term.textContent = name; text.textContent = value;
      element("facts").append(term, text);
    }
    for (const speed of SPEEDS) element("speed").add(new Option(`${speed}×`, speed, speed === 1, speed === 1));
    if (!run.plots.length) element("plots-toggle").hidden = true;
    if (run.modes.length) {
      const legend = document.createElement("label");
      for (const mode of ["1", "-1", "0"]) {
        const swatch = document.createElement("i");
        swatch.style.cssText = `width: 10px; height: 10px; border-radius: 2px; background: ${MODE_COLORS[mode]}`;
        legend.append(swatch, MODE_NAMES[mode]);
      }
      element("transport").querySelector(".spring").after(legend);
    }
  }

  /** The table of forces: a row for each place, a column for each kind. */
  addForceTable() {
    const { arrows } = this.scene, kinds = [...new Set(arrows.map((arrow) => arrow.kind))];
    if (!arrows.length) return;
    element("forces").hidden = false;
    const table = element("forces").querySelector("table"), head = table.insertRow();
    head.append(document.createElement("th"));
    for (const kind of kinds) {
      const cell = document.createElement("th");
      cell.textContent = kind;
      cell.style.setProperty("--swatch", FORCE_COLORS[kind]);
      head.append(cell);
    }
    this.cells = [];
    const rows = new Map();
    for (const arrow of arrows) {
      const key = `${arrow.name} ${arrow.unit}`;
      if (!rows.has(key)) {
        const row = table.insertRow();
        row.insertCell().textContent = arrow.name;
        for (const _ of kinds) row.insertCell();
        rows.set(key, row);
      }
      this.cells.push([arrow, rows.get(key).cells[1 + kinds.indexOf(arrow.kind)]]);
    }
  }

  listen() {
    const on = (id, action) => element(id).addEventListener("click", () => { action(); element(id).blur(); });
    on("play", () => this.toggle());
    on("back", () => this.step(-1));
    on("forth", () => this.step(1));
    on("reset", () => this.scene.resetView());
    on("follow", () => this.toggleFollow());
    on("forces-toggle", () => this.toggleForces());
    on("plots-toggle", () => this.togglePlots());
    on("about", () => element("help").showModal());
    element("speed").addEventListener("change", (e) => { this.speed = Number(e.target.value); e.target.blur(); });
    element("force-scale").querySelector("input").addEventListener("input", (e) => {
      this.scene.forceScale = 4 ** Number(e.target.value);
      this.seek(this.time);
    });
    window.addEventListener("keydown", (e) => this.key(e));
    new ResizeObserver(() => this.resize()).observe(element("stage"));
    window.addEventListener("resize", () => this.resize());
    const canvas = element("scene"), tip = element("tip");
    canvas.addEventListener("pointermove", (e) => {
      const name = e.buttons ? null : this.scene.nearest(e.offsetX, e.offsetY);
      tip.hidden = !name;
      if (name) { tip.textContent = name; placeTip(tip, e.clientX, e.clientY - 34); }
    });
    canvas.addEventListener("pointerleave", () => { tip.hidden = true; });
    this.showToggles();
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || element("help").open) return;
    if (event.target.tagName === "SELECT" || event.target.type === "range") return;
    const actions = {
      " ": () => this.toggle(), ArrowLeft: () => this.step(event.shiftKey ? -10 : -1), ArrowRight: () => this.step(event.shiftKey ? 10 : 1),
      Home: () => { this.pause(); this.seek(this.start); }, End: () => { this.pause(); this.seek(this.end); },
      ArrowUp: () => this.changeSpeed(1), ArrowDown: () => this.changeSpeed(-1),
      l: () => { element("loop").checked = !element("loop").checked; }, f: () => this.toggleForces(), p: () => this.togglePlots(),
      c: () => this.toggleFollow(), r: () => this.scene.resetView(), "?": () => element("help").showModal(),
    };
    const action = actions[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    event.preventDefault();
    action();
  }

  /** Shows the state at a time of the run, held between its ends. */
  seek(time) {
    this.time = Math.max(this.start, Math.min(this.end, Number(time)));
    this.scene.setTime(this.time);
    const digits = this.end - this.start < 1 ? 4 : 3;
    element("clock").querySelector("span").textContent = this.time.toFixed(digits);
    element("clock").querySelector("small").textContent = `/ ${this.end.toFixed(digits)} s`;
    for (const [arrow, cell] of this.cells || []) cell.textContent = `${steady(arrow.value)} ${arrow.unit}`;
    this.drawPlots();
  }

  drawPlots() {
    this.timeline.draw(this.time, this.hover);
    for (const plot of this.plots) plot.draw(this.time, this.hover);
  }

  /** Goes on by whole frames. */
  step(frames) {
    const { times } = this.run, here = lastBelow(times, this.time + 1e-9 * (1 + Math.abs(this.time)));
    this.pause();
    this.seek(times[Math.max(0, Math.min(times.length - 1, here + frames))]);
  }

  play() {
    if (this.end <= this.start) return;
    if (this.time >= this.end) this.seek(this.start);
    this.playing = true; this.clock = performance.now();
    this.showToggles();
  }

  pause() {
    this.playing = false;
    this.showToggles();
  }

  toggle() { if (this.playing) this.pause(); else this.play(); }

  changeSpeed(by) {
    const next = SPEEDS[Math.max(0, Math.min(SPEEDS.length - 1, SPEEDS.indexOf(this.speed) + by))];
    this.speed = next;
    element("speed").value = next;
  }

  toggleFollow() {
    this.scene.following = !this.scene.following;
    this.scene.dirty = true;
    this.showToggles();
  }

  toggleForces() {
    this.scene.forcesShown = !this.scene.forcesShown;
    element("forces").classList.toggle("off", !this.scene.forcesShown);
    element("forces-toggle").textContent = this.scene.forcesShown ? "hide" : "show";
    this.seek(this.time);
  }

  togglePlots() {
    element("plots").classList.toggle("off");
    this.resize();
    this.showToggles();
  }

  showToggles() {
    element("play").querySelector("path").setAttribute("d", this.playing ? ICONS.pause : ICONS.play);
    element("follow").classList.toggle("on", this.scene.following);
    element("plots-toggle").classList.toggle("on", !element("plots").classList.contains("off"));
  }

  resize() {
    this.scene.resize();
    this.timeline.resize();
    for (const plot of this.plots) plot.resize();
    this.drawPlots();
  }

  /** One frame of the screen. */
  tick() {
    if (this.playing) {
      const now = performance.now(), length = this.end - this.start;
      let time = this.time + ((now - this.clock) / 1000) * this.speed;
      this.clock = now;
      if (time >= this.end) {
        if (element("loop").checked) time = this.start + ((time - this.start) % length);
        else { time = this.end; this.pause(); }
      }
      this.seek(time);
    }
    this.scene.render();
  }

  /** What scripts and tests may use: window.replay. */
  door() {
    const player = this;
    return {
      ready: true,
      seek: (time) => { player.pause(); player.seek(time); player.scene.render(); },
      play: () => player.play(),
      pause: () => player.pause(),
      poses: () => player.scene.poses(),
      get playing() { return player.playing; },
      get time() { return player.time; },
      get start() { return player.start; },
      get duration() { return player.end - player.start; },
      get times() { return Array.from(player.run.times); },
    };
  }
}

async function main() {
  const THREE = await loadLibrary(), player = new Player(THREE, await loadRun());
  const loop = () => { requestAnimationFrame(loop); player.tick(); };
  player.tick();
  loop();
  element("message").hidden = true;
  window.replay = player.door();
  window.replayDone = true;
  if (!/[#&]paused\b/.test(location.hash) && !matchMedia("(prefers-reduced-motion: reduce)").matches) player.play();
}

window.addEventListener("error", (event) => { window.replayError = window.replayError || String(event.message); });
main().catch((error) => {
  window.replayError = String(error);
  document.body.className = "failed";
  element("message").hidden = false;
  element("message").textContent = `This replay cannot be shown.\n${error.message || error}`;
  console.error(error);
});
