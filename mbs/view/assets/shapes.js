// Conversion of the primitives of a scene to objects of three.js.
// Load it after three.bundle.js. It defines mbs.shapes for viewer.js.
(function () {
  "use strict";
  const T = MBS_THREE;
  const UP = new T.Vector3(0, 1, 0);
  const ROUND = 28; // number of sides of round shapes

  const vector = (p) => new T.Vector3(p[0], p[1], p[2]);

  function mesh(geometry, material) {
    const made = new T.Mesh(geometry, material);
    made.castShadow = made.receiveShadow = !material.transparent;
    return made;
  }

  /** Rotate and move an object whose axis is y so that it extends from a to b. */
  function between(object, a, b) {
    const along = b.clone().sub(a);
    object.position.copy(a).addScaledVector(along, 0.5);
    if (along.lengthSq() > 0) object.quaternion.setFromUnitVectors(UP, along.normalize());
    return object;
  }

  function placed(object, pose) {
    object.matrixAutoUpdate = false;
    object.matrix.set(...pose, 0, 0, 0, 1);
    return object;
  }

  function arrow(axis, length, colour, material) {
    const shaft = new T.CylinderGeometry(0.03 * length, 0.03 * length, 0.8 * length, 12);
    const tip = new T.ConeGeometry(0.08 * length, 0.2 * length, 16);
    const group = new T.Group();
    const paint = material(colour, 1);
    group.add(mesh(shaft.translate(0, 0.4 * length, 0), paint));
    group.add(mesh(tip.translate(0, 0.9 * length, 0), paint));
    group.quaternion.setFromUnitVectors(UP, axis);
    return group;
  }

  function tube(item, length, material) {
    const group = new T.Group();
    for (const radius of [item.radius, item.bore]) {
      group.add(mesh(new T.CylinderGeometry(radius, radius, length, ROUND, 1, true), material));
    }
    for (const side of [-1, 1]) {
      const ring = mesh(new T.RingGeometry(item.bore, item.radius, ROUND), material);
      ring.rotation.x = (-side * Math.PI) / 2;
      ring.position.y = (side * length) / 2;
      group.add(ring);
    }
    return group;
  }

  class Coil extends T.Curve {
    constructor(radius, length) {
      super();
      this.radius = radius;
      this.length = length;
    }
    getPoint(t, target = new T.Vector3()) {
      const grown = Math.min(1, 12 * t, 12 * (1 - t)) * this.radius;
      const angle = 16 * Math.PI * t;
      return target.set(grown * Math.cos(angle), this.length * (t - 0.5), grown * Math.sin(angle));
    }
  }

  function dashes(points, colour, size) {
    const geometry = new T.BufferGeometry().setFromPoints(points);
    const look = { color: colour, dashSize: 0.02 * size, gapSize: 0.012 * size };
    const lines = new T.LineSegments(geometry, new T.LineDashedMaterial(look));
    lines.computeLineDistances();
    return lines;
  }

  function label(item, colour, around) {
    const canvas = document.createElement("canvas");
    const pen = canvas.getContext("2d");
    const font = "600 44px system-ui, sans-serif";
    pen.font = font;
    canvas.width = Math.ceil(pen.measureText(item.text).width) + 24;
    canvas.height = 64;
    pen.font = font;
    pen.textBaseline = "middle";
    pen.lineJoin = "round";
    pen.lineWidth = 10;
    pen.strokeStyle = around;
    pen.strokeText(item.text, 12, 32);
    pen.fillStyle = colour;
    pen.fillText(item.text, 12, 32);
    const map = new T.CanvasTexture(canvas);
    map.colorSpace = "srgb";
    const look = { map, depthTest: false, sizeAttenuation: false };
    const sprite = new T.Sprite(new T.SpriteMaterial({ ...look, transparent: true }));
    const height = 0.027; // height of a label relative to the picture
    sprite.scale.set((height * canvas.width) / canvas.height, height, 1);
    sprite.center.set(-0.05, -0.15 - 0.72 * item.row);
    sprite.renderOrder = 2;
    return sprite;
  }

  // Primitives on a single link: functions that create an object in the frame of the link.
  const FIXED = {
    bar(item, paint) {
      const [a, b] = [vector(item.a), vector(item.b)];
      const body = new T.CapsuleGeometry(item.radius, a.distanceTo(b), 8, ROUND);
      return between(mesh(body, paint), a, b);
    },
    cylinder(item, paint) {
      const [a, b] = [vector(item.a), vector(item.b)];
      const length = a.distanceTo(b);
      const body = new T.CylinderGeometry(item.radius, item.radius, length, ROUND);
      return between(item.bore > 0 ? tube(item, length, paint) : mesh(body, paint), a, b);
    },
    ball(item, paint) {
      const ball = mesh(new T.SphereGeometry(item.radius, ROUND, ROUND / 2), paint);
      ball.position.copy(vector(item.at));
      return ball;
    },
    box(item, paint) {
      const [x, y, z] = item.size;
      const body = new T.RoundedBoxGeometry(x, y, z, 3, 0.08 * Math.min(x, y, z));
      return placed(mesh(body, paint), item.pose);
    },
    ring(item, paint) {
      const body = new T.TorusGeometry(item.radius, item.tube, 14, 72);
      const ring = mesh(body, paint);
      ring.position.copy(vector(item.at));
      ring.quaternion.setFromUnitVectors(new T.Vector3(0, 0, 1), vector(item.axis));
      return ring;
    },
    plate(item, paint) {
      const corners = item.points.map(vector);
      const fan = corners.slice(2).flatMap((c, k) => [corners[0], corners[k + 1], c]);
      const geometry = new T.BufferGeometry().setFromPoints(fan);
      geometry.computeVertexNormals();
      return mesh(geometry, paint);
    },
    mesh(item, paint) {
      const geometry = new T.BufferGeometry();
      geometry.setAttribute("position", new T.BufferAttribute(new Float32Array(item.points), 3));
      geometry.setIndex(item.triangles);
      geometry.computeVertexNormals();
      paint.flatShading = true;
      return placed(mesh(geometry, paint), item.pose);
    },
    frame(item, paint, material, colours) {
      const group = new T.Group();
      const units = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
      units.forEach((unit, k) => {
        group.add(arrow(vector(unit), item.length, colours.axes[k], material));
      });
      return placed(group, item.pose);
    },
    axis(item, paint, material, colours, size) {
      return dashes([vector(item.a), vector(item.b)], colours[item.colour], size);
    },
    label(item, paint, material, colours) {
      const sprite = label(item, colours.text, colours.background);
      sprite.position.copy(vector(item.at));
      return sprite;
    },
  };

  // Primitives between points on two links: objects of length 1, scaled at every configuration.
  const STRETCHED = {
    span: (item, paint) =>
      mesh(new T.CylinderGeometry(item.radius, item.radius, 1, ROUND), paint),
    spring(item, paint) {
      const coil = new Coil(item.radius, item.length);
      const body = new T.TubeGeometry(coil, 180, 0.16 * item.radius, 6);
      return mesh(body.scale(1, 1 / item.length, 1), paint);
    },
  };

  function ground(floor, colour) {
    const { step, reach } = floor;
    const count = Math.floor(reach / step);
    const places = [];
    const tints = [];
    const rgb = new T.Color(colour);
    const put = (x, z) => {
      places.push(x, 0, z);
      tints.push(rgb.r, rgb.g, rgb.b, Math.max(0, 1 - Math.hypot(x, z) / reach) ** 1.4);
    };
    for (let i = -count; i <= count; i++) {
      for (let j = -count; j < count; j++) {
        put(i * step, j * step);
        put(i * step, (j + 1) * step);
        put(j * step, i * step);
        put((j + 1) * step, i * step);
      }
    }
    const geometry = new T.BufferGeometry();
    geometry.setAttribute("position", new T.BufferAttribute(new Float32Array(places), 3));
    geometry.setAttribute("color", new T.BufferAttribute(new Float32Array(tints), 4));
    const look = { vertexColors: true, transparent: true, depthWrite: false };
    return new T.LineSegments(geometry, new T.LineBasicMaterial(look));
  }

  window.mbs = window.mbs || {};
  window.mbs.shapes = { FIXED, STRETCHED, UP, between, ground, vector };
})();
