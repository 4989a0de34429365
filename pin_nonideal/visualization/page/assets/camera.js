// Camera that orbits a target and keeps the up direction of the world upright.

class Orbit {
  /** changed() is called after every move of the camera. */
  constructor(THREE, camera, element, up, changed) {
    Object.assign(this, { camera, element, changed });
    this.up = new THREE.Vector3(...up);
    this.side = new THREE.Vector3(1, 0, 0);
    if (Math.abs(this.side.dot(this.up)) > 0.9) this.side.set(0, 1, 0);
    this.side.addScaledVector(this.up, -this.side.dot(this.up)).normalize();
    this.across = new THREE.Vector3().crossVectors(this.up, this.side);
    this.target = new THREE.Vector3();
    this.azimuth = 0; this.elevation = 0.4; this.distance = 1;
    this.pointers = new Map();
    this.moved = false; // moved by hand; such a view is not framed again
    camera.up.copy(this.up);
    element.addEventListener("pointerdown", (e) => { element.setPointerCapture(e.pointerId); this.pointers.set(e.pointerId, e); });
    for (const name of ["pointerup", "pointercancel"])
      element.addEventListener(name, (e) => this.pointers.delete(e.pointerId));
    element.addEventListener("pointermove", (e) => this.dragged(e));
    element.addEventListener("contextmenu", (e) => e.preventDefault());
    element.addEventListener("wheel", (e) => {
      e.preventDefault();
      this.zoom(Math.exp(Math.max(-0.5, Math.min(0.5, e.deltaY * (e.deltaMode ? 0.05 : 0.0012)))));
    }, { passive: false });
  }

  /** Unit vector from the target to the camera. */
  direction() {
    const flat = Math.cos(this.elevation);
    return this.up.clone().multiplyScalar(Math.sin(this.elevation))
      .addScaledVector(this.side, flat * Math.cos(this.azimuth))
      .addScaledVector(this.across, flat * Math.sin(this.azimuth));
  }

  place() {
    this.camera.position.copy(this.target).addScaledVector(this.direction(), this.distance);
    this.camera.near = this.distance / 100;
    this.camera.far = this.distance * 60;
    this.camera.updateProjectionMatrix();
    this.camera.lookAt(this.target);
    this.camera.updateMatrixWorld();
    this.changed();
  }

  /** Sets a direction and fits all points into the uncovered part of the view; margins are fractions of its width and height. */
  frame(points, direction, { right: beside, top: above, bottom: below }) {
    const away = (this.away = direction.clone().normalize());
    this.elevation = Math.asin(Math.max(-0.999, Math.min(0.999, away.dot(this.up))));
    this.azimuth = Math.atan2(away.dot(this.across), away.dot(this.side));
    const right = this.up.clone().cross(away).normalize(), top = away.clone().cross(right);
    const half = Math.tan((this.camera.fov * Math.PI) / 360), tall = half * (1 - above - below), wide = half * this.camera.aspect * (1 - beside);
    this.target.set(0, 0, 0);
    for (const axis of [right, top, away]) {
      const along = points.map((point) => point.dot(axis));
      this.target.addScaledVector(axis, (Math.min(...along) + Math.max(...along)) / 2);
    }
    this.distance = 1e-3;
    for (const point of points) {
      const from = point.clone().sub(this.target);
      const reach = Math.max(Math.abs(from.dot(right)) / wide, Math.abs(from.dot(top)) / tall);
      this.distance = Math.max(this.distance, from.dot(away) + 1.12 * reach);
    }
    this.target.addScaledVector(right, beside * this.distance * half * this.camera.aspect).addScaledVector(top, (above - below) * this.distance * half);
    this.moved = false;
    this.place();
  }

  zoom(factor) {
    this.moved = true;
    this.distance *= factor;
    this.place();
  }

  /** Moves the target across the view by pixels. */
  pan(dx, dy) {
    const scale = (2 * this.distance * Math.tan((this.camera.fov * Math.PI) / 360)) / this.element.clientHeight;
    const away = this.direction(), right = this.up.clone().cross(away).normalize();
    this.target.addScaledVector(right, -dx * scale).addScaledVector(away.cross(right), dy * scale);
    this.place();
  }

  dragged(event) {
    const last = this.pointers.get(event.pointerId);
    if (!last) return;
    this.moved = true;
    const dx = event.clientX - last.clientX, dy = event.clientY - last.clientY;
    if (this.pointers.size === 2) {
      const [a, b] = [...this.pointers.values()], other = a.pointerId === event.pointerId ? b : a;
      const span = (e) => Math.hypot(e.clientX - other.clientX, e.clientY - other.clientY);
      this.distance *= Math.max(span(last), 1) / Math.max(span(event), 1);
      this.pan(dx / 2, dy / 2);
    } else if (event.buttons & 2 || event.shiftKey) {
      this.pan(dx, dy);
    } else {
      this.azimuth -= dx * 0.007;
      this.elevation = Math.max(-1.55, Math.min(1.55, this.elevation + dy * 0.007));
      this.place();
    }
    this.pointers.set(event.pointerId, event);
  }
}
