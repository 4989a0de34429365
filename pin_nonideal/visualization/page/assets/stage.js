// Three-dimensional view: scene, lights and camera.

class Stage {
  constructor(THREE, run, canvas, labels) {
    Object.assign(this, { THREE, run, canvas, time: run.times[0], dirty: true, covered: { right: 0, top: 0, bottom: 0 }, following: run.view.follow, followed: 0 });
    try {
      this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    } catch (error) {
      throw new Error("this browser offers no WebGL; turn on hardware acceleration or use another browser");
    }
    Object.assign(this.renderer, { outputEncoding: THREE.sRGBEncoding });
    Object.assign(this.renderer.shadowMap, { enabled: true, type: THREE.PCFSoftShadowMap });
    this.renderer.info.autoReset = false;
    this.world = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(32, 1, 0.01, 100);
    this.up = new THREE.Vector3(...run.view.up);
    this.size = run.view.size;
    this.orbit = new Orbit(THREE, this.camera, canvas, run.view.up, () => { this.dirty = true; });
    this.kinematics = new Kinematics(THREE, run, this.world.add(new THREE.Group()).children[0]);
    this.ghosts = new Ghosts(THREE, run, this.world);
    const own = run.visuals.map((visual) => ({ visual, kinematics: this.kinematics, tint: null, run: 0 }));
    this.bodies = new Bodies(THREE, run.shapes, [...own, ...this.ghosts.entries()], this.world, this.size);
    this.marks = new Marks(THREE, run, this.world, this.kinematics.groups, run.looks);
    this.guides = new Guides(THREE, run, this.world, this.kinematics, run.looks);
    this.arrows = new Arrows(THREE, run, this.world, this.kinematics, labels);
    this.elements = new Elements(THREE, run, this.world, this.kinematics.groups, this.marks);
    this.overlays = new Overlays(THREE, run, this.world, this.kinematics, this.size);
    this.addLights();
    this.addGround();
    this.setTime(this.time);
  }

  addLights() {
    const { THREE, run, size, up } = this, away = new THREE.Vector3(...run.view.direction), right = up.clone().cross(away).normalize();
    this.world.add(new THREE.HemisphereLight(0xf8fafc, 0x8a97a8, 0.6));
    this.sun = new THREE.DirectionalLight(0xfff6ea, 0.5);
    this.sunOffset = up.clone().multiplyScalar(1.3).addScaledVector(away, 0.7).addScaledVector(right, -0.75);
    const ball = new THREE.Box3().setFromPoints(this.outline()).getBoundingSphere(new THREE.Sphere()), radius = 1.3 * ball.radius;
    this.sunOffset.setLength(4 * radius);
    this.sun.castShadow = true;
    const fine = innerWidth * (window.devicePixelRatio || 1) > 1000 ? 2048 : 1024;
    this.sun.shadow.mapSize.set(fine, fine);
    Object.assign(this.sun.shadow, { radius: 4, normalBias: 0.006 * size });
    Object.assign(this.sun.shadow.camera, { left: -radius, right: radius, top: radius, bottom: -radius, near: radius, far: 8 * radius });
    this.sunTarget = ball.center;
    const fill = new THREE.DirectionalLight(0xdbe8ff, 0.2);
    fill.position.copy(right).addScaledVector(away, 0.4).addScaledVector(up, 0.2);
    this.world.add(this.sun, this.sun.target, fill);
  }

