// Three-dimensional viewer: draws a scene of mbs.view.scene and moves its links.
// mbs.viewer(element, scene, options) -> viewer. Load it after three.bundle.js and shapes.js.
(function () {
  "use strict";
  const T = MBS_THREE;
  const { FIXED, STRETCHED, UP, between, ground, vector } = mbs.shapes;
  const FIELD = 32; // vertical field of view [degrees]

  class Viewer {
    constructor(element, scene, options = {}) {
      this.element = element;
      this.options = options;
      this.visible = {};
      this.time = 0;
      this.dark = window.matchMedia("(prefers-color-scheme: dark)");
      this.onTheme = () => this.setScene(this.scene);
      this.dark.addEventListener("change", this.onTheme);
      this.renderer = new T.WebGLRenderer({ antialias: true });
      this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
      this.renderer.shadowMap.enabled = true;
      this.renderer.shadowMap.type = T.PCFShadowMap;
      element.classList.add("mbs-viewer");
      element.append(this.renderer.domElement);
      this.stage = new T.Scene();
      this.camera = new T.PerspectiveCamera(FIELD, 1, 0.01, 100);
      this.controls = new T.OrbitControls(this.camera, this.renderer.domElement);
      this.controls.addEventListener("change", () => this.redraw());
      this.watch = new ResizeObserver(() => this.resize());
      this.watch.observe(element);
      this.setScene(scene);
      this.resize();
      this.lookFrom(scene.views[options.view || "iso"], vector(scene.bounds.center), scene.bounds.radius);
    }

    /** Set the theme: "light", "dark", or "auto" for the preference of the browser. */
    setTheme(theme) {
      this.options.theme = theme;
      this.setScene(this.scene);
    }

    get theme() {
      const wanted = this.options.theme || "auto";
      return wanted === "auto" ? (this.dark.matches ? "dark" : "light") : wanted;
    }

    /** Draw another scene. The motion of the previous scene ends. The camera does not move. */
    setScene(scene) {
      if (scene !== this.scene) this.forget();
      this.clear();
      this.scene = scene;
      const colours = scene.palette[this.theme];
      this.stage.background = new T.Color(colours.background);
      this.world = new T.Group();
      this.world.quaternion.setFromUnitVectors(vector(scene.up), UP);
      this.stage.add(this.world);
      this.links = scene.links.map(() => {
        const group = new T.Group();
        group.matrixAutoUpdate = false;
        this.world.add(group);
        return group;
      });
      this.parts = [];
      this.stretched = [];
      for (const item of scene.primitives) this.add(item, colours);
      this.light(scene, colours);
      for (const { role, object } of this.parts) object.visible = this.shows(role);
      this.setPoses(this.motion ? this.posesAt(this.time) : scene.poses);
    }

    add(item, colours) {
      const material = (colour, opacity) =>
        new T.MeshStandardMaterial({
          color: colour,
          roughness: 0.5,
          metalness: 0.1,
          side: T.DoubleSide,
          transparent: opacity < 1,
          opacity,
        });
      const own = item.colour.startsWith("#") ? item.colour : "#888888";
      const paint = material(colours[item.colour] || own, item.opacity ?? 1);
      const shape = FIXED[item.kind] || STRETCHED[item.kind];
      const object = shape(item, paint, material, colours, this.scene.size);
      if (STRETCHED[item.kind]) {
        this.stretched.push({ item, object });
        this.world.add(object);
      } else {
        this.links[item.link].add(object);
      }
      this.parts.push({ role: item.role, object });
    }

    light(scene, colours) {
      const { center, radius } = scene.bounds;
      const middle = vector(center).applyQuaternion(this.world.quaternion);
      this.stage.add(new T.HemisphereLight(0xffffff, colours.bounce, 1.7));
      const sun = new T.DirectionalLight(0xffffff, 2.2);
      sun.position.copy(middle).addScaledVector(new T.Vector3(0.5, 1.6, 0.9), 2 * radius);
      sun.target.position.copy(middle);
      sun.castShadow = true;
      sun.shadow.mapSize.set(2048, 2048);
      sun.shadow.intensity = 0.6;
      sun.shadow.normalBias = 0.004 * radius;
      const edge = 1.6 * radius;
      const box = { left: -edge, right: edge, top: edge, bottom: -edge, far: 8 * radius };
      Object.assign(sun.shadow.camera, box, { near: 0.1 * radius }).updateProjectionMatrix();
      const fill = new T.DirectionalLight(0xffffff, 0.7);
      fill.position.copy(middle).addScaledVector(new T.Vector3(-1, 0.4, -0.6), radius);
      fill.target.position.copy(middle);
      this.stage.add(sun, sun.target, fill, fill.target);
      const grid = ground(scene.floor, colours.grid);
      const shade = new T.Mesh(
        new T.PlaneGeometry(2 * scene.floor.reach, 2 * scene.floor.reach).rotateX(-Math.PI / 2),
        new T.ShadowMaterial({ opacity: colours.shadow, depthWrite: false }),
      );
      shade.receiveShadow = true;
      for (const object of [grid, shade]) {
        object.position.copy(vector(scene.floor.center).applyQuaternion(this.world.quaternion));
        this.stage.add(object);
        this.parts.push({ role: "grid", object });
      }
    }

    /** Move the links. flat: 12 numbers (rows of [R p]) for the base and each link. */
    setPoses(flat) {
      const wanted = 12 * this.links.length;
      if (flat.length !== wanted || !flat.every(Number.isFinite)) {
        console.error(`the picture needs ${wanted} finite numbers, it got ${flat.length}`);
        return;
      }
      this.links.forEach((group, k) => {
        const at = 12 * k;
        group.matrix.set(...Array.prototype.slice.call(flat, at, at + 12), 0, 0, 0, 1);
      });
      for (const { item, object } of this.stretched) {
        const [a, b] = [0, 1].map((k) =>
          vector(item.ends[k]).applyMatrix4(this.links[item.links[k]].matrix),
        );
        between(object, a, b).scale.y = Math.max(a.distanceTo(b), 1e-9 * this.scene.size);
      }
      this.redraw();
    }

    /** Whether a role is visible: by the setting of the user, else by the default of the scene. */
    shows(role) {
      return this.visible[role] ?? !this.scene.hidden.includes(role);
    }

    setVisible(role, shown) {
      this.visible[role] = shown;
      for (const part of this.parts) if (part.role === role) part.object.visible = shown;
      this.redraw();
    }

    /** Move the camera to a view ("iso", "front", "side", "top"); "fit" keeps the direction. */
    setCamera(name) {
      const box = new T.Box3();
      this.world.updateMatrixWorld(true);
      for (const { role, object } of this.parts) {
        if (object.visible && !["grid", "label", "axis"].includes(role)) box.expandByObject(object);
      }
      const ball = box.getBoundingSphere(new T.Sphere());
      const back = this.world.quaternion.clone().invert();
      const here = this.camera.position.clone().sub(this.controls.target).applyQuaternion(back);
      const view = this.scene.views[name] || here.toArray();
      this.lookFrom(view, ball.center.applyQuaternion(back), ball.radius);
    }

    lookFrom(direction, center, radius) {
      const narrow = Math.min(1, this.camera.aspect);
      const away = (1.06 * radius) / Math.sin((FIELD * Math.PI) / 360) / narrow;
      const middle = center.clone().applyQuaternion(this.world.quaternion);
      const out = vector(direction).normalize().applyQuaternion(this.world.quaternion);
      this.controls.target.copy(middle);
      this.camera.position.copy(middle).addScaledVector(out, away);
      this.camera.near = 0.02 * away;
      this.camera.far = 20 * away;
      this.camera.updateProjectionMatrix();
      this.controls.update();
      this.redraw();
    }

    resize() {
      const { clientWidth: width, clientHeight: height } = this.element;
      if (!width || !height) return;
      this.renderer.setSize(width, height, false);
      this.camera.aspect = width / height;
      this.camera.updateProjectionMatrix();
      this.draw();
    }

    draw() {
      this.renderer.render(this.stage, this.camera);
    }

    redraw() {
      this.waiting ??= requestAnimationFrame(() => {
        this.waiting = undefined;
        this.draw();
      });
    }

    /** Return the picture as a data URL (PNG). */
    screenshot() {
      this.draw();
      return this.renderer.domElement.toDataURL("image/png");
    }

    /** Play a motion {times, poses, fps}: poses is a flat array per frame. Without one, resume. */
    play(motion) {
      if (motion) {
        const times = motion.times || motion.poses.map((_, k) => k / (motion.fps || 30));
        this.motion = { ...motion, times };
        this.time = times[0];
      }
      this.pause();
      let last;
      const step = (now) => {
        this.running = requestAnimationFrame(step);
        const { times, speed = 1 } = this.motion;
        const end = times[times.length - 1];
        const next = this.time + ((now - (last ?? now)) / 1000) * speed;
        last = now;
        this.seek(next > end ? times[0] : next);
      };
      if (this.motion) this.running = requestAnimationFrame(step);
    }

    get playing() {
      return this.running !== undefined;
    }

    pause() {
      if (this.playing) cancelAnimationFrame(this.running);
      this.running = undefined;
    }

    /** Stop and remove the motion. */
    forget() {
      this.pause();
      this.motion = undefined;
    }

    /** Show the frame of the motion at a time [s]. */
    seek(time) {
      if (!this.motion) return;
      this.time = time;
      this.setPoses(this.posesAt(time));
      this.options.onTime?.(time);
    }

    /** Return the poses of the motion at a time [s], by linear interpolation between frames. */
    posesAt(time) {
      const { times, poses } = this.motion;
      let k = 0;
      for (let high = times.length - 1; high - k > 1; ) {
        const middle = (k + high) >> 1;
        if (times[middle] <= time) k = middle;
        else high = middle;
      }
      const [a, b] = [poses[k], poses[Math.min(k + 1, poses.length - 1)]];
      const span = times[k + 1] - times[k];
      const part = span > 0 ? Math.min(1, Math.max(0, (time - times[k]) / span)) : 0;
      return Array.from(a, (value, n) => value + part * (b[n] - value));
    }

    clear() {
      this.stage.traverse((object) => {
        object.geometry?.dispose();
        object.material?.map?.dispose();
        object.material?.dispose();
        object.shadow?.dispose();
      });
      this.stage.clear();
    }

    dispose() {
      this.pause();
      cancelAnimationFrame(this.waiting);
      this.dark.removeEventListener("change", this.onTheme);
      this.watch.disconnect();
      this.controls.dispose();
      this.clear();
      this.renderer.dispose();
      this.renderer.domElement.remove();
    }
  }

  window.mbs.viewer = (element, scene, options) => new Viewer(element, scene, options);
})();
