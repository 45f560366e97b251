// The 3D curve with its uncertainty tube.
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

// A tube of varying radius around a polyline, with frames carried along without twist.
function tube(points, radii, sides = 10) {
  const n = points.length;
  const positions = new Float32Array(n * sides * 3);
  const normals = new Float32Array(n * sides * 3);
  const tangent = (i) => {
    const a = points[Math.max(0, i - 1)], b = points[Math.min(n - 1, i + 1)];
    return b.clone().sub(a).normalize();
  };
  let before = tangent(0);
  const axis = Math.abs(before.x) < 0.9 ? new THREE.Vector3(1, 0, 0) : new THREE.Vector3(0, 1, 0);
  let normal = axis.sub(before.clone().multiplyScalar(axis.dot(before))).normalize();
  for (let i = 0; i < n; i++) {
    const t = tangent(i);
    const turn = new THREE.Quaternion().setFromUnitVectors(before, t);
    normal = normal.applyQuaternion(turn).normalize();
    before = t;
    const binormal = new THREE.Vector3().crossVectors(t, normal);
    for (let s = 0; s < sides; s++) {
      const angle = (2 * Math.PI * s) / sides;
      const out = normal.clone().multiplyScalar(Math.cos(angle))
        .add(binormal.clone().multiplyScalar(Math.sin(angle)));
      const at = points[i].clone().add(out.clone().multiplyScalar(radii[i]));
      at.toArray(positions, 3 * (i * sides + s));
      out.toArray(normals, 3 * (i * sides + s));
    }
  }
  const index = [];
  for (let i = 0; i + 1 < n; i++) {
    for (let s = 0; s < sides; s++) {
      const a = i * sides + s, b = i * sides + ((s + 1) % sides);
      index.push(a, b, a + sides, b, b + sides, a + sides);
    }
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
  geometry.setAttribute("normal", new THREE.BufferAttribute(normals, 3));
  geometry.setIndex(index);
  return geometry;
}

export function makeScene(holder, data, onPick) {
  const renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true, preserveDrawingBuffer: true });
  renderer.setPixelRatio(Math.min(2, window.devicePixelRatio || 1));
  holder.append(renderer.domElement);
  const scene = new THREE.Scene();
  const camera = new THREE.PerspectiveCamera(32, 1, 0.01, 1000);

  // Everything is shown in a frame of its own: centred, largest extent 1, first camera's axes.
  const raw = data.curve.points.map((p) => new THREE.Vector3(...p));
  const all = new THREE.Box3().setFromPoints(raw);
  const centre = all.getCenter(new THREE.Vector3());
  const size = all.getSize(new THREE.Vector3());
  const extent = Math.max(size.x, size.y, size.z) || 1;
  const [r1, r2, r3] = data.views[0].rotation;
  // Image axes point right and down; on screen y points up.
  const place = ([x, y, z]) => {
    const p = [x - centre.x, y - centre.y, z - centre.z];
    const dot = (r) => (r[0] * p[0] + r[1] * p[1] + r[2] * p[2]) / extent;
    return new THREE.Vector3(dot(r1), -dot(r2), -dot(r3));
  };
  const points = data.curve.points.map(place);
  const sphere = new THREE.Box3().setFromPoints(points).getBoundingSphere(new THREE.Sphere());

  scene.add(new THREE.HemisphereLight(0xffffff, 0x667788, 2.2));
  const sun = new THREE.DirectionalLight(0xffffff, 1.6);
  sun.position.set(1.2, 2, 2.4);
  scene.add(sun);

  const core = 0.0055;
  const curve = new THREE.Mesh(tube(points, points.map(() => core)),
    new THREE.MeshStandardMaterial({ vertexColors: true, roughness: 0.55 }));
  const sides = 10;
  curve.geometry.setAttribute("color",
    new THREE.BufferAttribute(new Float32Array(points.length * sides * 3), 3));
  scene.add(curve);
  let truth = null;
  if (data.truth) {
    const t = data.truth.map(place);
    truth = new THREE.Mesh(tube(t, t.map(() => 0.55 * core)), new THREE.MeshStandardMaterial({ roughness: 0.8 }));
    scene.add(truth);
  }
  let cloud = null;
  const halo = new THREE.MeshStandardMaterial({ transparent: true, opacity: 0.24, depthWrite: false, roughness: 1 });
  // Returns whether the tube was cut off somewhere: one wider than this hides everything else.
  const WIDEST = 0.15;
  const setTube = (factor) => {
    if (cloud) { scene.remove(cloud); cloud.geometry.dispose(); cloud = null; }
    let cut = false;
    if (data.curve.sigma && factor > 0) {
      const radii = data.curve.sigma.map((s) => (1.96 * s * factor) / extent);
      cut = radii.some((r) => r > WIDEST);
      cloud = new THREE.Mesh(tube(points, radii.map((r) => core + Math.min(r, WIDEST)), sides), halo);
      scene.add(cloud);
    }
    draw();
    return cut;
  };
  const ball = new THREE.Mesh(new THREE.SphereGeometry(0.018, 24, 16), new THREE.MeshStandardMaterial({ roughness: 0.4 }));
  scene.add(ball);
  // Rays from the picked point towards both cameras.
  const rays = [0, 1].map(() => {
    const line = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ transparent: true, opacity: 0.85 }));
    scene.add(line);
    return line;
  });
  const start = new THREE.Mesh(new THREE.SphereGeometry(0.011, 16, 12), curve.material.clone());
  start.material.vertexColors = false;
  start.position.copy(points[0]);
  scene.add(start);
  const ground = new THREE.GridHelper(2 * Math.ceil(sphere.radius * 4) / 4 + 0.5, 12);
  ground.position.set(sphere.center.x, sphere.center.y - sphere.radius * 0.95, sphere.center.z);
  ground.material.transparent = true;
  scene.add(ground);

  const controls = new OrbitControls(camera, renderer.domElement);
  controls.enableDamping = false;
  const reset = () => {
    // Far enough that the whole curve shows in the narrower direction.
    const half = (camera.fov / 2) * (Math.PI / 180);
    const narrow = Math.atan(Math.tan(half) * Math.min(1, camera.aspect));
    controls.target.copy(sphere.center);
    const away = new THREE.Vector3(0.55, 0.38, 1).normalize();
    camera.position.copy(sphere.center).add(away.multiplyScalar((1.06 * sphere.radius) / Math.sin(narrow)));
    controls.update();
    draw();
  };
  let queued = false;
  function draw() {
    if (queued) return;
    queued = true;
    requestAnimationFrame(() => { queued = false; renderer.render(scene, camera); });
  }
  controls.addEventListener("change", draw);

  const theme = () => {
    ball.material.color.set(css("pick"));
    start.material.color.set(css("curve"));
    halo.color.set(css("curve"));
    if (truth) truth.material.color.set(css("truth"));
    rays[0].material.color.set(css("one"));
    rays[1].material.color.set(css("two"));
    ground.material.color.set(css("muted"));
    ground.material.opacity = 0.22;
    draw();
  };
  const colour = (of) => {
    const attribute = curve.geometry.getAttribute("color");
    points.forEach((_, i) => {
      const c = new THREE.Color(of(i));
      for (let s = 0; s < sides; s++) attribute.setXYZ(i * sides + s, c.r, c.g, c.b);
    });
    attribute.needsUpdate = true;
    draw();
  };
  const resize = () => {
    const { clientWidth: w, clientHeight: h } = holder;
    if (!w || !h) return;
    renderer.setSize(w, h);
    const first = camera.aspect === 1;
    camera.aspect = w / h;
    camera.updateProjectionMatrix();
    if (first) reset();
    draw();
  };
  new ResizeObserver(resize).observe(holder);
  resize();
  reset();

  // Where a point lies on the screen, px from the holder's top left.
  const project = (i) => {
    const p = points[i].clone().project(camera);
    return [(p.x + 1) / 2 * holder.clientWidth, (1 - p.y) / 2 * holder.clientHeight, p.z];
  };
  let down = null;
  renderer.domElement.addEventListener("pointerdown", (e) => { down = [e.clientX, e.clientY]; });
  renderer.domElement.addEventListener("pointerup", (e) => {
    if (!down || Math.hypot(e.clientX - down[0], e.clientY - down[1]) > 4) return;
    const box = holder.getBoundingClientRect();
    const at = [e.clientX - box.left, e.clientY - box.top];
    // The nearest on the screen; where strands cross there, the one in front.
    let best = -1, score = Infinity;
    points.forEach((_, i) => {
      const [x, y, z] = project(i);
      const d = Math.hypot(x - at[0], y - at[1]);
      if (d < 14 && d + 40 * z < score) { score = d + 40 * z; best = i; }
    });
    if (best >= 0) onPick(best);
  });
  const pick = (i) => {
    ball.position.copy(points[i]);
    data.views.forEach((view, k) => {
      const towards = place(view.centre).sub(points[i]).normalize();
      rays[k].geometry.setFromPoints([points[i], points[i].clone().add(towards.multiplyScalar(2.4 * sphere.radius))]);
    });
    draw();
  };
  return { pick, project, theme, colour, setTube, reset };
}
