// Kinematics of the bodies: one group for each joint, nested as the tree, posed by coordinates interpolated between the frames.

/** Weights of the frames k - 1, k, k + 1, k + 2 at a part of the interval [k, k + 1]: cubic Hermite interpolation with slopes of parabolas. */
function blendWeights(times, k, part) {
  const h = times[k + 1] - times[k], before = k > 0 ? times[k] - times[k - 1] : 0, after = k + 2 < times.length ? times[k + 2] - times[k + 1] : 0;
  const chord = [0, -1, 1, 0]; // slopes times h
  let left = chord, right = chord;
  if (before > 0) { const c = h / (before * (before + h)), d = before / (h * (before + h)); left = [-c * h, (c - d) * h, d * h, 0]; }
  if (after > 0) { const c = after / (h * (h + after)), d = h / (after * (h + after)); right = [0, -c * h, (c - d) * h, d * h]; }
  if (!(before > 0) && after > 0) left = chord.map((x, i) => 2 * x - right[i]);
  if (before > 0 && !(after > 0)) right = chord.map((x, i) => 2 * x - left[i]);
  const s = part, a = s * (1 - s) ** 2, b = -s * s * (1 - s), rise = s * s * (3 - 2 * s);
  return [0, 1 - rise, rise, 0].map((x, i) => x + a * left[i] + b * right[i]);
}

/** Rows of a matrix. */
const matrixRows = ({ elements: e }) => [0, 1, 2, 3].map((row) => [0, 1, 2, 3].map((column) => e[row + 4 * column]));

class Kinematics {
  constructor(THREE, run, root) {
    Object.assign(this, { THREE, run, root, times: run.times });
    this.groups = run.joints.map((joint, i) => {
      const group = new THREE.Group();
      group.name = joint.name;
      if (i) {
        joint.width = joint.axis ? 1 : 7;
        joint.base = new THREE.Matrix4().compose(new THREE.Vector3(...joint.place.slice(0, 3)), new THREE.Quaternion(...joint.place.slice(3)), new THREE.Vector3(1, 1, 1));
        joint.along = joint.axis && new THREE.Vector3(...joint.axis);
      }
      group.matrixAutoUpdate = false;
      return group;
    });
    run.joints.forEach((joint, i) => (i ? this.groups[joint.parent] : root).add(this.groups[i]));
    this.wraps = new Map((run.visuals || []).filter((visual) => visual.wrap).map((visual) => [visual.joint, visual.wrap]));
    this.one = new THREE.Vector3(1, 1, 1);
  }

  /** Returns the frames around a time, and their interpolation weights. */
  at(time) {
    const found = bracket(this.times, time);
    if (this.run.held && this.run.held[found.k] && found.part < 1) found.part = 0;
    found.weights = found.part > 0 && found.part < 1 ? blendWeights(this.times, found.k, found.part) : null;
    return found;
  }

  /** Coordinate c of a joint. */
  coordinate(joint, { k, next, part, weights }, c = 0) {
    const { values, width } = joint, last = values.length / width - 1;
    if (last === 0) return values[c];
    if (!weights) return values[width * (part < 1 ? k : next) + c];
    let sum = 0;
    for (let i = 0; i < 4; i++) if (weights[i]) sum += weights[i] * values[width * (k - 1 + i) + c];
    return sum;
  }

  /** Placement of a joint's frame in the frame of its parent. */
  local(joint, at, into) {
    const { THREE } = this, place = new THREE.Vector3(), turn = new THREE.Quaternion();
    if (joint.axis) {
      const value = this.coordinate(joint, at);
      if (joint.turning) turn.setFromAxisAngle(joint.along, value); else place.copy(joint.along).multiplyScalar(value);
    } else {
      const v = [0, 1, 2, 3, 4, 5, 6].map((c) => this.coordinate(joint, at, c));
      place.set(v[0], v[1], v[2]); turn.set(v[3], v[4], v[5], v[6]).normalize();
    }
    return into.compose(place, turn, this.one).premultiply(joint.base);
  }

  pose(at) {
    this.now = at;
    for (let i = 1; i < this.groups.length; i++) this.local(this.run.joints[i], at, this.groups[i].matrix);
    this.groups[0].parent.updateMatrixWorld(true);
  }

  /** Drawn placement of a joint: a belt with a repeated pattern stays within one rib of its start. */
  drawn(joint) {
    const world = this.groups[joint].matrixWorld, wrap = this.wraps.get(joint);
    if (!wrap) return world;
    const item = this.run.joints[joint], turns = Math.round(this.coordinate(item, this.now) / wrap);
    const away = item.along.clone().transformDirection(world).multiplyScalar(-turns * wrap);
    return new this.THREE.Matrix4().makeTranslation(away.x, away.y, away.z).multiply(world);
  }

  /** Placements of all joints in the world, by name. */
  poses() { return Object.fromEntries(this.groups.map((group) => [group.name, matrixRows(group.matrixWorld)])); }

  /** Path of a point on a joint over at most `most` frames, as a flat array, with the times of these frames. */
  path(joint, point, most) {
    const { THREE, run } = this, count = this.times.length, stride = Math.max(1, Math.ceil(count / most));
    const chain = [], frames = [], places = [], matrix = new THREE.Matrix4(), step = new THREE.Matrix4(), place = new THREE.Vector3();
    for (let i = joint; i; i = run.joints[i].parent) chain.unshift(run.joints[i]);
    for (let k = 0; k < count; k += stride) frames.push(k);
    if (frames[frames.length - 1] !== count - 1) frames.push(count - 1);
    for (const k of frames) {
      matrix.identity();
      for (const link of chain) matrix.multiply(this.local(link, { k, next: k, part: 0, weights: null }, step));
      place.set(...point).applyMatrix4(matrix);
      places.push(place.x, place.y, place.z);
    }
    return { places, times: frames.map((k) => this.times[k]) };
  }

  /** Center of mass of the joints in view, or the origin of one joint. */
  center(joint) {
    const { THREE, run } = this, sum = new THREE.Vector3(), place = new THREE.Vector3();
    if (joint) return sum.setFromMatrixPosition(this.groups[joint].matrixWorld);
    const kept = run.joints.map((item, i) => [item, i]).filter(([, i]) => i && run.view.stays[i]);
    let total = kept.reduce((mass, [item]) => mass + item.mass, 0), even = total === 0;
    if (even) total = kept.length || 1;
    for (const [item, i] of kept) sum.addScaledVector(place.set(...item.lever).applyMatrix4(this.groups[i].matrixWorld), (even ? 1 : item.mass) / total);
    return sum;
  }
}