  /** Adds a grid on the ground plane, if the run has one. */
  addGround() {
    const { THREE, run, up, size } = this;
    if (run.view.ground === null) return;
    const exponent = Math.floor(Math.log10(size / 4)), lead = size / 4 / 10 ** exponent;
    this.cell = (lead >= 5 ? 5 : lead >= 2 ? 2 : 1) * 10 ** exponent;
    this.ground = groundMesh(THREE, this.cell, 20 * this.cell * (run.view.follow ? 5 : 1));
    this.ground.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), up);
    this.world.add(this.ground);
  }

  /** Extreme points of the motion, around the center at the current time if the camera follows. */
  outline() {
    const center = this.run.view.follow ? (this.center || new this.THREE.Vector3()) : new this.THREE.Vector3();
    const own = this.run.view.outline.map((point) => new this.THREE.Vector3(...point).add(center));
    return own.concat(this.ghosts.offsets().flatMap((offset) => own.map((place) => place.clone().add(offset))), this.ghosts.outline());
  }

  setTime(time) {
    this.time = time;
    this.at = this.kinematics.at(time);
    this.kinematics.pose(this.at);
    this.ghosts.pose(time);
    this.marks.place(this.at);
    this.arrows.place(this.at);
    const center = this.kinematics.center(this.followed);
    if (this.following && this.center) { this.orbit.target.add(center).sub(this.center); this.orbit.place(); }
    this.center = center;
    this.dirty = true;
  }

  /** Places the other runs beside the first one, or over it. */
  setApart(apart) {
    this.ghosts.setApart(apart, this.run.view, this.up);
    this.setTime(this.time);
    this.resetView();
  }

  /** Shows or hides all of "bodies", "marks", "guides" or "trails". */
  show(what, shown) {
    if (what === "trails") for (const line of this.guides.trails.values()) line.mesh.visible = shown;
    else for (const item of this[what].items) item.shown = shown;
    this.dirty = true;
    this.render();
  }

  /** Lets the camera follow a joint, or the center of mass (0); null stops following. */
  follow(joint) {
    this.following = joint !== null;
    this.followed = joint || 0;
    this.center = this.kinematics.center(this.followed);
    this.dirty = true;
  }

  /** Frames the motion from a direction or from the default one. */
  resetView(direction = this.run.view.direction) {
    const { THREE } = this;
    this.center = this.kinematics.center(this.followed);
    this.orbit.frame([...this.outline(), ...this.arrowTips()], direction.isVector3 ? direction : new THREE.Vector3(...direction), this.covered);
  }

  /** Tips of the straight arrows at some frames of the run, without the largest fifth; none if the camera follows. */
  arrowTips() {
    if (this.run.view.follow) return [];
    const tips = new Map(), count = this.run.times.length, stride = Math.ceil(count / 60), reach = this.arrowReach() * this.arrows.scale;
    for (let k = 0; k < count; k += stride) {
      const at = { k, next: k, part: 0, weights: null };
      this.kinematics.pose(at);
      this.arrows.place(at);
      for (const arrow of this.arrows.items) {
        if (!arrow.drawn || arrow.moment || !this.run.view.stays[arrow.joint]) continue;
        if (!tips.has(arrow)) tips.set(arrow, []);
        tips.get(arrow).push({ share: arrow.share, tip: arrow.place.clone().addScaledVector(arrow.vector.clone().normalize(), reach * Math.min(arrow.share, 1.6)) });
      }
    }
    this.kinematics.pose(this.at);
    this.arrows.place(this.at);
    return [...tips.values()].flatMap((own) => own.sort((a, b) => a.share - b.share).slice(0, Math.ceil(0.8 * own.length)).map(({ tip }) => tip));
  }

  arrowReach() { return 0.3 * Math.min(this.size, 2.5 * this.run.view.link); }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (!width || !height) return;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    this.renderer.setSize(width, height, false);
    this.guides.resize(width, height);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    if (this.orbit.away && !this.orbit.moved) this.resetView(this.orbit.away);
    this.dirty = true;
  }

  /** Length of a pixel at the target [m]. */
  pixel() { return (2 * this.orbit.distance * Math.tan((this.camera.fov * Math.PI) / 360)) / Math.max(this.canvas.clientHeight, 1); }

  /** Position of a world point on the canvas in pixels; null behind the camera. */
  onScreen(point) {
    const p = point.clone().project(this.camera);
    if (p.z > 1) return null;
    return [((p.x + 1) / 2) * this.canvas.clientWidth, ((1 - p.y) / 2) * this.canvas.clientHeight];
  }

  render() {
    if (!this.dirty) return;
    this.dirty = false;
    const focus = this.following ? this.orbit.target : this.sunTarget, pixel = this.pixel(), { link } = this.run.view;
    this.sun.target.position.copy(focus);
    this.sun.position.copy(focus).add(this.sunOffset);
    if (this.ground) {
      // The ground follows the focus in whole cells, so that its lines stay fixed in the world.
      const local = focus.clone().applyQuaternion(this.ground.quaternion.clone().invert()), step = 5 * this.cell;
      this.ground.position.set(Math.round(local.x / step) * step, Math.round(local.y / step) * step, this.run.view.ground).applyQuaternion(this.ground.quaternion);
    }
    this.bodies.update();
    this.marks.update(Math.min(Math.max(0.03 * link, 2.5 * pixel), 8 * pixel, 0.05 * link));
    this.arrows.update(this.arrowReach(), Math.max(Math.min(0.012 * link, 3 * pixel), 1.2 * pixel));
    this.guides.update(this.at, this.time);
    this.elements.update(this.at, this.time, Math.max(Math.min(0.09 * link, 22 * pixel), 6 * pixel), this.arrows, this.arrowReach());
    this.overlays.update(0.35 * link, Math.max(0.06 * link, 3 * pixel));
    this.renderer.info.reset();
    this.renderer.render(this.world, this.camera);
    this.arrows.placeLabels((point) => this.onScreen(point), this.cards());
  }

  /** Boxes of the cards and buttons over the view, in pixels: left, top, right, bottom. */
  cards() {
    const own = this.canvas.getBoundingClientRect();
    return ["heading", "forces", "panel", "tools"].map((name) => element(name).getBoundingClientRect()).filter((box) => box.width)
      .map((box) => [box.left - own.left, box.top - own.top, box.right - own.left, box.bottom - own.top]);
  }

  /** Bounding box on the canvas of all bodies in view, in pixels: left, top, right, bottom. */
  box() {
    const { THREE, run } = this, box = [Infinity, Infinity, -Infinity, -Infinity];
    for (const item of this.bodies.items) {
      if (!item.joint || !item.shown || (item.run === 0 && !run.view.stays[item.joint])) continue;
      const { geometry } = item.pool.mesh;
      if (!geometry.boundingBox) geometry.computeBoundingBox();
      const { min, max } = geometry.boundingBox, matrix = this.bodies.place(item);
      for (const corner of [0, 1, 2, 3, 4, 5, 6, 7]) {
        const place = new THREE.Vector3(corner & 1 ? max.x : min.x, corner & 2 ? max.y : min.y, corner & 4 ? max.z : min.z);
        const [x, y] = this.onScreen(place.applyMatrix4(matrix)) || [NaN, NaN];
        box[0] = Math.min(box[0], x); box[1] = Math.min(box[1], y); box[2] = Math.max(box[2], x); box[3] = Math.max(box[3], y);
      }
    }
    return box;
  }

  /** Name of the mark or joint nearest to a point on the canvas, within 12 pixels. */
  nearest(x, y) {
    let best = null, closest = 12;
    const look = (text, place) => {
      const at = this.onScreen(place), distance = at ? Math.hypot(at[0] - x, at[1] - y) : Infinity;
      if (distance < closest) { closest = distance; best = text; }
    };
    for (const mark of this.marks.items.filter((item) => !item.apart)) look(`${mark.kind} ${mark.contact || mark.name}`, mark.places[0]);
    this.kinematics.groups.slice(1).forEach((joint) => look(`joint ${joint.name}`, new this.THREE.Vector3().setFromMatrixPosition(joint.matrixWorld)));
    return best;
  }

  /** Placements in the world at the current time, as 4 x 4 matrices by name. */
  poses() {
    const joints = this.kinematics.poses();
    const visuals = Object.fromEntries(this.bodies.items.filter((item) => item.run === 0).map((item) => [item.name, matrixRows(this.bodies.place(item, false))]));
    return { time: this.time, joints, visuals, marks: Object.fromEntries(this.marks.items.map((mark) => [mark.name, mark.places.map((place) => place.toArray())])) };
  }
}
