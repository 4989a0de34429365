// The three-dimensional view: bodies, marks and arrows of a run at any time.

const FORCE_COLORS = { total: "#0d9488", ideal: "#2563eb", nonideal: "#ea580c" };
const MARK_COLORS = { anchor: "#f59e0b", rod: "#f59e0b", spring: "#64748b", contact: "#f59e0b" };

class ReplayScene {
  constructor(THREE, run, canvas, labels) {
    Object.assign(this, { THREE, run, canvas, labels, time: run.times[0], forcesShown: true, forceScale: 1, dirty: true });
    try {
      this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    } catch (error) {
      throw new Error("this browser offers no WebGL; turn on hardware acceleration or use another browser");
    }
    this.renderer.outputEncoding = THREE.sRGBEncoding;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = THREE.PCFSoftShadowMap;
    this.world = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(32, 1, 0.01, 100);
    this.up = new THREE.Vector3(...run.view.up);
    this.size = run.view.size;
    this.following = run.view.follow;
    this.orbit = new Orbit(THREE, this.camera, canvas, run.view.up, () => { this.dirty = true; });
    this.addJoints();
    this.addVisuals();
    this.addMarks();
    this.addArrows();
    this.addLights();
    this.addGround();
    this.setTime(this.time);
    this.center = this.centroid();
    this.startCenter = this.center.clone();
  }

  addJoints() {
    this.joints = this.run.joints.map((joint) => {
      const group = new this.THREE.Group();
      group.name = joint.name;
      this.world.add(group);
      return group;
    });
  }

  addVisuals() {
    const { THREE, run } = this;
    const shapes = run.shapes.map((shape) => shapeGeometry(THREE, shape, this.size));
    const materials = new Map();
    const material = (color) => {
      const key = color.join();
      if (!materials.has(key)) materials.set(key, surface(THREE, color));
      return materials.get(key);
    };
    this.visuals = run.visuals.map((visual) => {
      const shape = run.shapes[visual.shape];
      const paint = shape.kind === "mesh" ? shape.parts.map(([, color]) => material(color || visual.color)) : material(visual.color);
      const mesh = new THREE.Mesh(shapes[visual.shape], paint);
      mesh.name = visual.name;
      mesh.castShadow = mesh.receiveShadow = shape.kind !== "plane" && visual.color[3] === 1;
      mesh.matrixAutoUpdate = false;
      mesh.matrix.set(...visual.placement);
      this.joints[visual.joint].add(mesh);
      return mesh;
    });
  }

  addMarks() {
    const { THREE, run, size } = this;
    const ball = new THREE.SphereGeometry(0.016 * size, 24, 16), end = new THREE.SphereGeometry(0.01 * size, 20, 14);
    this.marks = run.marks.map((mark) => {
      const item = { ...mark, ends: [], link: null };
      for (const [joint, point] of [[mark.joint1, mark.point1], [mark.joint2, mark.point2]]) {
        const dot = markMesh(THREE, mark.kind === "anchor" || mark.kind === "contact" ? ball : end, MARK_COLORS[mark.kind]);
        dot.position.set(...point);
        this.joints[joint].add(dot);
        item.ends.push(dot);
      }
      if (mark.kind === "rod")
        item.link = new THREE.Mesh(new THREE.CylinderGeometry(0.005 * size, 0.005 * size, 1, 16).rotateX(Math.PI / 2).translate(0, 0, 0.5), surface(THREE, MARK_COLORS.rod));
      if (mark.kind === "spring")
        item.link = new THREE.Mesh(coilGeometry(THREE, 0.022 * size), surface(THREE, "#94a3b8"));
      if (item.link) { item.link.castShadow = true; this.world.add(item.link); }
      return item;
    });
  }

