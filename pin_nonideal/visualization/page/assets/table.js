// Table of forces: a row for each point of action, a column for each part.

/** Writes which rows of a scrolled box are visible; `ends` are their lower ends in its content [pixels]. */
function writeRange(note, box, ends) {
  const whole = box.scrollHeight <= box.clientHeight + 1, top = box.scrollTop, middle = (k) => ((ends[k - 1] || 0) + ends[k]) / 2;
  const seen = ends.map((_, k) => k + 1).filter((row) => middle(row - 1) > top && middle(row - 1) < top + box.clientHeight);
  note.hidden = whole || !seen.length;
  note.textContent = note.hidden ? "" : `${seen[0]} to ${seen[seen.length - 1]} of ${ends.length} ↕`;
  note.title = "scroll for more";
}

class ForceTable {
  constructor(run, arrows, box) {
    Object.assign(this, { arrows, box });
    this.box.hidden = !arrows.items.length;
    const kinds = [...new Set(arrows.items.map((arrow) => arrow.kind))], table = box.querySelector("table"), head = table.createTHead().insertRow();
    const corner = document.createElement("th");
    corner.textContent = "at";
    head.append(corner);
    for (const kind of kinds) {
      const cell = document.createElement("th");
      cell.scope = "col";
      cell.textContent = kind;
      cell.style.setProperty("--swatch", run.looks.forces[kind]);
      head.append(cell);
    }
    this.ends = [];
    this.scroll = box.querySelector(".scroll");
    this.scroll.addEventListener("scroll", () => this.writeRange());
    this.parts = arrows.items.length <= 6; // few enough to show components too
    this.cells = [];
    const rows = new Map(), body = table.createTBody();
    for (const arrow of arrows.items) {
      const key = `${arrow.name} ${arrow.unit}`;
      if (!rows.has(key)) {
        const row = body.insertRow();
        const name = row.insertCell();
        name.textContent = name.title = arrow.name;
        for (const _ of kinds) row.insertCell();
        rows.set(key, row);
      }
      this.cells.push([arrow, rows.get(key).cells[1 + kinds.indexOf(arrow.kind)]]);
    }
  }

  /** Shortens names in their middle, since their ends differ, and ends the visible part below a whole row. */
  fit() {
    const { scroll } = this, names = [...this.box.querySelectorAll("tbody td:first-child")];
    if (!names.length || !scroll.clientWidth) return;
    const style = getComputedStyle(names[0]), c = document.createElement("canvas").getContext("2d");
    c.font = `${style.fontSize} ${style.fontFamily}`;
    for (const cell of names) cell.textContent = shortened(c, cell.title, parseFloat(style.maxWidth) - 2);
    scroll.style.maxHeight = "";
    this.ends = [];
    this.writeRange();
    if (scroll.scrollHeight <= scroll.clientHeight + 1) return;
    const top = scroll.getBoundingClientRect().top, ends = [...scroll.querySelectorAll("tr")].map((row) => row.getBoundingClientRect().bottom - top + scroll.scrollTop);
    const last = ends.filter((end) => end <= scroll.clientHeight + 0.5).pop();
    if (last) scroll.style.maxHeight = `${last}px`;
    this.ends = ends.slice(1); // the first row is the head
    this.writeRange();
  }

  writeRange() { writeRange(this.box.querySelector(".range"), this.scroll, this.ends); }

  update() {
    for (const [arrow, cell] of this.cells) {
      const text = `${steady(arrow.value)} ${arrow.unit}`, parts = arrow.axis ? "" : `(${arrow.vector.toArray().map((x) => readable(Math.abs(x) < 1e-9 * arrow.value ? 0 : x)).join(", ")})`;
      cell.textContent = text;
      cell.title = parts;
      if (this.parts && parts) cell.appendChild(document.createElement("small")).textContent = parts;
    }
  }
}
