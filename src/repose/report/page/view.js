// The 3-D view of a pour: the grains as instances of one mesh, the plate and the funnel.
"use strict";

// three.js computes with linear colours; those of the page are sRGB.
function linearColour(colour) {
  return new THREE.Color(colour).convertSRGBToLinear();
}

function radians(degrees) {
  return degrees * (Math.PI / 180);
}

// Draw a pour on a canvas; lengths are in mm. `bar` is the element of the scale. The result has
//   show(frame)   to draw the grains at a time,
//   look(name)    to move the camera: "side", "above" or "pour",
//   dress(isDark) to take the colours of the page,
//   looksAt()     the name of the present view.
function pourView(canvas, bar, pour) {
  const renderer = new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
  renderer.outputEncoding = THREE.sRGBEncoding;

  const scene = new THREE.Scene();
  const camera = new THREE.PerspectiveCamera(24, 1, 1, 20000);
  camera.up.set(0, 0, 1);
  scene.add(camera);
  addLights(scene, camera);

  const grains = makeGrains(pour);
  const plate = makePlate(pour.plate_mm);
  const funnelWalls = makeFunnelWalls(pour.walls);
  scene.add(grains.mesh, plate, ...funnelWalls);

  function draw() {
    renderer.render(scene, camera);
    showScale(bar, canvas, camera, orbit.distance());
  }

  function show(frame) {
    grains.show(frame);
    draw();
  }

  function dress(isDark) {
    renderer.setClearColor(new THREE.Color(isDark ? 0x1d242c : 0xf4f5f7));
    plate.material.color.copy(linearColour(isDark ? 0x55606c : 0xd9dde3));
    plate.material.emissive.copy(linearColour(isDark ? 0x1c2126 : 0x6a6d72));
    draw();
  }

  const orbit = makeOrbit(camera, draw);
  const views = makeViews(pour, grains.restingCentres());
  let currentView = "side";
  function look(name) {
    currentView = name;
    const view = views[name];
    for (const wall of funnelWalls) wall.visible = view.withFunnel;
    orbit.moveTo(view);
  }

  listenToKeys(canvas, orbit, () => look(currentView));
  listenToPointers(canvas, orbit);
  keepWidth(canvas, renderer, camera, () => look(currentView));
  show(pour.times_s.length - 1);
  return { show, look, dress, looksAt: () => currentView };
}

// A light of the sky, and a lamp that moves with the camera.
function addLights(scene, camera) {
  scene.add(new THREE.HemisphereLight(linearColour(0xffffff), linearColour(0x8a8078), 0.605));
  const lamp = new THREE.DirectionalLight(linearColour(0xffffff), 0.605);
  lamp.position.set(-0.6, 1, 0.4);
  camera.add(lamp);
}

// Make the grains: {mesh, show(frame), restingCentres()}. Centres are whole numbers of `pour.step`
// above `pour.low`; 65535 stands for a grain that is not there yet.
function makeGrains(pour) {
  const positions = unpacked(pour.positions, Uint16Array);
  const quaternions = unpacked(pour.turns, Int8Array);
  const scales = pour.scales ? unpacked(pour.scales, Float32Array) : null;

  const geometry = new THREE.BufferGeometry();
  const points = unpacked(pour.body.points, Float32Array);
  const normals = unpacked(pour.body.normals, Float32Array);
  const triangles = unpacked(pour.body.triangles, Uint32Array);
  geometry.setAttribute("position", new THREE.BufferAttribute(points, 3));
  geometry.setAttribute("normal", new THREE.BufferAttribute(normals, 3));
  geometry.setIndex(new THREE.BufferAttribute(triangles, 1));

  const mesh = new THREE.InstancedMesh(geometry, new THREE.MeshLambertMaterial(), pour.count);
  mesh.frustumCulled = false;
  for (let grain = 0; grain < pour.count; grain++) {
    // Neighbours differ a little, so that single grains are seen.
    const shade = ((grain * 37) % 100) / 100;
    const colour = linearColour(pour.colour).offsetHSL(0.02 * shade - 0.01, 0, 0.16 * shade - 0.08);
    mesh.setColorAt(grain, colour);
  }

  // The centre of a grain in a frame, or null if it is not there.
  function centreOf(frame, grain) {
    const first = (frame * pour.count + grain) * 3;
    if (positions[first] === 65535) return null;
    return [0, 1, 2].map((axis) => pour.low[axis] + pour.step[axis] * positions[first + axis]);
  }

  const centre = new THREE.Vector3();
  const quaternion = new THREE.Quaternion();
  const size = new THREE.Vector3();
  const matrix = new THREE.Matrix4();
  function show(frame) {
    for (let grain = 0; grain < pour.count; grain++) {
      const coordinates = centreOf(frame, grain);
      centre.set(...(coordinates || [0, 0, 0]));
      const first = (frame * pour.count + grain) * 4;
      quaternion.set(...quaternions.subarray(first, first + 4)).normalize();
      size.setScalar(coordinates ? (scales ? scales[grain] : 1) : 0);
      mesh.setMatrixAt(grain, matrix.compose(centre, quaternion, size));
    }
    mesh.instanceMatrix.needsUpdate = true;
  }

  function restingCentres() {
    const centres = [];
    for (let grain = 0; grain < pour.count; grain++) {
      const coordinates = centreOf(pour.times_s.length - 1, grain);
      if (coordinates) centres.push(coordinates);
    }
    return centres;
  }

  return { mesh, show, restingCentres };
}

