// Forces as arrows, moments as arcs, each with its number.

const ARC = { steps: 22, sweep: (300 * Math.PI) / 180 };
const MAX_LABELS = 40;

class Arrows {
  constructor(THREE, run, world, kinematics, labels) {
    Object.assign(this, { THREE, run, kinematics, shown: true, scale: 1, labels });
    const straight = run.arrows.filter((arrow) => arrow.unit === "N").length, arcs = run.arrows.length - straight;
    const material = () => new THREE.MeshStandardMaterial({ roughness: 0.6, emissive: new THREE.Color(0.08, 0.08, 0.08) });
    const shaft = () => new THREE.CylinderGeometry(1, 1, 1, 10).rotateX(Math.PI / 2).translate(0, 0, 0.5);
    const head = new THREE.ConeGeometry(2.6, 7, 14).rotateX(Math.PI / 2).translate(0, 0, 3.5);
    this.shafts = new Pool(THREE, world, shaft(), material(), straight + arcs * ARC.steps, 0.55);
    this.heads = new Pool(THREE, world, head, material(), straight + arcs, 0.55);
    let next = 0;
    this.items = run.arrows.map((arrow, i) => {
      const moment = arrow.unit === "N m", item = { ...arrow, moment, head: i, first: next, visible: true, value: 0 };
      next += moment ? ARC.steps : 1;
      Object.assign(item, { vector: new THREE.Vector3(), tip: new THREE.Vector3(), place: new THREE.Vector3(), along: new THREE.Vector3() });
      const color = linearColor(THREE, run.looks.forces[arrow.kind]);
      this.heads.color(i, color);
      for (let k = item.first; k < next; k++) this.shafts.color(k, color);
      return item;
    });
    this.spans = this.items.slice(0, MAX_LABELS).map(() => labels.appendChild(document.createElement("span")));
    this.measure();
  }

  /** Sets the scale of lengths to the largest value without the top percent, which may be a peak. */
  measure() {
    this.largest = {};
    for (const unit of ["N", "N m"]) {
      const sizes = [];
      for (const arrow of this.items.filter((item) => item.unit === unit))
        for (let k = 0; k < this.run.times.length; k++) sizes.push(arrow.axis ? Math.abs(arrow.values[k]) : Math.hypot(...arrow.values.subarray(3 * k, 3 * k + 3)));
      sizes.sort((a, b) => a - b);
      this.largest[unit] = sizes[Math.floor(0.99 * (sizes.length - 1))] || sizes[sizes.length - 1] || 1;
    }
  }

  /** Computes values and positions at a time, before drawing. */
  place(at) {
    for (const arrow of this.items) {
      const world = this.kinematics.drawn(arrow.joint);
      if (!arrow.origin) arrow.place.setFromMatrixPosition(world);
      else arrow.place.set(...threeAt(arrow.origin, at)).applyMatrix4(world);
      if (arrow.axis) {
        arrow.value = (1 - at.part) * arrow.values[at.k] + at.part * arrow.values[at.next];
        arrow.vector.set(...arrow.axis).transformDirection(world).multiplyScalar(arrow.value);
      } else {
        arrow.vector.set(...threeAt(arrow.values, at));
        arrow.value = arrow.vector.length();
      }
      arrow.share = arrow.vector.length() / this.largest[arrow.unit];
      arrow.drawn = this.shown && arrow.visible && arrow.share > 0.004;
    }
  }

  /** Draws all arrows: `reach` [m]: length of the largest arrow, `thick` [m]: thickness of the shafts. */
  update(reach, thick) {
    for (const arrow of this.items) {
      if (!arrow.drawn) {
        this.heads.hide(arrow.head);
        for (let k = 0; k < (arrow.moment ? ARC.steps : 1); k++) this.shafts.hide(arrow.first + k);
      } else if (arrow.moment) this.drawArc(arrow, 0.3 * reach * Math.min(this.scale, 2), thick);
      else this.drawStraight(arrow, reach * this.scale * Math.min(arrow.share, 1.6), thick);
    }
  }

