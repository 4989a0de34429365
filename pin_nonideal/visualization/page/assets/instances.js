// Many equal objects in one draw call: bodies of one shape, balls, cylinders, cones.

/** One shape drawn many times; with a ghost it is faintly visible behind other bodies. */
class Pool {
  constructor(THREE, world, geometry, material, count, ghost = 0) {
    this.count = count;
    this.mesh = new THREE.InstancedMesh(geometry, material, Math.max(count, 1));
    this.mesh.frustumCulled = false;
    this.hidden = new THREE.Matrix4().makeScale(0, 0, 0);
    const white = new THREE.Color(1, 1, 1);
    for (let i = 0; i < count; i++) { this.mesh.setMatrixAt(i, this.hidden); this.mesh.setColorAt(i, white); }
    if (!count) this.mesh.visible = false;
    world.add(this.mesh);
    if (ghost && count) {
      const behind = new THREE.InstancedMesh(geometry, new THREE.MeshBasicMaterial({ transparent: true, opacity: ghost, depthTest: false, depthWrite: false }), count);
      Object.assign(behind, { instanceMatrix: this.mesh.instanceMatrix, instanceColor: this.mesh.instanceColor, frustumCulled: false, renderOrder: 5 });
      this.mesh.add(behind);
    }
  }
  set(i, matrix) { this.mesh.setMatrixAt(i, matrix); this.mesh.instanceMatrix.needsUpdate = true; }
  hide(i) { this.set(i, this.hidden); }
  color(i, color) { this.mesh.setColorAt(i, color); this.mesh.instanceColor.needsUpdate = true; }
}

/** Bodies of some runs; visuals of one shape and opacity are one draw call. */
class Bodies {
  /** entries: {visual, kinematics, tint, run} each; tint colors the ghosts of other runs. */
  constructor(THREE, shapes, entries, world, size) {
    this.THREE = THREE;
    this.items = entries.map(({ visual, kinematics, tint, run }) => ({
      ...visual, run, kinematics, shown: true, matrix: new THREE.Matrix4().set(...visual.placement),
      color: tint || visual.color, tint,
    }));
    const kinds = new Map(), geometries = new Map();
    for (const item of this.items) {
      const shape = shapes[item.shape], own = !item.tint && shape.kind === "mesh" && shape.parts.some(([, color]) => color);
      const key = [item.shape, item.color[3], own ? item.color.join() : ""].join();
      if (!kinds.has(key)) kinds.set(key, { shape, own, color: item.color, tint: item.tint, items: [] });
      kinds.get(key).items.push(item);
    }
    this.pools = [...kinds.values()].map((kind) => {
      if (!geometries.has(kind.shape)) geometries.set(kind.shape, shapeGeometry(THREE, kind.shape, size));
      const plain = geometries.get(kind.shape), geometry = kind.own ? paintedMesh(THREE, plain, kind.shape, kind.color) : plain;
      const material = surface(THREE, [1, 1, 1, kind.color[3]]);
      material.vertexColors = kind.own;
      const pool = new Pool(THREE, world, geometry, material, kind.items.length);
      pool.mesh.castShadow = pool.mesh.receiveShadow = !kind.tint && kind.shape.kind !== "plane" && kind.color[3] === 1;
      kind.items.forEach((item, i) => { Object.assign(item, { pool, at: i }); if (!kind.own) pool.color(i, linearColor(THREE, item.color)); });
      return pool;
    });
  }

  /** World matrix of an item, or of its drawn position. */
  place({ kinematics, joint, matrix, wrap }, drawn = true) {
    return new this.THREE.Matrix4().multiplyMatrices(drawn && wrap ? kinematics.drawn(joint) : kinematics.groups[joint].matrixWorld, matrix);
  }

  update() {
    for (const item of this.items) if (item.shown) item.pool.set(item.at, this.place(item)); else item.pool.hide(item.at);
  }

  /** Multiplies the opacity of all bodies by a factor. */
  fade(opacity) {
    for (const { mesh } of this.pools) {
      const own = (mesh.userData.opacity = mesh.userData.opacity ?? mesh.material.opacity);
      Object.assign(mesh.material, { opacity: own * opacity, transparent: own * opacity < 1, depthWrite: own * opacity >= 1, needsUpdate: true });
    }
  }
}
