// A motion in three dimensions by three.js: bodies, ground, terrain, joints, paths, contact forces and marks.
// The page's player says which instant is shown; this draws it. World axes: z is up, lengths in metres.

import {
  BufferAttribute, BufferGeometry, CanvasTexture, CapsuleGeometry, Color, ConeGeometry, CylinderGeometry, DirectionalLight, DoubleSide,
  EdgesGeometry, FrontSide, Group, HemisphereLight, Line, LineBasicMaterial, LineDashedMaterial, LineLoop, LineSegments, Matrix4, Mesh,
  MeshBasicMaterial, MeshLambertMaterial, PerspectiveCamera, PlaneGeometry, Quaternion, Scene, ShaderMaterial,
  SphereGeometry, Sprite, SpriteMaterial, SRGBColorSpace, TorusGeometry, Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

const UP = new Vector3(0, 0, 1), FIELD = 28; // degrees of the camera's height of field
const SLOW = /swiftshader|llvmpipe|softpipe|software|basic render/i; // renderers without a graphics processor
const LIGHT = new Vector3(-0.45, -0.35, 0.82); // towards where light comes from
const PLANES = { light: { ground: "#eef2f5", line: "#c3ccd4", shade: "#cfd6dc" }, dark: { ground: "#1d2630", line: "#3d4a57", shade: "#141b22" } };
const FORCE = { stick: "#009e73", slip: "#d55e00" }, MARK = "#cc79a7", LIMIT = "#d55e00", FIXED = "#b7c2cc", GUESS = "#8d99a5";

const GRID = { // lines at every step and bolder ones at every fifth, which fade away from the middle
  vertexShader: `
    varying vec2 at;
    void main() { at = position.xy; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }`,
  fragmentShader: `
    uniform vec3 ground; uniform vec3 line; uniform float cell; uniform float far; uniform float most; uniform vec2 shift;
    varying vec2 at;
    float lines(vec2 p) {
      vec2 w = fwidth(p), d = abs(fract(p - 0.5) - 0.5) / max(w, 1e-6);
      return (1.0 - min(min(d.x, d.y), 1.0)) * (1.0 - smoothstep(0.25, 0.7, max(w.x, w.y)));
    }
    void main() {
      vec2 p = (at + shift) / cell;
      float on = max(0.55 * lines(p), lines(p / 5.0));
      float fade = 1.0 - smoothstep(0.35 * far, far, length(at));
      gl_FragColor = vec4(mix(ground, line, on), most * fade);
      #include <colorspace_fragment>
    }`,
};

const vector = (list) => new Vector3(...list);
const triples = (flat) => Array.from({ length: flat.length / 3 }, (_, i) => flat.slice(3 * i, 3 * i + 3));
const quaternion = (q) => new Quaternion(q[1], q[2], q[3], q[0]);

export function rendererName() { // of WebGL; empty where there is none
  const probe = document.createElement("canvas").getContext("webgl2");
  if (!probe) return "";
  const info = probe.getExtension("WEBGL_debug_renderer_info");
  const name = String(probe.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : probe.RENDERER)) || "WebGL";
  probe.getExtension("WEBGL_lose_context")?.loseContext();
  return name;
}

class Stage {
  constructor(canvas, name) {
    this.canvas = canvas;
    const slow = SLOW.test(name);
    this.renderer = new WebGLRenderer({ canvas, antialias: !slow, alpha: true, powerPreference: "low-power" });
    this.renderer.setPixelRatio(slow ? 1 : Math.min(window.devicePixelRatio || 1, 2));
    this.camera = new PerspectiveCamera(FIELD, 1, 0.01, 1000);
    this.camera.up.copy(UP);
    this.controls = new OrbitControls(this.camera, canvas);
    Object.assign(this.controls, { zoomToCursor: true, screenSpacePanning: true, rotateSpeed: 0.8 });
    this.controls.addEventListener("change", () => this.render());
    this.controls.addEventListener("start", () => canvas.dispatchEvent(new Event("turned")));
  }