function makePlate(radius) {
  const plate = new THREE.Mesh(new THREE.CircleGeometry(radius, 96), new THREE.MeshLambertMaterial());
  plate.position.z = -0.2; // below the grains
  return plate;
}

// Walls of glass; a row of `walls` is height and radius of its lower end, then of its upper end.
function makeFunnelWalls(walls) {
  const glass = new THREE.MeshLambertMaterial({
    color: linearColour(0x6f93bd), transparent: true, opacity: 0.22, side: THREE.DoubleSide, depthWrite: false,
  });
  return walls.map(([lowHeight, lowRadius, highHeight, highRadius]) => {
    const profile = [new THREE.Vector2(lowRadius, lowHeight), new THREE.Vector2(highRadius, highHeight)];
    const wall = new THREE.Mesh(new THREE.LatheGeometry(profile, 64), glass);
    wall.rotation.x = Math.PI / 2; // a lathe turns about y
    return wall;
  });
}

// A bar is at most this share of the view's width.
const LONGEST_BAR = 0.25;

// The largest of 1, 2, 5, 10, 20, 50 ... that is not above a length.
function roundLength(longest) {
  const power = 10 ** Math.floor(Math.log10(longest));
  return power * [5, 2, 1].find((factor) => factor * power <= longest);
}

// Draw a bar of a round length. In perspective it holds at the distance of the pile's axis.
function showScale(bar, canvas, camera, distance) {
  const heightInMm = 2 * distance * Math.tan(radians(camera.fov / 2));
  const pixelsPerMm = canvas.clientHeight / heightInMm;
  const lengthMm = roundLength((LONGEST_BAR * canvas.clientWidth) / pixelsPerMm);
  // A share of the width holds on paper, too, where the picture is smaller.
  bar.style.width = `${(100 * lengthMm * pixelsPerMm) / canvas.offsetWidth}%`;
  bar.textContent = `${lengthMm} mm`;
}

// The three views: elevation of the camera in degrees, half the width and height to be seen, and the
// height of the point in the middle.
function makeViews(pour, centres) {
  // The few grains that rolled away may leave the picture.
  const radii = centres.map(([x, y]) => Math.hypot(x, y)).sort((a, b) => a - b);
  const radius = 1.15 * (radii[Math.floor(0.95 * radii.length)] || 100);
  const height = Math.max(10, ...centres.map(([, , z]) => z));
  const funnelHeight = Math.max(height, ...pour.walls.map((wall) => wall[2]));
  const funnelRadius = Math.max(radius, ...pour.walls.map((wall) => wall[3]));
  return {
    side: { elevation: 3, halfWidth: radius, halfHeight: height / 2, middle: height / 2, withFunnel: false },
    above: { elevation: 89, halfWidth: radius, halfHeight: radius, middle: 0, withFunnel: false },
    pour: {
      elevation: 9, halfWidth: funnelRadius, halfHeight: funnelHeight / 2, middle: funnelHeight / 2, withFunnel: true,
    },
  };
}

