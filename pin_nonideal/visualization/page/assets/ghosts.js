// Other runs: ghosts over the first run, or beside it, on one time axis.

const MAX_SOLID_GHOSTS = 4; // a larger number of ghosts is fainter

class Ghosts {
  constructor(THREE, run, world) {
    Object.assign(this, { THREE, apart: false });
    this.items = run.others.map((other, i) => {
      const root = new THREE.Group(), color = new THREE.Color(run.looks.curves[(i + 1) % run.looks.curves.length]);
      world.add(root);
      const tint = [color.r, color.g, color.b, run.others.length > MAX_SOLID_GHOSTS ? 0.18 : 0.45];
      return { name: other.name, root, tint, shown: true, run: other, kinematics: new Kinematics(THREE, other, root) };
    });
  }

  /** Entries of the ghosts for `Bodies`. */
  entries() {
    return this.items.flatMap(({ run, kinematics, tint }, i) => run.visuals.map((visual) => ({ visual, kinematics, tint, run: i + 1 })));
  }

  /** Poses all ghosts; a run that has ended keeps its last pose. */
  pose(time) {
    for (const { kinematics } of this.items) kinematics.pose(kinematics.at(time));
  }

  poses() { return this.items.map(({ name, kinematics }) => ({ name, joints: kinematics.poses() })); }

  setApart(apart, view, up) {
    const right = up.clone().cross(new this.THREE.Vector3(...view.direction)).normalize(), along = view.outline.map((point) => right.dot(new this.THREE.Vector3(...point)));
    const step = 1.1 * (Math.max(...along) - Math.min(...along));
    this.apart = apart;
    this.items.forEach((item, i) => item.root.position.copy(right).multiplyScalar(apart ? (i + 1) * step : 0));
  }

  /** Displacements of the runs beside the first. */
  offsets() { return this.apart ? this.items.map((item) => item.root.position) : []; }

  /** Positions of the joints of all runs at some times, for framing. */
  outline() {
    const places = [];
    for (const { kinematics } of this.items)
      for (let part = 0; part <= 10; part++) {
        const { times, groups } = kinematics;
        kinematics.pose(kinematics.at(times[0] + (part / 10) * (times[times.length - 1] - times[0])));
        for (const group of groups.slice(1)) places.push(new this.THREE.Vector3().setFromMatrixPosition(group.matrixWorld));
      }
    return places;
  }
}
