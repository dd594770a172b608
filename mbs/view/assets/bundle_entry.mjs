export {
  Box3, BufferAttribute, BufferGeometry, CanvasTexture, CapsuleGeometry, Color, ConeGeometry, Curve,
  CylinderGeometry, DirectionalLight, DoubleSide, Group, HemisphereLight, LineBasicMaterial,
  LineDashedMaterial, LineSegments, Matrix4, Mesh, MeshStandardMaterial, PCFShadowMap,
  PerspectiveCamera, PlaneGeometry, Quaternion, RingGeometry, Scene, ShadowMaterial, SphereGeometry,
  Sphere, Sprite, SpriteMaterial, TorusGeometry, TubeGeometry, Vector3, WebGLRenderer,
} from "three";
export { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
export { RoundedBoxGeometry } from "three/examples/jsm/geometries/RoundedBoxGeometry.js";
