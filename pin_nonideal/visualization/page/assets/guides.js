// Geometry of user constraints on a point: a curve, a surface, or the disk of allowed directions; and trails.

/** Checks if more than half of the corners of a path exceed 0.6 rad, because its frames are too far apart. */
function ragged(places) {
  const count = places.length / 3 - 2, step = (k) => [0, 1, 2].map((c) => places[3 * k + 3 + c] - places[3 * k + c]);
  let turned = 0;
  for (let k = 0; k < count; k++) {
    const a = step(k), b = step(k + 1), along = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    if (along < Math.cos(0.6) * Math.hypot(...a) * Math.hypot(...b)) turned++;
  }
  return turned > 0.5 * count;
}

class Guides {
  constructor(THREE, run, world, kinematics, looks) {
    Object.assign(this, { THREE, run, kinematics, items: [], lines: [] });
    for (const guide of run.guides) {
      const group = new THREE.Group();
      world.add(group);
      if (guide.kind === "disk") this.addDisk(group, guide, looks); else this.addSheet(group, guide, looks);
      this.items.push({ ...guide, group, shown: true });
    }
    this.trails = new Map();
    this.world = world;
    for (const trail of run.trails.slice(0, 12)) this.addTrail(trail.joint, trail.point);
  }

  /** Adds the path of a point on a joint, bold for the past and faint for the future; no path if frames are too sparse. */
  addTrail(joint, point) {
    const { places, times } = [3000, 20000].map((most) => this.kinematics.path(joint, point, most)).find((path) => !ragged(path.places)) || {};
    if (!places) return;
    const line = new WideLine(this.THREE, this.world, places, times, this.run.looks.curves[(joint + 2) % this.run.looks.curves.length], 2.2);
    this.lines.push(line);
    this.trails.set(joint, line);
  }

  addSheet(group, guide, looks) {
    const { THREE } = this, { points, columns } = guide, rows = points.length / 3 / columns;
    const line = (places, width) => this.lines.push(new WideLine(THREE, group, places, null, looks.marks.guide, width));
    const at = (row, column) => Array.from(points.subarray(3 * (row * columns + column), 3 * (row * columns + column) + 3));
    const middle = [];
    for (let row = 0; row < rows; row++) middle.push(...(columns === 2 ? at(row, 0).map((x, k) => (x + at(row, 1)[k]) / 2) : at(row, (columns - 1) >> 1)));
    if (columns < 3) line(middle, 2);
    if (columns < 2) return;
    const index = [];
    for (let row = 0; row + 1 < rows; row++)
      for (let c = 0; c + 1 < columns; c++) { const a = row * columns + c; index.push(a, a + 1, a + columns, a + columns, a + 1, a + columns + 1); }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(points, 3));
    geometry.setIndex(index);
    geometry.computeVertexNormals();
    const mesh = new THREE.Mesh(geometry, new THREE.MeshStandardMaterial({
      color: linearColor(THREE, looks.marks.guide), side: THREE.DoubleSide, transparent: true, opacity: 0.5, depthWrite: false, roughness: 0.8,
    }));
    mesh.receiveShadow = true;
    group.add(mesh);
  }

  addDisk(group, guide, looks) {
    const { THREE } = this;
    const disk = new THREE.Mesh(new THREE.CircleGeometry(guide.size, 48), new THREE.MeshStandardMaterial({
      color: linearColor(THREE, looks.marks.guide), side: THREE.DoubleSide, transparent: true, opacity: 0.45, depthWrite: false,
    }));
    group.add(disk);
  }

  update(at, time) {
    const { THREE, run } = this, blend = (values, i) => (1 - at.part) * values[3 * at.k + i] + at.part * values[3 * at.next + i];
    for (const { group, kind, joint, point, shift, normals, shown } of this.items) {
      group.visible = shown;
      if (shift) group.position.set(blend(shift, 0), blend(shift, 1), blend(shift, 2));
      if (kind !== "disk") continue;
      group.position.set(...point).applyMatrix4(this.kinematics.groups[joint].matrixWorld);
      const normal = new THREE.Vector3(blend(normals, 0), blend(normals, 1), blend(normals, 2));
      group.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), normal.normalize());
    }
    for (const line of this.trails.values()) line.uniforms.now.value = time + 1e-6 * (run.times[run.times.length - 1] - run.times[0]);
  }

  resize(width, height) {
    for (const line of this.lines) line.uniforms.pixels.value.set(width / 2, height / 2);
  }
}
