// Optional overlays on the bodies: axes of joints, centers of mass, boxes of inertia, collision shapes.

const AXIS_COLORS = ["#dc2626", "#16a34a", "#2563eb"];

class Overlays {
  constructor(THREE, run, world, kinematics, size) {
    Object.assign(this, { THREE, run, kinematics, on: { frames: false, masses: false, inertias: false, collisions: false } });
    const bodies = run.joints.map((joint, i) => ({ joint, i })).filter(({ i }) => i), matte = () => new THREE.MeshStandardMaterial({ roughness: 0.7 });
    const rod = new THREE.CylinderGeometry(0.05, 0.05, 1, 8).rotateX(Math.PI / 2).translate(0, 0, 0.5);
    this.axes = new Pool(THREE, world, rod, matte(), 3 * bodies.length, 0.4);
    this.turns = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((way) => new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 0, 1), new THREE.Vector3(...way)));
    bodies.forEach((_, b) => AXIS_COLORS.forEach((color, k) => this.axes.color(3 * b + k, linearColor(THREE, color))));
    this.heavy = bodies.filter(({ joint }) => joint.mass > 0);
    this.balls = new Pool(THREE, world, new THREE.SphereGeometry(1, 14, 10), matte(), this.heavy.length, 0.5);
    this.heavy.forEach((_, i) => this.balls.color(i, linearColor(THREE, "#111827")));
    this.boxes = new Pool(THREE, world, new THREE.BoxGeometry(1, 1, 1), new THREE.MeshStandardMaterial({ transparent: true, opacity: 0.35, depthWrite: false }), this.heavy.length);
    this.heavy.forEach((_, i) => this.boxes.color(i, linearColor(THREE, "#7c3aed")));
    const solid = run.collisions.map((visual) => ({ visual, kinematics, tint: [0.02, 0.6, 0.4, 0.4], run: 0 }));
    this.solids = new Bodies(THREE, run.shapes, solid, world, size);
    this.bodies = bodies;
  }

  /** Draws the enabled overlays: axes of length `reach` [m], balls with a radius [m]. */
  update(reach, radius) {
    const { THREE, on } = this, matrix = new THREE.Matrix4(), place = new THREE.Vector3(), turn = new THREE.Quaternion(), unit = new THREE.Vector3();
    this.bodies.forEach(({ i }, b) => {
      this.kinematics.groups[i].matrixWorld.decompose(place, turn, unit);
      this.turns.forEach((way, k) => (on.frames ? this.axes.set(3 * b + k, matrix.compose(place, turn.clone().multiply(way), unit.set(reach, reach, reach))) : this.axes.hide(3 * b + k)));
    });
    this.heavy.forEach(({ joint, i }, b) => {
      const world = this.kinematics.groups[i].matrixWorld, grown = radius * Math.cbrt(joint.mass / this.largestMass());
      if (on.masses) this.balls.set(b, matrix.compose(place.set(...joint.lever).applyMatrix4(world), turn.identity(), unit.set(grown, grown, grown))); else this.balls.hide(b);
      if (!on.inertias) { this.boxes.hide(b); return; }
      matrix.compose(place.set(...joint.lever), turn.set(...joint.inertia.turn), unit.set(...joint.inertia.edges.map((edge) => Math.max(edge, 1e-9))));
      this.boxes.set(b, matrix.premultiply(world));
    });
    for (const item of this.solids.items) item.shown = on.collisions;
    this.solids.update();
  }

  largestMass() { return (this.largest = this.largest || Math.max(...this.heavy.map(({ joint }) => joint.mass))); }
}
