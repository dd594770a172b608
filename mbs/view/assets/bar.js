// Control bar of an HTML file: play button, time slider, visible roles and view directions.
// mbs.bar(element, scene, {view, theme, motion}) creates viewer and bar; mbs.motion(data) decodes a motion.
(function () {
  "use strict";

  function made(tag, properties, parent) {
    const element = Object.assign(document.createElement(tag), properties);
    parent.append(element);
    return element;
  }

  /** Decode a motion: poses are 32-bit floats in base 64, one row per frame. */
  mbs.motion = ({ times, packed, speed }) => {
    const bytes = Uint8Array.from(atob(packed), (letter) => letter.charCodeAt(0));
    const every = new Float32Array(bytes.buffer);
    const width = every.length / times.length;
    const poses = times.map((_, k) => every.subarray(k * width, (k + 1) * width));
    return { times, poses, speed };
  };

  function timeline(bar, viewer, motion) {
    const last = motion.times.length - 1;
    const start = motion.times[0];
    const button = made("button", { type: "button", className: "mbs-play" }, bar);
    const slider = made("input", { type: "range", min: start, max: motion.times[last] }, bar);
    Object.assign(slider, { step: "any", value: start, className: "mbs-time" });
    slider.setAttribute("aria-label", "time");
    const clock = made("output", {}, bar);
    const tell = () => {
      button.textContent = viewer.playing ? "Pause" : "Play";
      clock.textContent = viewer.time.toFixed(2) + " s";
    };
    viewer.options.onTime = (time) => {
      slider.value = time;
      tell();
    };
    button.onclick = () => {
      if (viewer.playing) viewer.pause();
      else viewer.play();
      tell();
    };
    slider.oninput = () => {
      viewer.pause();
      viewer.seek(Number(slider.value));
    };
    viewer.play(motion);
    tell();
  }

  function toggles(bar, viewer, scene) {
    const roles = new Set(scene.primitives.map((item) => item.role));
    const names = { frame: "frames", "link frame": "link frames", axis: "axes", label: "names" };
    // with visual shapes, the bars and joints inside them can be shown too
    const below = { visual: "shapes", skeleton: "bars", joint: "joints" };
    if (roles.has("visual")) Object.assign(names, below);
    for (const [role, text] of Object.entries({ ...names, loop: "loops", force: "forces" })) {
      if (!roles.has(role)) continue;
      const label = made("label", {}, bar);
      const box = made("input", { type: "checkbox" }, label);
      box.checked = !scene.hidden.includes(role);
      label.append(text);
      box.onchange = () => viewer.setVisible(role, box.checked);
    }
  }

  function cameras(bar, viewer) {
    for (const name of ["iso", "front", "side", "top", "fit"]) {
      const button = made("button", { type: "button", textContent: name }, bar);
      button.onclick = () => viewer.setCamera(name);
    }
  }

  function picture(bar, viewer, scene) {
    const button = made("button", { type: "button", textContent: "PNG" }, bar);
    button.title = "Save the picture";
    button.onclick = () => {
      const link = document.createElement("a");
      Object.assign(link, { href: viewer.screenshot(), download: scene.name + ".png" }).click();
    };
  }

  mbs.bar = (element, scene, { view, theme, motion }) => {
    const stage = made("div", { className: "mbs-stage" }, element);
    const bar = made("div", { className: "mbs-bar" }, element);
    let viewer;
    try {
      viewer = mbs.viewer(stage, scene, { theme, view });
    } catch (error) {
      stage.textContent = "This browser cannot draw in three dimensions (WebGL is off).";
      return undefined;
    }
    const paint = () => (element.dataset.theme = viewer.theme);
    viewer.dark.addEventListener("change", paint);
    paint();
    if (motion) timeline(bar, viewer, mbs.motion(motion));
    toggles(bar, viewer, scene);
    cameras(bar, viewer);
    picture(bar, viewer, scene);
    return viewer;
  };
})();