  load(data, box) { // box: what the motion takes up, {low, high, size}
    this.data = data;
    this.box = box;
    this.scene?.traverse((each) => { each.geometry?.dispose(); each.material?.map?.dispose(); each.material?.dispose(); });
    this.scene = new Scene();
    this.light();
    this.size = box.size;
    this.unit = usualSize(data, box);
    this.level = data.planes.some((p) => p.normal[2] > 0.7) ? Math.min(...data.planes.filter((p) => p.normal[2] > 0.7).map((p) => p.offset / p.normal[2])) : null;
    this.controls.maxPolarAngle = this.level === null && !data.terrain.length ? Math.PI : Math.PI / 2 - 0.01;
    this.bodies = data.bodies.map((body) => this.body(body));
    this.scene.add(...this.bodies.map((body) => body.group));
    data.fixtures.forEach((solid) => this.scene.add(solidMesh(solid, FIXED, false)));
    data.terrain.forEach((terrain) => this.scene.add(terrainMesh(terrain)));
    this.ground();
    this.shadows();
    this.paths();
    this.joints();
    this.forces();
    this.marks();
    this.last = null;
    this.forced = true;
  }

  get theme() { return isDark(this.canvas) ? PLANES.dark : PLANES.light; }

  light() {
    const sun = new DirectionalLight("#ffffff", 1.9);
    sun.position.copy(LIGHT).multiplyScalar(100);
    this.scene.add(new HemisphereLight("#ffffff", "#b9c4ce", 1.7), sun);
  }

  body({ colour, solids, ghost }) {
    const least = 0.015 * this.unit; // of a body without a surface
    const group = new Group(), shapes = solids.map((solid) => solidMesh(solid.radius || solid.corners ? solid : { ...solid, radius: least }, colour, ghost));
    group.add(...shapes);
    return { group, shapes };
  }

  ground() { // planes that bear something: an endless grid on level ones, a part of the others
    const { ground, line } = this.theme, step = niceStep(this.data.follow ? 0.8 * this.unit : this.size / 12), far = 9 * this.size;
    const middle = vector(this.box.low).add(vector(this.box.high)).multiplyScalar(0.5);
    const { planes, terrain, fixtures } = this.data, nothing = !planes.length && !terrain.length && !fixtures.length;
    const below = { normal: [0, 0, 1], offset: this.box.low[2] - 0.04 * this.size, most: 0.45 }; // so that nothing hangs in a void
    for (const { normal, offset, most } of nothing ? [below] : planes) {
      const n = vector(normal), flat = n.z > 0.7, width = flat ? 2 * far : 1.6 * this.size;
      const foot = middle.clone().addScaledVector(n, offset - middle.dot(n));
      const uniforms = { ground: { value: new Color(ground) }, line: { value: new Color(line) }, cell: { value: step }, far: { value: flat ? far : 0.8 * this.size }, shift: { value: { x: foot.x, y: foot.y } }, most: { value: most ?? (flat ? 1 : 0.6) } };
      const material = new ShaderMaterial({ ...GRID, uniforms, transparent: true, side: FrontSide, depthWrite: flat, polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 2 });
      const mesh = new Mesh(new PlaneGeometry(width, width), material);
      mesh.position.copy(foot);
      mesh.quaternion.setFromUnitVectors(UP, n);
      mesh.renderOrder = flat ? -2 : 1;
      if (!flat) uniforms.shift.value = { x: 0, y: 0 };
      this.scene.add(mesh);
    }
  }

