// Panel: content of the scene, to search, show, hide, isolate and follow; signals to plot; views.

const VIEWS = { usual: null, front: [0, -1, 0.15], side: [1, 0, 0.15], top: [0, -0.02, 1] };

/** Lists of the items of each contact, which may have several points; other items stand alone. */
function byContact(items) {
  const lists = new Map();
  items.forEach((item, i) => { const key = item.contact || i; lists.set(key, [...(lists.get(key) || []), item]); });
  return lists.values();
}

class Panel {
  constructor(player) {
    Object.assign(this, { player, stage: player.stage, box: element("panel"), rows: [], chosen: new Map(), sections: new Map(), opened: null });
    this.fill();
    element("search").addEventListener("input", (event) => this.search(event.target.value));
    element("panel-toggle").addEventListener("click", () => this.toggle());
    for (const name of ["frames", "masses", "inertias", "collisions"]) this.addSwitch(name);
    element("fade").addEventListener("change", (event) => { this.stage.bodies.fade(event.target.checked ? 0.3 : 1); this.stage.dirty = true; });
    for (const [name, direction] of Object.entries(VIEWS)) {
      const button = element("views").appendChild(document.createElement("button"));
      button.textContent = name;
      button.addEventListener("click", () => this.stage.resetView(direction ? this.upright(direction) : undefined));
    }
    this.box.querySelectorAll("[data-show]").forEach((item) => item.addEventListener("change", () => this.stage.show(item.dataset.show, item.checked)));
  }

  toggle() {
    this.box.hidden = !this.box.hidden;
    element("panel-toggle").setAttribute("aria-expanded", String(!this.box.hidden));
    document.querySelector("main").classList.toggle("panel-open", !this.box.hidden);
    this.player.resize();
    if (!this.box.hidden) element("search").focus();
  }

