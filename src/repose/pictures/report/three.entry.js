export { WebGLRenderer, Scene, PerspectiveCamera, InstancedMesh, Mesh, BufferGeometry, BufferAttribute, CircleGeometry,
  LatheGeometry, MeshLambertMaterial, MeshStandardMaterial, HemisphereLight, DirectionalLight, Color, Matrix4, Vector2,
  Vector3, Quaternion, DoubleSide, Box3 } from "three";
export { OrbitControls } from "three/addons/controls/OrbitControls.js";