  shadows() { // of what moves, on the highest level plane, as flat copies
    this.dark = [];
    if (this.level === null) return;
    const plane = this.data.planes.filter((p) => p.normal[2] > 0.7).sort((a, b) => b.offset / b.normal[2] - a.offset / a.normal[2])[0];
    const n = vector(plane.normal), toward = LIGHT.clone().normalize(), d = plane.offset, k = n.dot(toward);
    const flatten = new Matrix4().set( // along the light onto the plane n . x = d
      1 - toward.x * n.x / k, -toward.x * n.y / k, -toward.x * n.z / k, toward.x * d / k,
      -toward.y * n.x / k, 1 - toward.y * n.y / k, -toward.y * n.z / k, toward.y * d / k,
      -toward.z * n.x / k, -toward.z * n.y / k, 1 - toward.z * n.z / k, toward.z * d / k, 0, 0, 0, 1);
    const material = new MeshBasicMaterial({ color: this.theme.shade, transparent: true, depthWrite: false, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
    this.bodies.forEach(({ shapes }, b) => shapes.forEach((shape) => {
      if (this.data.bodies[b].ghost) return;
      const group = new Group();
      shape.traverse((each) => { if (each.isMesh) { const copy = new Mesh(each.geometry, material); copy.userData.of = each; group.add(copy); } });
      group.children.forEach((copy) => { copy.matrixAutoUpdate = false; copy.frustumCulled = false; copy.renderOrder = -1; this.dark.push({ copy, flatten }); });
      this.scene.add(group);
    }));
  }

  paths() {
    const { bodies, position, guess } = this.data, count = bodies.length, points = triples(position);
    this.trails = bodies.map((body, b) => {
      if (!body.path) return null;
      const own = points.filter((_, i) => i % count === b);
      const whole = polyline(own, new LineBasicMaterial({ color: body.colour, transparent: true, opacity: 0.25 }));
      const done = polyline(own, new LineBasicMaterial({ color: body.colour, transparent: true, opacity: 0.9 }));
      this.scene.add(whole, done);
      done.userData.whole = whole;
      return done;
    });
    const dash = this.size / 90;
    for (const flat of guess) {
      const line = polyline(triples(flat), new LineDashedMaterial({ color: GUESS, dashSize: dash, gapSize: dash }));
      line.computeLineDistances();
      this.scene.add(line);
    }
  }

  show(position, whole) { // the paths of another motion; contact forces are those of the solution alone
    const count = this.data.bodies.length, points = triples(position);
    this.trails.forEach((trail, b) => {
      if (!trail) return;
      const own = points.filter((_, i) => i % count === b).map(vector);
      for (const line of [trail, trail.userData.whole]) {
        line.geometry.dispose();
        line.geometry = new BufferGeometry().setFromPoints(own);
      }
    });
    this.forced = whole;
  }

  joints() { // pivots, and bars from bodies without a surface there
    const thin = 0.006 * this.unit;
    this.pivots = this.data.joints.map((joint) => {
      const ball = new Mesh(joint.square ? new CylinderGeometry(2 * thin, 2 * thin, 4 * thin, 4) : new SphereGeometry(2.2 * thin, 12, 8), new MeshLambertMaterial({ color: "#f4f7f9" }));
      const pins = joint.axes.map(([side, axis]) => ({ side, axis: vector(axis), mesh: new Mesh(new CylinderGeometry(0.8 * thin, 0.8 * thin, 9 * thin, 8), new MeshLambertMaterial({ color: "#3b4a58" })) }));
      const bones = joint.sides.filter((side) => side.body >= 0).flatMap((side) => {
        const { colour, solids } = this.data.bodies[side.body];
        const beside = solids.filter((s) => Math.hypot(...s.centre) > s.radius).map((s) => s.centre);
        return [side.point, ...beside].map((end) => ({ side, end: vector(end), mesh: new Mesh(new CylinderGeometry(2 * thin, 2 * thin, 1, 10), new MeshLambertMaterial({ color: colour })) }));
      });
      this.scene.add(ball, ...pins.map((pin) => pin.mesh), ...bones.map((bone) => bone.mesh));
      return { joint, ball, pins, bones };
    });
  }

  forces() { // arrows of contact forces, with the cone that friction allows
    this.arrows = (this.data.forces?.pairs || []).map((pair) => {
      const long = new Mesh(new CylinderGeometry(1, 1, 1, 10), new MeshLambertMaterial({ color: FORCE.stick }));
      const tip = new Mesh(new ConeGeometry(1, 1, 12), long.material);
      const cone = new Mesh(new ConeGeometry(1, 1, 24, 1, true), new MeshBasicMaterial({ color: FORCE.stick, transparent: true, opacity: 0.16, side: DoubleSide, depthWrite: false }));
      const group = new Group();
      group.add(long, tip, cone);
      this.scene.add(group);
      return { pair, group, long, tip, cone };
    });
  }

  marks() { // what is aimed at: a point, a line or a plane where coordinates are free
    for (const { name, at, tolerance, limit } of this.data.marks || []) {
      const colour = limit ? LIMIT : MARK;
      const free = at.map((x) => x === null), known = free.filter((x) => !x).length;
      const middle = at.map((x, k) => (x === null ? (this.box.low[k] + this.box.high[k]) / 2 : x));
      const material = new MeshBasicMaterial({ color: colour, transparent: true, opacity: 0.55, depthWrite: false });
      const size = Math.max(tolerance, 0.008 * this.size);
      let mesh;
      if (known === 3) mesh = new Mesh(new TorusGeometry(2.2 * size, 0.35 * size, 8, 40), material);
      else if (known === 2) {
        const k = free.indexOf(true), long = Math.max(this.box.high[k] - this.box.low[k], 0.2 * this.size);
        mesh = new Mesh(new CylinderGeometry(0.4 * size, 0.4 * size, long, 10), material);
        mesh.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), new Vector3(...[0, 1, 2].map((i) => Number(i === k))));
      } else {
        const k = free.indexOf(false), [a, b] = [0, 1, 2].filter((i) => i !== k);
        const wide = (i) => Math.max(this.box.high[i] - this.box.low[i], 0.25 * this.size);
        if (k < 2 && this.level !== null) middle[2] = this.level + wide(2) / 2;
        const sizes = [0, 0, 0];
        [sizes[a], sizes[b], sizes[k]] = [wide(a), wide(b), 0];
        mesh = new Group();
        const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([s, t]) => { const p = [0, 0, 0]; p[a] = s * sizes[a] / 2; p[b] = t * sizes[b] / 2; return p; });
        const loop = new LineLoop(new BufferGeometry().setFromPoints(corners.map(vector)), new LineBasicMaterial({ color: colour }));
        const pane = new Mesh(facesGeometry(corners, [[0, 1, 2, 3]]), new MeshBasicMaterial({ color: colour, transparent: true, opacity: 0.12, side: DoubleSide, depthWrite: false }));
        mesh.add(loop, pane);
      }
      mesh.position.copy(vector(middle));
      const label = textSprite(name, colour, 0.03);
      label.position.copy(mesh.position).add(new Vector3(0, 0, [0, 0, at[2] === null ? (this.box.high[2] - this.box.low[2]) / 2 : 0, 3 * size][known] + 0.03 * this.size));
      this.scene.add(mesh, label);
    }
  }

  look(name, seen) { // seen: points that must be in the picture, each with a radius
    const along = this.data.along === "y" ? 0 : -Math.PI / 2;
    const [azimuth, elevation] = { space: [along - 0.5, this.data.flat ? 0.9 : 0.3], side: [along, 0.02], top: [along, Math.PI / 2 - 0.011] }[name];
    this.toward = new Vector3(Math.cos(elevation) * Math.cos(azimuth), Math.cos(elevation) * Math.sin(azimuth), Math.sin(elevation));
    this.fit(seen);
  }

  fit(seen) { // the camera as near as it sees all of them
    this.resize();
    const right = UP.clone().cross(this.toward).normalize(), up = this.toward.clone().cross(right);
    const tall = Math.tan(FIELD * Math.PI / 360) * 0.9, wide = tall * this.camera.aspect;
    const low = new Vector3(Infinity, Infinity, Infinity), high = low.clone().negate();
    const places = seen.map(({ point, radius }) => { const p = vector(point); return { at: new Vector3(p.dot(right), p.dot(up), p.dot(this.toward)), radius }; });
    places.forEach(({ at, radius }) => { low.min(at.clone().subScalar(radius)); high.max(at.clone().addScalar(radius)); });
    const middle = low.add(high).multiplyScalar(0.5);
    this.target = right.multiplyScalar(middle.x).addScaledVector(up, middle.y).addScaledVector(this.toward, middle.z);
    const away = Math.max(...places.map(({ at, radius }) => at.z - middle.z + Math.max((Math.abs(at.x - middle.x) + radius) / wide, (Math.abs(at.y - middle.y) + radius) / tall)));
    this.camera.near = away / 200;
    this.camera.far = away * 60;
    this.camera.updateProjectionMatrix();
    this.controls.target.copy(this.target);
    this.camera.position.copy(this.controls.target).addScaledVector(this.toward, away);
    this.controls.update();
  }

  follow(poses, on) { // move with the bodies that the camera follows
    const { follow } = this.data;
    if (!follow) return;
    const place = on ? [0, 1].map((k) => follow.bodies.reduce((s, b) => s + poses[b].p[k], 0) / follow.bodies.length) : null;
    if (place && this.last) {
      const step = new Vector3(place[0] - this.last[0], place[1] - this.last[1], 0);
      this.camera.position.add(step);
      this.controls.target.add(step);
      this.controls.update();
    }
    this.last = place;
  }

  draw(poses, index, share, following) {
    poses.forEach(({ p, q }, b) => {
      this.bodies[b].group.position.set(...p);
      this.bodies[b].group.quaternion.copy(quaternion(q));
    });
    this.trails.forEach((trail) => trail?.geometry.setDrawRange(0, index + 2));
    this.placeJoints(poses);
    this.placeForces(poses, index, share);
    this.follow(poses, following);
    this.scene.updateMatrixWorld();
    this.dark.forEach(({ copy, flatten }) => { copy.matrix.multiplyMatrices(flatten, copy.userData.of.matrixWorld); copy.matrixWorld.copy(copy.matrix); });
    this.render();
  }

  placeJoints(poses) {
    const carry = (side, v) => (side.body < 0 ? v.clone() : v.clone().applyQuaternion(quaternion(poses[side.body].q)).add(vector(poses[side.body].p)));
    const turn = (side, v) => (side.body < 0 ? v.clone() : v.clone().applyQuaternion(quaternion(poses[side.body].q)));
    for (const { joint, ball, pins, bones } of this.pivots) {
      const place = carry(joint.sides[0], vector(joint.sides[0].point));
      ball.position.copy(place);
      pins.forEach(({ side, axis, mesh }) => { mesh.position.copy(place); mesh.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), turn(joint.sides[side], axis).normalize()); });
      bones.forEach(({ side, end, mesh }) => between(mesh, vector(poses[side.body].p), carry(side, end)));
    }
  }

  placeForces(poses, index, share) { // from where the body reaches farthest against the force
    const { forces } = this.data;
    if (!forces) return;
    const count = forces.pairs.length, longest = 0.42 * this.unit;
    this.arrows.forEach(({ pair, group, long, tip, cone }, c) => {
      const at = (k) => forces.values.slice(3 * (k * count + c), 3 * (k * count + c) + 3);
      const last = Math.max(0, forces.values.length / 3 / count - 1), now = at(Math.min(index + (share > 0.5 ? 1 : 0), last));
      const force = vector(now), size = force.length();
      group.visible = this.forced && size > 0.004 * forces.largest;
      if (!group.visible) return;
      const n = pair.normal ? vector(pair.normal) : force.clone().normalize(), length = longest * Math.sqrt(size / forces.largest);
      const thick = 0.012 * longest + 0.012 * length, way = force.clone().normalize();
      group.position.copy(this.reach(pair, poses, n));
      group.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), way);
      const head = Math.min(4 * thick, 0.45 * length);
      long.scale.set(thick, length - head, thick);
      long.position.y = (length - head) / 2;
      tip.scale.set(2.3 * thick, head, 2.3 * thick);
      tip.position.y = length - head / 2;
      const press = force.dot(n), slide = force.clone().addScaledVector(n, -press).length(), most = (pair.friction ?? 0) * press;
      long.material.color.set(pair.friction !== null && pair.normal && slide >= 0.995 * most ? FORCE.slip : FORCE.stick);
      cone.visible = Boolean(pair.normal && pair.friction);
      const tall = 0.5 * longest;
      cone.scale.set(tall * (pair.friction ?? 0), tall, tall * (pair.friction ?? 0));
      cone.quaternion.copy(group.quaternion).invert().multiply(new Quaternion().setFromUnitVectors(new Vector3(0, -1, 0), n));
      cone.position.copy(n.clone().multiplyScalar(tall / 2).applyQuaternion(group.quaternion.clone().invert()));
      cone.material.color.copy(long.material.color);
    });
  }

  reach(pair, poses, n) { // the middle of what of a body is farthest against n
    const { p, q } = poses[pair.body], turn = quaternion(q), solids = this.data.bodies[pair.body].solids, points = [];
    for (const solid of pair.solid === null || !solids[pair.solid] ? solids : [solids[pair.solid]]) {
      for (const corner of triples(solid.corners || [0, 0, 0])) {
        const own = vector(corner).applyQuaternion(solid.q ? quaternion(solid.q) : new Quaternion()).add(vector(solid.centre));
        points.push(own.applyQuaternion(turn).add(vector(p)).addScaledVector(n, -solid.radius));
      }
    }
    if (!points.length) return vector(p);
    const heights = points.map((point) => point.dot(n)), least = Math.min(...heights), near = 0.02 * (Math.max(...heights) - least) + 1e-9;
    const lowest = points.filter((_, k) => heights[k] <= least + near);
    return lowest.reduce((sum, point) => sum.add(point), new Vector3()).divideScalar(lowest.length);
  }

  resize() {
    const width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
  }

  render() { if (this.scene) this.renderer.render(this.scene, this.camera); }

  picture() { // as a PNG
    this.render();
    return this.canvas.toDataURL("image/png");
  }
}

