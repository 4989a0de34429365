// Geometry: shapes of links, arrows, springs and the ground.

const CREASE_COSINE = Math.cos((35 * Math.PI) / 180);

/** Mesh with sharp edges between faces at more than 35 degrees, and smooth edges elsewhere. */
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
      if (face[own] * face[g] + face[own + 1] * face[g + 1] + face[own + 2] * face[g + 2] < CREASE_COSINE) continue;
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
    case "mesh": return creasedMesh(THREE, shape.vertices, shape.triangles);
    case "box": return new THREE.BoxGeometry(a, b, c);
    case "ellipsoid": return new THREE.SphereGeometry(1, 28, 18).scale(a, b, c);
    case "cylinder": return new THREE.CylinderGeometry(a, a, b, 32).rotateX(Math.PI / 2);
    case "cone": return new THREE.ConeGeometry(a, b, 32).rotateX(Math.PI / 2);
    case "capsule": {
      const outline = [];
      for (let i = 0; i <= 12; i++) {
        const angle = -Math.PI / 2 + (Math.PI * i) / 12;
        outline.push(new THREE.Vector2(a * Math.cos(angle), a * Math.sin(angle) + (i <= 6 ? -b / 2 : b / 2)));
      }
      return new THREE.LatheGeometry(outline, 20).rotateX(Math.PI / 2);
    }
    case "plane": return new THREE.PlaneGeometry(8 * size, 8 * size);
    default: throw new Error(`unknown shape "${shape.kind}"`);
  }
}

/** Mesh with separate colors of its parts; `color` is the default. */
function paintedMesh(THREE, geometry, shape, color) {
  const painted = new THREE.BufferGeometry(), colors = new Float32Array(geometry.attributes.position.array.length);
  let start = 0;
  for (const [count, own] of shape.parts) {
    const { r, g, b } = linearColor(THREE, own || color);
    for (let i = start; i < start + 3 * count; i++) colors.set([r, g, b], 3 * i);
    start += 3 * count;
  }
  for (const name of ["position", "normal"]) painted.setAttribute(name, geometry.attributes[name]);
  return painted.setAttribute("color", new THREE.BufferAttribute(colors, 3));
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

/** Coil along z of length 1, to be scaled. */
function coilGeometry(THREE, radius) {
  const slender = 12; // length over radius at which the wire is round
  class Coil extends THREE.Curve {
    getPoint(s) {
      const wide = radius * Math.min(1, 12 * s, 12 * (1 - s)), angle = 20 * Math.PI * s;
      return new THREE.Vector3(wide * Math.cos(angle), wide * Math.sin(angle), slender * radius * s);
    }
  }
  return new THREE.TubeGeometry(new Coil(), 240, 0.14 * radius, 5).scale(1, 1, 1 / (slender * radius));
}

/** Ground: a grid that fades with distance, and a plane that receives the shadow. */
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

/** Line with a width in pixels through points (flat); each segment is a quad that faces the camera. Beyond `now` it is faint. */
class WideLine {
  constructor(THREE, world, places, times, color, width) {
    const count = places.length / 3 - 1, geometry = new THREE.BufferGeometry();
    const here = [], there = [], side = [], moment = [], index = [];
    for (let i = 0; i < count; i++) {
      const a = places.slice(3 * i, 3 * i + 3), b = places.slice(3 * i + 3, 3 * i + 6), on = b.map((x, k) => 2 * x - a[k]);
      for (const s of [-1, 1]) { here.push(...a); there.push(...b); side.push(s); moment.push(times ? times[i] : 0); }
      for (const s of [-1, 1]) { here.push(...b); there.push(...on); side.push(s); moment.push(times ? times[i + 1] : 0); }
      index.push(4 * i, 4 * i + 1, 4 * i + 2, 4 * i + 2, 4 * i + 1, 4 * i + 3);
    }
    for (const [name, values, size] of [["position", here, 3], ["after", there, 3], ["side", side, 1], ["moment", moment, 1]])
      geometry.setAttribute(name, new THREE.Float32BufferAttribute(values, size));
    geometry.setIndex(index);
    this.uniforms = { color: { value: linearColor(THREE, color) }, width: { value: width }, pixels: { value: new THREE.Vector2(1, 1) }, now: { value: times ? -1e38 : 1 } };
    this.mesh = new THREE.Mesh(geometry, new THREE.ShaderMaterial({
      transparent: true, depthWrite: false, side: THREE.DoubleSide, uniforms: this.uniforms,
      vertexShader: `
        attribute vec3 after; attribute float side; attribute float moment; uniform vec2 pixels; uniform float width; uniform float now; varying float later;
        void main() {
          vec4 a = projectionMatrix * modelViewMatrix * vec4(position, 1.0), b = projectionMatrix * modelViewMatrix * vec4(after, 1.0);
          vec2 along = (b.xy / b.w - a.xy / a.w) * pixels;
          along = length(along) > 1e-6 ? normalize(along) : vec2(1.0, 0.0);
          a.xy += vec2(-along.y, along.x) * side * width / pixels * a.w;
          later = moment > now ? 1.0 : 0.0;
          gl_Position = a;
        }`,
      fragmentShader: "uniform vec3 color; varying float later; void main() { gl_FragColor = linearToOutputTexel(vec4(color, later > 0.5 ? 0.3 : 0.95)); }",
    }));
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = 3;
    world.add(this.mesh);
  }
}