// Move the camera about a point of the axis: {moveTo(view), turn(azimuth, elevation, factor), distance()}.
function makeOrbit(camera, draw) {
  const orbit = { azimuth: -90, elevation: 0, distance: 1, nearest: 0, middle: 0 };

  // Turn by degrees, and change the distance by a factor.
  function turn(azimuth, elevation, factor) {
    orbit.azimuth += azimuth;
    orbit.elevation = Math.max(0.3, Math.min(89, orbit.elevation + elevation)); // not from below the plate
    orbit.distance = Math.max(orbit.nearest, Math.min(20 * orbit.nearest, orbit.distance * factor));
    const a = radians(orbit.azimuth);
    const b = radians(orbit.elevation);
    camera.position.set(Math.cos(b) * Math.cos(a), Math.cos(b) * Math.sin(a), Math.sin(b));
    camera.position.multiplyScalar(orbit.distance);
    camera.position.z += orbit.middle;
    camera.lookAt(0, 0, orbit.middle);
    draw();
  }

  function moveTo(view) {
    const slope = Math.tan(radians(camera.fov / 2));
    const distanceForWidth = view.halfWidth / (slope * camera.aspect);
    const distanceForHeight = view.halfHeight / slope;
    orbit.azimuth = -90;
    orbit.elevation = view.elevation;
    orbit.distance = 1.12 * Math.max(distanceForWidth, distanceForHeight) + view.halfWidth;
    orbit.nearest = 0.2 * orbit.distance;
    orbit.middle = view.middle;
    turn(0, 0, 1);
  }

  return { moveTo, turn, distance: () => orbit.distance };
}

// Arrows turn, plus and minus change the distance, 0 puts the view back.
function listenToKeys(canvas, orbit, putBack) {
  const turns = {
    ArrowLeft: [-6, 0, 1], ArrowRight: [6, 0, 1], ArrowUp: [0, 6, 1], ArrowDown: [0, -6, 1],
    "+": [0, 0, 1 / 1.15], "=": [0, 0, 1 / 1.15], "-": [0, 0, 1.15],
  };
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return; // keys of the browser
    if (event.key === "0") putBack();
    else if (event.key in turns) orbit.turn(...turns[event.key]);
    else return;
    event.preventDefault();
  });
}

// One finger or the mouse turns, two fingers or the wheel change the distance.
function listenToPointers(canvas, orbit) {
  const pointers = new Map(); // positions by the number of the pointer
  let wasTouched = false; // the wheel scrolls the page until then
  canvas.style.touchAction = "none";

  function distanceOfTwo() {
    const [a, b] = [...pointers.values()];
    return Math.hypot(a.x - b.x, a.y - b.y);
  }

  canvas.addEventListener("pointerdown", (event) => {
    wasTouched = true;
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  });

  canvas.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const after = { x: event.clientX, y: event.clientY };
    const distanceBefore = pointers.size === 2 ? distanceOfTwo() : 0;
    pointers.set(event.pointerId, after);
    if (distanceBefore) {
      orbit.turn(0, 0, distanceBefore / Math.max(distanceOfTwo(), 1));
    } else {
      const degreesPerPixel = 360 / canvas.clientHeight;
      orbit.turn((before.x - after.x) * degreesPerPixel, (after.y - before.y) * degreesPerPixel, 1);
    }
  });

  for (const ending of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(ending, (event) => pointers.delete(event.pointerId));
  }

  canvas.addEventListener("wheel", (event) => {
    if (!wasTouched) return;
    event.preventDefault();
    orbit.turn(0, 0, 1.05 ** Math.sign(event.deltaY));
  }, { passive: false });
}

// Keep the canvas as wide as the element around it.
function keepWidth(canvas, renderer, camera, putBack) {
  let drawnWidth = 0;
  function resize() {
    const { width } = canvas.parentElement.getBoundingClientRect();
    // Height alone changes on a phone, whose bars come and go while it scrolls.
    if (!width || width === drawnWidth) return;
    drawnWidth = width;
    const height = Math.max(240, Math.min(0.7 * width, 440));
    renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    renderer.setSize(width, height, false);
    canvas.style.height = `${height}px`;
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    putBack();
  }
  window.addEventListener("resize", resize);
  resize();
}