function usualSize(data, box) { // [m] of a robot, or of what else moves: by which marks and arrows are drawn
  const count = data.bodies.length, places = triples(data.position).slice(0, count);
  const reach = data.bodies.map((body) => Math.max(0, ...body.solids.map((s) => s.radius + Math.hypot(...s.centre) + Math.max(0, ...triples(s.corners || []).map((c) => Math.hypot(...c))))));
  const known = reach.filter((r) => r > 0).sort((a, b) => a - b), middle = known[Math.floor(known.length / 2)] || Infinity;
  const sides = [0, 1, 2].map((k) => Math.max(...places.map((p, b) => p[k] + reach[b])) - Math.min(...places.map((p, b) => p[k] - reach[b])));
  return Math.min(Math.hypot(...sides) || Infinity, 6 * middle, box.size) || box.size;
}

function isDark(element) { // whether the page is dark where the element is
  const probe = document.createElement("i");
  probe.style.color = "light-dark(#fff, #000)";
  element.parentNode.append(probe);
  const found = getComputedStyle(probe).color === "rgb(0, 0, 0)";
  probe.remove();
  return found;
}

function textSprite(text, colour, height) { // that faces the camera
  const canvas = document.createElement("canvas"), pen = canvas.getContext("2d"), font = "600 40px system-ui, sans-serif";
  pen.font = font;
  canvas.width = Math.ceil(pen.measureText(text).width) + 24;
  canvas.height = 56;
  Object.assign(pen, { font, fillStyle: colour, textBaseline: "middle", lineWidth: 8, strokeStyle: "rgba(255,255,255,0.75)", lineJoin: "round" });
  pen.strokeText(text, 12, 28);
  pen.fillText(text, 12, 28);
  const sprite = new Sprite(new SpriteMaterial({ map: new CanvasTexture(canvas), depthWrite: false, depthTest: false, sizeAttenuation: false }));
  sprite.material.map.colorSpace = SRGBColorSpace;
  sprite.scale.set(height * canvas.width / canvas.height, height, 1);
  return sprite;
}