  /** Rotates a direction given for z upwards to the up direction of the scene. */
  upright(direction) {
    const { THREE, up } = this.stage, turn = new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 0, 1), up);
    return new THREE.Vector3(...direction).applyQuaternion(turn).toArray();
  }

  addSwitch(name) {
    const input = element(`show-${name}`);
    input.disabled = name === "collisions" && !this.player.run.collisions.length;
    input.addEventListener("change", () => { this.stage.overlays.on[name] = input.checked; this.stage.dirty = true; });
  }

  fill() {
    const { run } = this.player, depth = [0];
    run.joints.forEach((joint, i) => { if (i) depth[i] = depth[joint.parent] + 1; });
    run.joints.forEach((joint, i) => {
      const own = this.stage.bodies.items.filter((item) => item.run === 0 && item.joint === i);
      if (!i && !own.length) return;
      this.addRow("bodies", i ? joint.name : "world", depth[i], own, i ? [["follow", () => this.follow(i)], ["path", () => this.path(i)]] : []);
    });
    for (const marks of byContact(this.stage.marks.items)) this.addRow("constraints", `${marks[0].contact || marks[0].name} (${marks[0].kind})`, 0, marks);
    for (const guide of this.stage.guides.items) this.addRow("constraints", `${guide.name} (${guide.kind})`, 0, [guide]);
    for (const items of byContact(this.stage.elements.items)) this.addRow("elements", items[0].contact || items[0].name, 0, items);
    for (const arrow of this.stage.arrows.items) this.addRow("arrows", `${arrow.name}, ${arrow.kind} [${arrow.unit}]`, 0, [arrow]);
    run.signals.forEach((signal) => this.addSignal(signal));
    run.relations.forEach((relation) => this.addRelation(relation));
    for (const group of ["bodies", "constraints", "elements", "arrows", "signals", "relations"]) element(`tree-${group}`).parentElement.hidden = !element(`tree-${group}`).children.length;
  }

  /** Adds a row of the tree: a box that shows or hides its items, a button that hides all others of the group, and other buttons. */
  addRow(group, name, depth, items, actions = []) {
    const row = document.createElement("li"), label = document.createElement("label"), input = document.createElement("input");
    input.type = "checkbox"; input.checked = true;
    label.style.paddingLeft = `${Math.min(depth, 12) * 9}px`;
    label.append(input, name);
    row.append(label);
    const set = (shown) => { input.checked = shown; for (const item of items) if (group === "arrows") item.visible = shown; else item.shown = shown; };
    input.addEventListener("change", () => { set(input.checked); this.redraw(); });
    const only = () => { for (const other of this.rows) if (other.group === group) other.set(other.row === row); this.redraw(); };
    for (const [text, action] of [["only", only], ...actions]) {
      const button = row.appendChild(document.createElement("button"));
      button.textContent = text;
      button.setAttribute("aria-label", `${text} ${name}`);
      button.addEventListener("click", action);
    }
    element(`tree-${group}`).append(row);
    this.rows.push({ group, name, row, set });
  }

  redraw() { this.player.seek(this.player.time); }

  follow(joint) { this.stage.follow(joint); this.player.showToggles(); }

  /** Draws or removes the path of a body's center of mass. */
  path(joint) {
    const { guides } = this.stage, line = guides.trails.get(joint);
    if (line) line.mesh.visible = !line.mesh.visible; else { guides.addTrail(joint, this.player.run.joints[joint].lever); this.stage.resize(); }
    this.redraw();
  }

  /** A row with a box that plots something, in a list. */
  addChoice(list, group, text, words, checked, plot) {
    const row = document.createElement("li"), label = row.appendChild(document.createElement("label")), input = document.createElement("input");
    input.type = "checkbox";
    input.checked = checked;
    label.append(input, text);
    input.addEventListener("change", () => plot(input.checked));
    list.append(row);
    this.rows.push({ group, name: words, row, set: () => {} });
  }

  addSignal(signal) {
    const { label, unit, section, words } = signal;
    this.addChoice(this.section(section), "signals", unit ? `${label} [${unit}]` : label, `${label} ${words} ${section}`, false, (on) => this.plot(signal, on));
  }

  /** The list of a section of signals. */
  section(name) {
    const known = this.sections.get(name);
    if (known) return known;
    const box = element("tree-signals").appendChild(document.createElement("details")), title = box.appendChild(document.createElement("summary"));
    title.textContent = name;
    const list = box.appendChild(document.createElement("ul"));
    this.sections.set(name, list);
    return list;
  }

  /** Adds a signal to the plot of its unit, or removes it; a plot that was made for it is removed when it is empty. */
  plot(signal, wanted) {
    const { player } = this;
    if (wanted) {
      let plot = player.plots.find((one) => !one.log && !one.bounds && one.unit === signal.unit);
      if (!plot) {
        plot = player.newPlot({ title: "Chosen", unit: signal.unit, note: "", log: false, t: signal.t, curves: [], made: true });
        player.plots.push(plot);
      }
      const curve = plot.add({ label: signal.label, t: signal.t, values: signal.values });
      this.chosen.set(signal, { plot, curve });
      this.show(plot);
    } else {
      const { plot, curve } = this.chosen.get(signal);
      this.chosen.delete(signal);
      plot.remove(curve);
      if (plot.made && !plot.curves.length) this.drop(plot);
    }
    player.resize();
    player.showToggles();
  }

  addRelation(relation) {
    const { player } = this, words = { friction: "friction over velocity torque law", load: "friction over load law", phase: "phase plane velocity over position" };
    const add = () => {
      const plot = new Relation(relation, element("plots"), player.run.looks.curves, player.seekByHand);
      player.plots.push(plot);
      this.chosen.set(relation, { plot });
      return plot;
    };
    if (relation.shown) add();
    this.addChoice(element("tree-relations"), "relations", relation.name, `${relation.name} ${words[relation.name.split(" ")[0]]}`, relation.shown, (on) => {
      if (on) this.show(add()); else { this.drop(this.chosen.get(relation).plot); this.chosen.delete(relation); }
      player.resize();
      player.showToggles();
    });
  }

  /** Scrolls a plot into view. */
  show(plot) {
    element("plots").classList.remove("off");
    element("plots-toggle").hidden = false;
    this.player.resize();
    plot.box.scrollIntoView({ block: "nearest" });
  }

  drop(plot) {
    plot.box.remove();
    this.player.plots.splice(this.player.plots.indexOf(plot), 1);
  }

  /** Leaves the rows that have all words of a text, and opens the sections that hold them. */
  search(text) {
    const wanted = text.trim().toLowerCase().split(/\s+/).filter(Boolean);
    for (const { name, row } of this.rows) row.hidden = !wanted.every((word) => name.toLowerCase().includes(word));
    const boxes = [...this.box.querySelectorAll("details")];
    if (wanted.length && !this.opened) this.opened = new Map(boxes.map((box) => [box, box.open]));
    for (const box of boxes) {
      const rows = [...box.querySelectorAll("li")], hits = rows.some((row) => !row.hidden);
      if (rows.length) box.hidden = !hits;
      if (wanted.length) box.open = hits; else if (this.opened) box.open = this.opened.get(box);
    }
    if (!wanted.length) this.opened = null;
  }
}
