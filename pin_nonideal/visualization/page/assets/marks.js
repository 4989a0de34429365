// Marks of constraints and springs: balls at anchors and contacts, rods, coils.

class Marks {
  constructor(THREE, run, world, groups, looks) {
    Object.assign(this, { THREE, groups, looks });
    this.items = run.marks.map((mark) => ({
      ...mark, shown: true, points: [new THREE.Vector3(...mark.point1), new THREE.Vector3(...mark.point2)], places: [new THREE.Vector3(), new THREE.Vector3()],
    }));
    const shiny = () => new THREE.MeshStandardMaterial({ roughness: 0.6 });
    const along = (geometry) => geometry.rotateX(Math.PI / 2).translate(0, 0, 0.5);
    const links = (kind) => this.items.filter((item) => item.kind === kind).length;
    this.balls = new Pool(THREE, world, new THREE.SphereGeometry(1, 16, 10), shiny(), 2 * this.items.length, 0.3);
    this.rods = new Pool(THREE, world, along(new THREE.CylinderGeometry(1, 1, 1, 12)), shiny(), links("rod"));
    this.coils = new Pool(THREE, world, coilGeometry(THREE, 1), shiny(), links("spring"));
    const next = { rod: 0, spring: 0 };
    this.items.forEach((item, i) => {
      item.link = item.kind in next ? next[item.kind]++ : null;
      for (const side of [0, 1]) this.balls.color(2 * i + side, linearColor(THREE, looks.marks[item.kind]));
      if (item.kind === "rod") this.rods.color(item.link, linearColor(THREE, looks.marks.rod));
      if (item.kind === "spring") this.coils.color(item.link, linearColor(THREE, "#94a3b8"));
    });
  }

  /** Computes the end points of all marks between two frames, and hides undefined ones. */
  place(at) {
    for (const item of this.items) {
      const { joint1, joint2, points, places, path, closed } = item;
      if (path) for (const point of points) point.set(...threeAt(path, at));
      item.apart = Boolean(closed && !closed[at.k]);
      places[0].copy(points[0]).applyMatrix4(this.groups[joint1].matrixWorld);
      places[1].copy(points[1]).applyMatrix4(this.groups[joint2].matrixWorld);
    }
  }

  /** Largest distance between the two points of an anchor, along its constrained axes [m]; null without anchors. */
  gap() {
    const tied = this.items.filter((item) => item.axes.length), axis = new this.THREE.Vector3();
    const gaps = tied.map(({ axes, joint2, places: [a, b] }) => {
      const apart = a.clone().sub(b);
      return Math.hypot(...axes.map((one) => axis.set(...one).transformDirection(this.groups[joint2].matrixWorld).dot(apart)));
    });
    return gaps.length ? Math.max(...gaps) : null;
  }

  /** Draws the marks; balls have the given radius [m]. */
  update(radius) {
    const { THREE } = this, flat = new THREE.Quaternion(), matrix = new THREE.Matrix4(), z = new THREE.Vector3(0, 0, 1);
    this.items.forEach((item, i) => {
      const size = radius * (item.link === null ? 1 : 0.65);
      item.places.forEach((place, side) => {
        const twin = side === 1 && item.kind === "contact";
        if (item.shown && !item.apart && !twin) this.balls.set(2 * i + side, matrix.compose(place, flat, new THREE.Vector3(size, size, size)));
        else this.balls.hide(2 * i + side);
      });
      if (item.link === null) return;
      const pool = item.kind === "rod" ? this.rods : this.coils, wide = radius * (item.kind === "rod" ? 0.35 : 1.3);
      const [from, to] = item.places, way = to.clone().sub(from), length = Math.max(way.length(), 1e-12);
      const turn = new THREE.Quaternion().setFromUnitVectors(z, way.divideScalar(length));
      if (item.shown) pool.set(item.link, matrix.compose(from, turn, new THREE.Vector3(wide, wide, length))); else pool.hide(item.link);
    });
  }
}