function niceStep(length) {
  const ten = 10 ** Math.floor(Math.log10(length));
  return [1, 2, 5, 10].map((m) => m * ten).find((s) => s >= length);
}

function polyline(points, material) { return new Line(new BufferGeometry().setFromPoints(points.map(vector)), material); }

function between(mesh, a, b) { // a cylinder of length 1 from a to b
  const d = b.clone().sub(a), length = d.length();
  mesh.visible = length > 1e-9;
  if (!mesh.visible) return;
  mesh.position.copy(a).addScaledVector(d, 0.5);
  mesh.scale.set(1, length, 1);
  mesh.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), d.divideScalar(length));
}

function solidMesh(solid, colour, ghost) { // all points within a radius of the hull of corners
  const group = new Group(), material = new MeshLambertMaterial({ color: colour, transparent: Boolean(ghost), opacity: ghost ? 0.35 : 1, flatShading: Boolean(solid.faces), side: solid.faces ? DoubleSide : FrontSide });
  group.position.copy(vector(solid.centre));
  if (solid.q) group.quaternion.copy(quaternion(solid.q));
  const corners = triples(solid.corners || []);
  if (!corners.length) {
    group.add(new Mesh(new SphereGeometry(solid.radius, 32, 20), material), ...rings(solid.radius));
  } else if (!solid.faces) {
    const [a, b] = corners.map(vector), length = a.distanceTo(b);
    const capsule = new Mesh(new CapsuleGeometry(solid.radius, length, 8, 20), material);
    capsule.position.copy(a).add(b).multiplyScalar(0.5);
    if (length > 0) capsule.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), b.clone().sub(a).divideScalar(length));
    group.add(capsule);
  } else {
    const middle = corners.reduce((s, c) => s.add(vector(c)), new Vector3()).divideScalar(corners.length);
    const out = corners.map((c) => { const d = vector(c).sub(middle), l = d.length() || 1; return vector(c).addScaledVector(d, solid.radius / l).toArray(); });
    const geometry = facesGeometry(out, solid.faces);
    group.add(new Mesh(geometry, material));
    const edges = new EdgesGeometry(geometry, 25);
    group.add(new LineSegments(edges, new LineBasicMaterial({ color: new Color(colour).multiplyScalar(0.7), transparent: true, opacity: ghost ? 0.2 : 0.8 })));
  }
  return group;
}

