// The picture of the app: one viewer in the page, driven by the server.
window.appView = (() => {
  let viewer = null, element = null, wanted = {}, drawn = 0, told = 0;

  function mount(id, scene, camera) {
    const found = document.getElementById(id);
    if (!found || !window.mbs) return void setTimeout(() => mount(id, scene, camera), 30);
    if (viewer && element === found) {
      viewer.setScene(scene);
    } else {
      if (viewer) viewer.dispose();
      element = found;
      viewer = mbs.viewer(element, scene, { theme: theme(), onTime: tell });
    }
    Object.entries(wanted).forEach(([role, on]) => viewer.setVisible(role, on));
    if (camera) viewer.setCamera(camera);
    drawn += 1;
  }

  // An empty picture, until the next mount.
  function clear() {
    if (!viewer) return;
    viewer.dispose();
    viewer = element = null;
  }

  new MutationObserver(() => viewer && viewer.setTheme(theme()))
    .observe(document.body, { attributes: true, attributeFilter: ["class"] });

  const theme = () => (document.body.classList.contains("body--dark") ? "dark" : "light");

  function tell(t) {
    const now = performance.now();
    if (now - told < 100) return;
    told = now;
    emitEvent("app-time", t);
  }

  return {
    mount,
    clear,
    get drawn() { return drawn; },
    get viewer() { return viewer; },
    poses(flat) { if (viewer) { viewer.setPoses(flat); drawn += 1; } },
    visible(role, on) { wanted[role] = on; if (viewer) viewer.setVisible(role, on); },
    camera(name) { if (viewer) viewer.setCamera(name); },
    play(film) { if (viewer) viewer.play(film); },
    pause() { if (viewer) viewer.pause(); },
    seek(t) { if (viewer) viewer.seek(t); },
    screenshot(name) {
      if (!viewer) return;
      const link = document.createElement("a");
      link.href = viewer.screenshot();
      link.download = name;
      link.click();
    },
  };
})();
