// Geometry: shapes of links, arrows, springs and the ground.

const CREASE = Math.cos((35 * Math.PI) / 180);

/** A mesh whose edges stay sharp where faces meet at more than 35 degrees and are smooth elsewhere. */
function creasedMesh(THREE, vertices, triangles) {
  const faces = triangles.length / 3, corners = faces * 3;
  const position = new Float32Array(corners * 3), normal = new Float32Array(corners * 3), face = new Float32Array(faces * 3);
  const first = new Uint32Array(vertices.length / 3 + 1);
  for (let f = 0; f < faces; f++) {
    const [a, b, c] = [triangles[3 * f] * 3, triangles[3 * f + 1] * 3, triangles[3 * f + 2] * 3];
    const ux = vertices[b] - vertices[a], uy = vertices[b + 1] - vertices[a + 1], uz = vertices[b + 2] - vertices[a + 2];
    const wx = vertices[c] - vertices[a], wy = vertices[c + 1] - vertices[a + 1], wz = vertices[c + 2] - vertices[a + 2];
    const x = uy * wz - uz * wy, y = uz * wx - ux * wz, z = ux * wy - uy * wx, size = Math.hypot(x, y, z) || 1;
    face.set([x / size, y / size, z / size], 3 * f);
    for (let i = 0; i < 3; i++) first[triangles[3 * f + i] + 1]++;
  }
  for (let v = 1; v < first.length; v++) first[v] += first[v - 1];
  const fill = first.slice(), around = new Uint32Array(corners); // faces around each vertex
  for (let i = 0; i < corners; i++) around[fill[triangles[i]]++] = Math.floor(i / 3);
  for (let i = 0; i < corners; i++) {
    const v = triangles[i], own = 3 * Math.floor(i / 3);
    let x = 0, y = 0, z = 0;
    for (let j = first[v]; j < first[v + 1]; j++) {
      const g = 3 * around[j];
      if (face[own] * face[g] + face[own + 1] * face[g + 1] + face[own + 2] * face[g + 2] < CREASE) continue;
      x += face[g]; y += face[g + 1]; z += face[g + 2];
    }
    const size = Math.hypot(x, y, z) || 1;
    normal[3 * i] = x / size; normal[3 * i + 1] = y / size; normal[3 * i + 2] = z / size;
    for (let k = 0; k < 3; k++) position[3 * i + k] = vertices[3 * v + k];
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
  geometry.setAttribute("normal", new THREE.BufferAttribute(normal, 3));
  return geometry;
}

/** Geometry of one shape of the run. */
function shapeGeometry(THREE, shape, size) {
  const [a, b, c] = shape.size;
  switch (shape.kind) {
    case "mesh": {
      const geometry = creasedMesh(THREE, shape.vertices, shape.triangles);
      let start = 0;
      shape.parts.forEach(([count], i) => { geometry.addGroup(start, 3 * count, i); start += 3 * count; });
      return geometry;
    }
    case "box": return new THREE.BoxGeometry(a, b, c);
    case "ellipsoid": return new THREE.SphereGeometry(1, 40, 28).scale(a, b, c);
    case "cylinder": return new THREE.CylinderGeometry(a, a, b, 48).rotateX(Math.PI / 2);
    case "cone": return new THREE.ConeGeometry(a, b, 48).rotateX(Math.PI / 2);
    case "capsule": {
      const outline = [];
      for (let i = 0; i <= 24; i++) {
        const angle = -Math.PI / 2 + (Math.PI * i) / 24;
        outline.push(new THREE.Vector2(a * Math.cos(angle), a * Math.sin(angle) + (i <= 12 ? -b / 2 : b / 2)));
      }
      return new THREE.LatheGeometry(outline, 32).rotateX(Math.PI / 2);
    }
    case "plane": return new THREE.PlaneGeometry(8 * size, 8 * size);
    default: throw new Error(`unknown shape "${shape.kind}"`);
  }
}

/** Color in the renderer's linear space. */
function linearColor(THREE, color) {
  return (Array.isArray(color) ? new THREE.Color(color[0], color[1], color[2]) : new THREE.Color(color)).convertSRGBToLinear();
}

function surface(THREE, color) {
  const opacity = Array.isArray(color) ? color[3] : 1;
  return new THREE.MeshStandardMaterial({
    color: linearColor(THREE, color), roughness: 0.55, metalness: 0.05, side: THREE.DoubleSide,
    transparent: opacity < 1, opacity, depthWrite: opacity >= 1,
  });
}

/** A mark that shines faintly through what hides it. */
function markMesh(THREE, geometry, color) {
  const group = new THREE.Group(), shade = linearColor(THREE, color);
  const solid = new THREE.MeshStandardMaterial({ color: shade, emissive: shade, emissiveIntensity: 0.35, roughness: 0.6 });
  const ghost = new THREE.MeshBasicMaterial({ color: shade, transparent: true, opacity: 0.35, depthTest: false, depthWrite: false });
  const behind = new THREE.Mesh(geometry, ghost);
  behind.renderOrder = 5;
  group.add(new THREE.Mesh(geometry, solid), behind);
  return group;
}

/** A straight arrow along z whose head keeps its form; set(length) gives its length. */
class StraightArrow {
  constructor(THREE, color, size) {
    this.radius = 0.007 * size;
    this.group = new THREE.Group();
    this.shaft = markMesh(THREE, new THREE.CylinderGeometry(1, 1, 1, 16).rotateX(Math.PI / 2).translate(0, 0, 0.5), color);
    this.head = markMesh(THREE, new THREE.ConeGeometry(2.6, 7, 24).rotateX(Math.PI / 2).translate(0, 0, 3.5), color);
    this.group.add(this.shaft, this.head);
  }
  set(length) {
    const thick = Math.min(this.radius, length / 10);
    this.shaft.scale.set(thick, thick, Math.max(length - 7 * thick, 1e-9));
    this.head.scale.setScalar(thick);
    this.head.position.z = length - 7 * thick;
  }
}

/** An arc about z with a head; set(part) opens it from 0 to 300 degrees, negative parts turn the other way. */
class ArcArrow {
  constructor(THREE, color, size) {
    const radius = 0.075 * size, tube = 0.0065 * size;
    Object.assign(this, { radius, tube, sweep: (300 * Math.PI) / 180, segments: 90, rings: 10 });
    const sweep = this.sweep;
    class Arc extends THREE.Curve {
      getPoint(s) { return new THREE.Vector3(radius * Math.cos(sweep * s), radius * Math.sin(sweep * s), 0); }
    }
    this.group = new THREE.Group();
    this.arc = new THREE.TubeGeometry(new Arc(), this.segments, tube, this.rings);
    this.head = markMesh(THREE, new THREE.ConeGeometry(2.8 * tube, 7 * tube, 24), color);
    this.group.add(markMesh(THREE, this.arc, color), this.head);
  }
  set(part) {
    const opened = Math.min(Math.abs(part), 1), angle = opened * this.sweep;
    this.arc.setDrawRange(0, Math.round(opened * this.segments) * this.rings * 6);
    this.head.scale.setScalar(Math.max(Math.min(1, (angle * this.radius) / (9 * this.tube)), 1e-3));
    this.head.position.set(this.radius * Math.cos(angle), this.radius * Math.sin(angle), 0);
    this.head.rotation.z = angle;
    this.group.rotation.x = part < 0 ? Math.PI : 0;
  }
}

/** A coil along z of length 1, to be stretched. */
function coilGeometry(THREE, radius) {
  class Coil extends THREE.Curve {
    getPoint(s) {
      const wide = radius * Math.min(1, 12 * s, 12 * (1 - s)), angle = 20 * Math.PI * s;
      return new THREE.Vector3(wide * Math.cos(angle), wide * Math.sin(angle), s);
    }
  }
  return new THREE.TubeGeometry(new Coil(), 400, 0.14 * radius, 6);
}

/** The ground: a grid that fades with distance, and a plane that takes the shadow. */
function groundMesh(THREE, cell, reach) {
  const plane = new THREE.PlaneGeometry(2 * reach, 2 * reach);
  const grid = new THREE.Mesh(plane, new THREE.ShaderMaterial({
    transparent: true, depthWrite: false, side: THREE.DoubleSide, extensions: { derivatives: true },
    uniforms: { cell: { value: cell }, reach: { value: reach } },
    vertexShader: "varying vec2 at; void main() { at = position.xy; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }",
    fragmentShader: `
      varying vec2 at; uniform float cell; uniform float reach;
      float lines(float spacing) {
        vec2 x = at / spacing, width = fwidth(x);
        vec2 line = abs(fract(x - 0.5) - 0.5) / max(width, vec2(1e-6));
        return (1.0 - min(min(line.x, line.y), 1.0)) * (1.0 - smoothstep(0.2, 0.6, max(width.x, width.y)));
      }
      void main() {
        float fade = 1.0 - smoothstep(0.15, 1.0, length(at) / reach);
        gl_FragColor = vec4(0.32, 0.4, 0.5, fade * max(0.22 * lines(cell), 0.42 * lines(5.0 * cell)));
      }`,
  }));
  const shadow = new THREE.Mesh(plane, new THREE.ShadowMaterial({ opacity: 0.16, depthWrite: false }));
  shadow.receiveShadow = true;
  shadow.renderOrder = -2; grid.renderOrder = -1;
  const group = new THREE.Group();
  group.add(shadow, grid);
  return group;
}
