// The 3-D view of a pour: the bodies as instances of one mesh, the plate, the funnel.
"use strict";

function pourView(canvas, pour) {
  THREE.ColorManagement.legacyMode = false; // colours are those of the page
  const renderer = new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
  Object.assign(renderer, { outputEncoding: THREE.sRGBEncoding, physicallyCorrectLights: true });
  const scene = new THREE.Scene();
  scene.add(new THREE.HemisphereLight(0xffffff, 0x8a8078, 1.9));
  const sun = new THREE.DirectionalLight(0xffffff, 1.9);
  const camera = new THREE.PerspectiveCamera(24, 1, 1, 20000);
  camera.up.set(0, 0, 1);
  camera.add(sun);
  sun.position.set(-0.6, 1, 0.4);
  scene.add(camera);

  const positions = unpacked(pour.positions, Uint16Array), turns = unpacked(pour.turns, Int8Array);
  const scales = pour.scales ? unpacked(pour.scales, Float32Array) : null;
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(unpacked(pour.body.points, Float32Array), 3));
  geometry.setAttribute("normal", new THREE.BufferAttribute(unpacked(pour.body.normals, Float32Array), 3));
  geometry.setIndex(new THREE.BufferAttribute(unpacked(pour.body.triangles, Uint32Array), 1));
  const bodies = new THREE.InstancedMesh(geometry, new THREE.MeshLambertMaterial(), pour.count);
  bodies.frustumCulled = false;
  for (let n = 0; n < pour.count; n++) {
    const shade = ((n * 37) % 100) / 100; // neighbours differ, so that single bodies are seen
    bodies.setColorAt(n, new THREE.Color(pour.colour).offsetHSL(0.02 * shade - 0.01, 0, 0.16 * shade - 0.08));
  }
  scene.add(bodies);
  const plate = new THREE.Mesh(
    new THREE.CircleGeometry(pour.plate_mm, 96), new THREE.MeshLambertMaterial({ emissive: 0x6a6d72 }));
  plate.position.z = -0.2;
  scene.add(plate);
  const glass = new THREE.MeshLambertMaterial(
    { color: 0x6f93bd, transparent: true, opacity: 0.22, side: THREE.DoubleSide, depthWrite: false });
  const funnel = pour.walls.map(([lowZ, lowR, highZ, highR]) => {
    const wall = new THREE.Mesh(
      new THREE.LatheGeometry([new THREE.Vector2(lowR, lowZ), new THREE.Vector2(highR, highZ)], 64), glass);
    wall.rotation.x = Math.PI / 2; // a lathe turns about y
    scene.add(wall);
    return wall;
  });

  const draw = () => renderer.render(scene, camera);
  function dress(dark) {
    renderer.setClearColor(new THREE.Color(dark ? 0x1d242c : 0xf4f5f7).convertLinearToSRGB());
    plate.material.color.set(dark ? 0x55606c : 0xd9dde3);
    plate.material.emissive.set(dark ? 0x1c2126 : 0x6a6d72);
    draw();
  }

  // Where the camera is, about a point on the axis: angles in degrees, lengths in mm.
  const eye = { about: -90, above: 0, distance: 1, nearest: 0, middle: 0 };
  function turn(about, above, factor) {
    eye.about += about;
    eye.above = Math.max(0.3, Math.min(89, eye.above + above)); // not from below the plate
    eye.distance = Math.max(eye.nearest, Math.min(20 * eye.nearest, eye.distance * factor));
    const [a, b] = [eye.about, eye.above].map((degrees) => degrees * (Math.PI / 180));
    camera.position.set(Math.cos(b) * Math.cos(a), Math.cos(b) * Math.sin(a), Math.sin(b)).multiplyScalar(eye.distance);
    camera.position.z += eye.middle;
    camera.lookAt(0, 0, eye.middle);
    draw();
  }

  // The keys turn by degrees about and above the pile, and change the distance by a factor.
  const TURNS = { ArrowLeft: [-6, 0, 1], ArrowRight: [6, 0, 1], ArrowUp: [0, 6, 1], ArrowDown: [0, -6, 1],
    "+": [0, 0, 1 / 1.15], "=": [0, 0, 1 / 1.15], "-": [0, 0, 1.15] };
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return; // the browser's own
    if (event.key === "0") look(current);
    else if (event.key in TURNS) turn(...TURNS[event.key]);
    else return;
    event.preventDefault();
  });

  // One finger or the mouse turns, two fingers or the wheel change the distance.
  const fingers = new Map(); // places by pointer
  const apart = () => { const [a, b] = [...fingers.values()]; return Math.hypot(a.x - b.x, a.y - b.y); };
  let touched = false; // the wheel scrolls the page until then
  canvas.style.touchAction = "none";
  canvas.addEventListener("pointerdown", (event) => {
    touched = true;
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  });
  canvas.addEventListener("pointermove", (event) => {
    const from = fingers.get(event.pointerId), to = { x: event.clientX, y: event.clientY };
    if (!from) return;
    const before = fingers.size === 2 ? apart() : 0, degrees = 360 / canvas.clientHeight;
    fingers.set(event.pointerId, to);
    if (before) turn(0, 0, before / Math.max(apart(), 1));
    else turn((from.x - to.x) * degrees, (to.y - from.y) * degrees, 1);
  });
  for (const end of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
  }
  canvas.addEventListener("wheel", (event) => {
    if (!touched) return;
    event.preventDefault();
    turn(0, 0, 1.05 ** Math.sign(event.deltaY));
  }, { passive: false });

  const place = new THREE.Vector3(), pose = new THREE.Quaternion(), size = new THREE.Vector3(), matrix = new THREE.Matrix4();
  function show(frame) {
    for (let n = 0; n < pour.count; n++) {
      const at = (frame * pour.count + n) * 3, q = (frame * pour.count + n) * 4;
      const there = positions[at] !== 65535;
      place.set(...[0, 1, 2].map((i) => pour.low[i] + pour.step[i] * positions[at + i]));
      pose.set(turns[q], turns[q + 1], turns[q + 2], turns[q + 3]).normalize();
      size.setScalar(there ? (scales ? scales[n] : 1) : 0);
      bodies.setMatrixAt(n, matrix.compose(place, pose, size));
    }
    bodies.instanceMatrix.needsUpdate = true;
    draw();
  }

  // Radius and height of the resting pile; the few bodies that rolled away may leave the picture.
  const last = (pour.times_s.length - 1) * pour.count * 3, radii = [], heights = [];
  for (let n = 0; n < pour.count; n++) {
    const at = last + 3 * n;
    if (positions[at] === 65535) continue;
    const [x, y, z] = [0, 1, 2].map((i) => pour.low[i] + pour.step[i] * positions[at + i]);
    radii.push(Math.hypot(x, y));
    heights.push(z);
  }
  radii.sort((a, b) => a - b);
  const radius = 1.15 * (radii[Math.floor(0.95 * radii.length)] || 100), height = Math.max(10, ...heights);
  const top = Math.max(height, ...pour.walls.map((wall) => wall[2])), mouth = Math.max(radius, ...pour.walls.map((wall) => wall[3]));
  const views = {
    side: { elevation: 3, half: [radius, height / 2], middle: height / 2, funnel: false },
    above: { elevation: 89, half: [radius, radius], middle: 0, funnel: false },
    pour: { elevation: 9, half: [mouth, top / 2], middle: top / 2, funnel: true },
  };
  let current = "side";
  function look(name) {
    current = name;
    const { elevation, half, middle, funnel: seen } = views[name];
    const angle = Math.tan((camera.fov / 2) * (Math.PI / 180));
    const distance = 1.12 * Math.max(half[0] / (angle * camera.aspect), half[1] / angle) + half[0];
    Object.assign(eye, { about: -90, above: elevation, distance, nearest: 0.2 * distance, middle });
    funnel.forEach((wall) => { wall.visible = seen; });
    turn(0, 0, 1);
  }
  let drawnWidth = 0;
  function resize() {
    const box = canvas.parentElement.getBoundingClientRect();
    if (!box.width || box.width === drawnWidth) return; // a phone's bars come and go while it scrolls
    drawnWidth = box.width;
    const high = Math.max(240, Math.min(0.7 * box.width, 440));
    renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    renderer.setSize(box.width, high, false);
    canvas.style.height = `${high}px`;
    camera.aspect = box.width / high;
    camera.updateProjectionMatrix();
    look(current);
  }
  window.addEventListener("resize", resize);
  resize();
  show(pour.times_s.length - 1);
  return { show, look, dress, looksAt: () => current };
}
