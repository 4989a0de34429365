// Friction at its position: rings with the color of the mode and the used part of the limit, cones of contacts, flashes of impacts.

const RING_SEGMENTS = 24; // segments of a ring
const MAX_FLASHES = 24;
const SLIP_THICKNESS = 0.12, STICK_THICKNESS = 0.26; // thickness of a ring, by its radius

class Elements {
  constructor(THREE, run, world, groups, marks) {
    Object.assign(this, { THREE, run, groups, marks, items: run.elements.map((item) => ({ ...item, shown: true })) });
    const matte = (more) => new THREE.MeshStandardMaterial({ roughness: 0.7, ...more }), faint = { transparent: true, opacity: 0.28, depthWrite: false, side: THREE.DoubleSide };
    const piece = new THREE.CylinderGeometry(1, 1, 1, 6).rotateX(Math.PI / 2).translate(0, 0, 0.5);
    this.rings = new Pool(THREE, world, piece, matte(), RING_SEGMENTS * this.items.length, 0.35);
    const cone = new THREE.ConeGeometry(1, 1, 36, 1, true).rotateX(-Math.PI / 2).translate(0, 0, 0.5); // apex at the origin, opening along z
    this.cones = new Pool(THREE, world, cone, matte(faint), this.items.length);
    const strikes = run.events.kinds.indexOf("impact"), { events } = run;
    this.impacts = strikes < 0 ? [] : [...events.times].map((time, k) => ({ time, name: events.elements[events.element[k]], kind: events.kind[k], impulse: events.impulse[k] })).filter((event) => event.kind === strikes);
    this.hardest = Math.max(1e-300, ...this.impacts.map(({ impulse }) => impulse));
    this.flashes = new Pool(THREE, world, new THREE.SphereGeometry(1, 16, 12), new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.55, depthWrite: false }), this.impacts.length ? MAX_FLASHES : 0);
    for (let k = 0; k < this.flashes.count; k++) this.flashes.color(k, linearColor(THREE, run.looks.events.impact.color));
  }

  /** Mode of an element at a time. */
  mode(item, time) {
    const { starts, modes } = this.run.modes[item.band];
    return modes[lastBelow(starts, time)];
  }

  update(at, time, radius, arrows, reach) {
    const { THREE, run } = this, z = new THREE.Vector3(0, 0, 1), blend = (values) => (1 - at.part) * values[at.k] + at.part * values[at.next];
    this.items.forEach((item, i) => {
      const mode = this.mode(item, time), look = run.looks.modes[mode] || run.looks.no_mode, color = linearColor(THREE, look.color), rest = linearColor(THREE, "#d7dee8");
      const place = new THREE.Vector3(...threeAt(item.point, at)).applyMatrix4(this.groups[item.joint].matrixWorld);
      const axis = new THREE.Vector3(...threeAt(item.axis, at)).transformDirection(this.groups[item.axis_joint].matrixWorld);
      const shown = item.shown && (item.stays || mode !== 2);
      const turn = new THREE.Quaternion().setFromUnitVectors(z, axis), filled = item.share ? Math.max(blend(item.share), 1 / RING_SEGMENTS) : 1;
      this.drawRing(i, shown, place, turn, radius, mode === 0 ? STICK_THICKNESS : SLIP_THICKNESS, (k) => ((k + 0.5) / RING_SEGMENTS < filled ? color : rest));
      const height = item.normal && item.mu && arrows.shown ? reach * arrows.scale * Math.min(Math.max(blend(item.normal), 0) / (arrows.largest.N || 1), 1.6) : 0;
      if (!shown || !(height > 0) || mode === 2) { this.cones.hide(i); return; }
      this.cones.color(i, color);
      this.cones.set(i, new THREE.Matrix4().compose(place, turn, new THREE.Vector3(item.mu * height, item.mu * height, height)));
    });
    this.drawFlashes(time, radius);
  }

  drawRing(i, shown, place, turn, radius, thick, colorOf) {
    const { THREE } = this, matrix = new THREE.Matrix4(), z = new THREE.Vector3(0, 0, 1);
    const point = (k) => new THREE.Vector3(Math.cos((2 * Math.PI * k) / RING_SEGMENTS), Math.sin((2 * Math.PI * k) / RING_SEGMENTS), 0).multiplyScalar(radius).applyQuaternion(turn).add(place);
    for (let k = 0; k < RING_SEGMENTS; k++) {
      if (!shown) { this.rings.hide(RING_SEGMENTS * i + k); continue; }
      const from = point(k), way = point(k + 1).sub(from), length = way.length() || 1e-12;
      this.rings.color(RING_SEGMENTS * i + k, colorOf(k));
      this.rings.set(RING_SEGMENTS * i + k, matrix.compose(from, new THREE.Quaternion().setFromUnitVectors(z, way.divideScalar(length)), new THREE.Vector3(thick * radius, thick * radius, 1.05 * length)));
    }
  }

  /** Colors of the segments of a ring, in the notation of the style. */
  ringColors(i) {
    const color = new this.THREE.Color();
    return Array.from({ length: RING_SEGMENTS }, (_, k) => { this.rings.mesh.getColorAt(RING_SEGMENTS * i + k, color); return `#${color.convertLinearToSRGB().getHexString()}`; });
  }

  /** Draws recent impacts as shrinking spheres with a size by the impulse. */
  drawFlashes(time, radius) {
    this.flashing = 0;
    if (!this.flashes.count) return;
    const { THREE, run } = this, lasting = 0.02 * (run.times[run.times.length - 1] - run.times[0]);
    const near = this.impacts.filter((event) => event.time <= time && time - event.time < lasting).slice(-MAX_FLASHES);
    for (let k = 0; k < MAX_FLASHES; k++) {
      const points = near[k] ? this.marks.items.filter((item) => item.contact === near[k].name) : [];
      const mark = points.find((item) => !item.apart) || points[0]; // a contact that bounces is open again
      if (!mark) { this.flashes.hide(k); continue; }
      this.flashing += 1;
      const size = 2.5 * radius * (1 - (time - near[k].time) / lasting) * Math.max(Math.sqrt(near[k].impulse / this.hardest), 0.25);
      this.flashes.set(k, new THREE.Matrix4().compose(mark.places[0], new THREE.Quaternion(), new THREE.Vector3(size, size, size)));
    }
  }
}