  addArrows() {
    const { THREE, run, size } = this;
    this.largest = {};
    this.arrows = run.arrows.map((arrow) => {
      const item = { ...arrow, moment: arrow.unit === "N m" };
      item.drawing = new (item.moment ? ArcArrow : StraightArrow)(THREE, FORCE_COLORS[arrow.kind], size);
      const holder = new THREE.Group();
      holder.add(item.drawing.group);
      if (item.moment) holder.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), new THREE.Vector3(...arrow.axis));
      (item.moment ? this.joints[arrow.joint] : this.world).add(holder);
      item.holder = holder;
      item.label = document.createElement("span");
      item.label.style.color = FORCE_COLORS[arrow.kind];
      item.vector = new THREE.Vector3(); item.tip = new THREE.Vector3();
      return item;
    });
    // Lengths: the largest values but for the one percent that a peak may hold.
    for (const unit of ["N", "N m"]) {
      const sizes = [];
      for (const arrow of this.arrows.filter((a) => a.unit === unit))
        for (let k = 0; k < run.times.length; k++) sizes.push(arrow.moment ? Math.abs(arrow.values[k]) : Math.hypot(...arrow.values.subarray(3 * k, 3 * k + 3)));
      sizes.sort((a, b) => a - b);
      this.largest[unit] = sizes[Math.floor(0.99 * (sizes.length - 1))] || sizes[sizes.length - 1] || 1;
    }
    this.labels.append(...this.arrows.map((arrow) => arrow.label));
  }

  addLights() {
    const { THREE, run, size, up } = this;
    this.world.add(new THREE.HemisphereLight(0xf8fafc, 0x8a97a8, 0.6));
    const away = new THREE.Vector3(...run.view.direction);
    const right = up.clone().cross(away).normalize();
    this.sun = new THREE.DirectionalLight(0xfff6ea, 0.5);
    this.sunOffset = up.clone().multiplyScalar(1.3).addScaledVector(away, 0.7).addScaledVector(right, -0.75);
    const outline = (run.view.follow ? run.view.start : run.view.motion).map((point) => new THREE.Vector3(...point));
    const ball = new THREE.Box3().setFromPoints(outline).getBoundingSphere(new THREE.Sphere()), radius = 1.3 * ball.radius;
    this.sunOffset.setLength(4 * radius);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(2048, 2048);
    this.sun.shadow.radius = 4;
    this.sun.shadow.normalBias = 0.006 * size;
    Object.assign(this.sun.shadow.camera, { left: -radius, right: radius, top: radius, bottom: -radius, near: radius, far: 8 * radius });
    this.sunTarget = ball.center;
    const fill = new THREE.DirectionalLight(0xdbe8ff, 0.2);
    fill.position.copy(right).addScaledVector(away, 0.4).addScaledVector(up, 0.2);
    this.world.add(this.sun, this.sun.target, fill);
  }

  addGround() {
    const { THREE, run, up, size } = this;
    const exponent = Math.floor(Math.log10(size / 4)), lead = size / 4 / 10 ** exponent;
    this.cell = (lead >= 5 ? 5 : lead >= 2 ? 2 : 1) * 10 ** exponent;
    const ground = groundMesh(THREE, this.cell, 200 * this.cell * (run.view.follow ? 5 : 1) * 0.1);
    ground.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), up);
    this.ground = ground;
    this.world.add(ground);
  }

  /** Mean position of the joints, which the camera follows. */
  centroid() {
    const sum = new this.THREE.Vector3();
    for (const joint of this.joints.slice(1)) sum.add(joint.position);
    return sum.divideScalar(Math.max(this.joints.length - 1, 1));
  }

  setTime(time) {
    const { run } = this, at = bracket(run.times, time);
    this.time = time;
    run.joints.forEach((joint, i) => this.setPose(this.joints[i], joint.poses, at));
    this.world.updateMatrixWorld();
    for (const mark of this.marks) if (mark.link) this.setLink(mark);
    for (const arrow of this.arrows) this.setArrow(arrow, at);
    if (this.following && this.center) {
      const center = this.centroid();
      this.orbit.target.add(center).sub(this.center);
      this.orbit.place();
    }
    this.center = this.centroid();
    this.dirty = true;
  }

  setPose(group, poses, { k, next, part }) {
    const last = poses.length / 7 - 1, a = 7 * Math.min(k, last), b = 7 * Math.min(next, last);
    const { position: p, quaternion: r } = group;
    p.set(poses[a], poses[a + 1], poses[a + 2]);
    r.set(poses[a + 3], poses[a + 4], poses[a + 5], poses[a + 6]).normalize();
    if (part === 0 || a === b) return;
    p.lerp(new this.THREE.Vector3(poses[b], poses[b + 1], poses[b + 2]), part);
    r.slerp(new this.THREE.Quaternion(poses[b + 3], poses[b + 4], poses[b + 5], poses[b + 6]).normalize(), part);
  }

  setLink(mark) {
    const [from, to] = mark.ends.map((dot) => dot.getWorldPosition(new this.THREE.Vector3()));
    const along = to.sub(from), length = along.length();
    mark.link.position.copy(from);
    mark.link.scale.set(1, 1, Math.max(length, 1e-9));
    if (length > 0) mark.link.quaternion.setFromUnitVectors(new this.THREE.Vector3(0, 0, 1), along.divideScalar(length));
  }

  setArrow(arrow, { k, next, part }) {
    const blend = (values, i, width) => (1 - part) * values[width * k + i] + part * values[width * next + i];
    if (arrow.moment) {
      arrow.value = blend(arrow.values, 0, 1);
      const opened = (arrow.value / this.largest["N m"]) * Math.min(this.forceScale, 1.2);
      arrow.holder.visible = this.forcesShown && Math.abs(opened) > 0.01;
      arrow.drawing.set(opened);
      arrow.holder.updateMatrixWorld(true);
      arrow.tip.setFromMatrixPosition(arrow.drawing.head.matrixWorld);
      return;
    }
    arrow.vector.set(blend(arrow.values, 0, 3), blend(arrow.values, 1, 3), blend(arrow.values, 2, 3));
    arrow.value = arrow.vector.length();
    const relative = Math.min(arrow.value / this.largest.N, 1.6);
    const length = 0.3 * this.size * this.forceScale * relative;
    arrow.holder.visible = this.forcesShown && relative > 0.003;
    arrow.holder.position.set(blend(arrow.origin, 0, 3), blend(arrow.origin, 1, 3), blend(arrow.origin, 2, 3));
    if (!arrow.holder.visible) return;
    const along = arrow.vector.clone().divideScalar(arrow.value);
    arrow.holder.quaternion.setFromUnitVectors(new this.THREE.Vector3(0, 0, 1), along);
    arrow.drawing.set(length);
    arrow.tip.copy(arrow.holder.position).addScaledVector(along, length);
  }

  /** Ends of the straight arrows at some frames of the run. */
  arrowTips() {
    const tips = [], count = this.run.times.length, stride = Math.ceil(count / 60);
    for (const arrow of this.arrows.filter((item) => !item.moment))
      for (let k = 0; k < count; k += stride) {
        this.setArrow(arrow, { k, next: k, part: 0 });
        if (arrow.holder.visible) tips.push(arrow.tip.clone());
      }
    this.setTime(this.time);
    return tips;
  }

  /** Frames the motion, or the start when the camera follows. */
  resetView() {
    const { THREE, run } = this, outline = this.following ? run.view.start : run.view.motion;
    const tips = this.following ? [] : this.arrowTips();
    this.orbit.frame([...outline.map((point) => new THREE.Vector3(...point)), ...tips], new THREE.Vector3(...run.view.direction));
    if (this.following) { this.orbit.target.add(this.center).sub(this.startCenter); this.orbit.place(); }
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (!width || !height) return;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.dirty = true;
  }

  /** Place of a world point on the canvas in pixels; null behind the camera. */
  onScreen(point) {
    const p = point.clone().project(this.camera);
    if (p.z > 1) return null;
    return [((p.x + 1) / 2) * this.canvas.clientWidth, ((1 - p.y) / 2) * this.canvas.clientHeight];
  }

  render() {
    if (!this.dirty) return;
    this.dirty = false;
    const focus = this.following ? this.orbit.target : this.sunTarget;
    this.sun.target.position.copy(focus);
    this.sun.position.copy(focus).add(this.sunOffset);
    // The ground goes with the focus in whole cells, so that its lines stay where they are in the world.
    const local = focus.clone().applyQuaternion(this.ground.quaternion.clone().invert()), step = 5 * this.cell;
    this.ground.position.set(Math.round(local.x / step) * step, Math.round(local.y / step) * step, this.run.view.ground).applyQuaternion(this.ground.quaternion);
    this.renderer.render(this.world, this.camera);
    this.placeLabels();
  }

  /** Numbers at the tips of the arrows, the larger ones first; one that would cover another is left out. */
  placeLabels() {
    const taken = [], share = (arrow) => Math.abs(arrow.value) / this.largest[arrow.unit];
    for (const arrow of [...this.arrows].sort((a, b) => share(b) - share(a))) {
      const at = arrow.holder.visible ? this.onScreen(arrow.tip) : null;
      const clear = at && taken.every(([x, y]) => Math.abs(x - at[0]) > 76 || Math.abs(y - at[1]) > 17);
      arrow.label.style.visibility = clear ? "visible" : "hidden";
      if (!clear) continue;
      taken.push(at);
      arrow.label.textContent = `${steady(arrow.value)} ${arrow.unit}`;
      arrow.label.style.transform = `translate(${at[0] + 7}px, ${at[1] - 9}px)`;
    }
  }

  /** Name of the mark or joint nearest to a place on the canvas, within 12 pixels. */
  nearest(x, y) {
    let best = null, closest = 12;
    const look = (text, object) => {
      const at = this.onScreen(object.getWorldPosition(new this.THREE.Vector3()));
      const distance = at ? Math.hypot(at[0] - x, at[1] - y) : Infinity;
      if (distance < closest) { closest = distance; best = text; }
    };
    for (const mark of this.marks) look(`${mark.kind} ${mark.name}`, mark.ends[0]);
    this.joints.slice(1).forEach((joint) => look(`joint ${joint.name}`, joint));
    return best;
  }

  /** Placements in the world at the shown time, as 4 x 4 matrices by name. */
  poses() {
    this.world.updateMatrixWorld(true);
    const matrix = (object) => {
      const e = object.matrixWorld.elements;
      return [0, 1, 2, 3].map((row) => [0, 1, 2, 3].map((column) => e[row + 4 * column]));
    };
    const named = (objects) => Object.fromEntries(objects.map((object) => [object.name, matrix(object)]));
    const marks = Object.fromEntries(this.marks.map((mark) => [mark.name, mark.ends.map((dot) => matrix(dot).slice(0, 3).map((row) => row[3]))]));
    return { time: this.time, joints: named(this.joints), visuals: named(this.visuals), marks };
  }
}