  drawStraight(arrow, length, thick) {
    const { THREE } = this, wide = Math.min(thick, length / 10), matrix = new THREE.Matrix4();
    arrow.along.copy(arrow.vector).normalize();
    const turn = new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 0, 1), arrow.along);
    this.shafts.set(arrow.first, matrix.compose(arrow.place, turn, new THREE.Vector3(wide, wide, Math.max(length - 7 * wide, 1e-9))));
    arrow.tip.copy(arrow.place).addScaledVector(arrow.along, length);
    this.heads.set(arrow.head, matrix.compose(arrow.place.clone().addScaledVector(arrow.along, length - 7 * wide), turn, new THREE.Vector3(wide, wide, wide)));
  }

  /** Draws an arc about the moment; its angle is proportional to the moment, up to 300 degrees. */
  drawArc(arrow, radius, thick) {
    const { THREE } = this, matrix = new THREE.Matrix4(), z = new THREE.Vector3(0, 0, 1), wide = Math.min(thick, radius / 9);
    const axis = arrow.vector.clone().normalize(), opened = Math.min(arrow.share * Math.min(this.scale, 1), 1) * ARC.sweep;
    const turn = new THREE.Quaternion().setFromUnitVectors(z, axis), step = opened / ARC.steps;
    const point = (angle) => new THREE.Vector3(radius * Math.cos(angle), radius * Math.sin(angle), 0).applyQuaternion(turn).add(arrow.place);
    let from = point(0);
    for (let k = 0; k < ARC.steps; k++) {
      const to = point((k + 1) * step), way = to.clone().sub(from), length = way.length() || 1e-9;
      this.shafts.set(arrow.first + k, matrix.compose(from, new THREE.Quaternion().setFromUnitVectors(z, way.divideScalar(length)), new THREE.Vector3(wide, wide, 1.05 * length)));
      from = to;
    }
    const small = wide * Math.max(Math.min(1, (opened * radius) / (9 * wide)), 0.05);
    arrow.along.set(-Math.sin(opened), Math.cos(opened), 0).applyQuaternion(turn);
    this.heads.set(arrow.head, matrix.compose(from, new THREE.Quaternion().setFromUnitVectors(z, arrow.along), new THREE.Vector3(small, small, small)));
    arrow.tip.copy(from).addScaledVector(arrow.along, 7 * small);
  }

  /**
   * Places numbers beyond the tips, or beside or before covered tips, larger ones first; numbers without space are hidden.
   * cards: boxes over the view, as left, top, right, bottom in pixels, which no number overlaps.
   */
  placeLabels(onScreen, cards) {
    const drawn = this.items.filter((arrow) => arrow.drawn).sort((a, b) => b.share - a.share), taken = [];
    const ends = drawn.map((arrow) => [onScreen(arrow.place), onScreen(arrow.tip)]), spots = ends.flat().filter(Boolean);
    for (const span of this.spans) span.style.visibility = "hidden";
    drawn.forEach((arrow, i) => {
      const tip = ends[i][1], base = onScreen(arrow.tip.clone().sub(arrow.along.clone().multiplyScalar(1e-2 * (arrow.tip.distanceTo(arrow.place) || 1))));
      if (!tip || !base || taken.length >= this.spans.length) return;
      const way = Math.hypot(tip[0] - base[0], tip[1] - base[1]) || 1, dx = (tip[0] - base[0]) / way, dy = (tip[1] - base[1]) / way;
      const text = `${steady(arrow.value)} ${arrow.unit}`, half = 3.3 * text.length + 4;
      const beside = ([x, y]) => !cards.some(([left, top, right, bottom]) => x + half > left && x - half < right && y + 9 > top && y - 9 < bottom);
      const free = ([x, y]) => beside([x, y]) && !taken.some(([a, b, w]) => Math.abs(x - a) < half + w && Math.abs(y - b) < 17) && !spots.some(([a, b]) => Math.abs(x - a) < half && Math.abs(y - b) < 12);
      const found = [[dx, dy], [dy, -dx], [-dy, dx], [-dx, -dy]].map(([u, v]) => [tip[0] + u * (half + 8), tip[1] + v * 18]).find(free);
      if (!found) return;
      const span = this.spans[taken.length], [x, y] = found;
      taken.push([x, y, half]);
      span.textContent = text;
      span.place = found;
      span.style.cssText = `color: ${this.run.looks.forces[arrow.kind]}; transform: translate(${x}px, ${y}px) translate(-50%, -50%)`;
    });
  }
}