function rings(radius) { // circles on a ball, which show how it turns
  const loop = (place) => new LineLoop(new BufferGeometry().setFromPoints(Array.from({ length: 64 }, (_, i) => place(Math.cos(i * Math.PI / 32), Math.sin(i * Math.PI / 32)).multiplyScalar(1.004 * radius))), new LineBasicMaterial({ color: "#ffffff", transparent: true, opacity: 0.8 }));
  return [loop((c, s) => new Vector3(c, s, 0)), loop((c, s) => new Vector3(c, 0, s)), loop((c, s) => new Vector3(0, c, s))];
}

function facesGeometry(corners, faces) { // a fan of triangles for each face
  const places = [];
  for (const face of faces) {
    for (let k = 1; k + 1 < face.length; k++) places.push(...corners[face[0]], ...corners[face[k]], ...corners[face[k + 1]]);
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(places), 3));
  geometry.computeVertexNormals();
  return geometry;
}

function terrainMesh({ x, y, z }) {
  const places = [], at = (i, j) => [x[i], y[j], z[j * x.length + i]];
  for (let j = 0; j + 1 < y.length; j++) {
    for (let i = 0; i + 1 < x.length; i++) {
      const cell = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
      if (cell.every((c) => c[2] !== null)) places.push(...cell[0], ...cell[1], ...cell[2], ...cell[0], ...cell[2], ...cell[3]);
    }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(places), 3));
  geometry.computeVertexNormals();
  const surface = new Mesh(geometry, new MeshLambertMaterial({ color: "#c9d3da", flatShading: true, side: DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 }));
  surface.add(new Mesh(geometry, new MeshBasicMaterial({ color: "#5c6b78", wireframe: true, transparent: true, opacity: 0.12 })));
  return surface;
}

window.stageOf = (canvas) => { // null where there is no WebGL
  try {
    const name = rendererName();
    return name ? new Stage(canvas, name) : null;
  } catch { return null; }
};
