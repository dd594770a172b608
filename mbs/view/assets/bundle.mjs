// Bundles the classes of three.js that viewer.js uses; README.md says how to run it.
import { readFile } from "node:fs/promises";
import { resolve } from "node:path";
import { build } from "esbuild";

const unused = /ShaderLib\/(background|backgroundCube|cube|equirect|meshlambert|meshmatcap|meshnormal|meshphong|meshtoon|points|vsm)\.glsl\.js$/;
const noHeadset = `
import { EventDispatcher } from '../../core/EventDispatcher.js';
export class WebXRManager extends EventDispatcher {
  enabled = false; isPresenting = false; cameraAutoUpdate = false;
  setAnimationLoop() {} dispose() {} hasDepthSensing() { return false; }
  getEnvironmentBlendMode() { return "opaque"; } getDepthSensingMesh() { return null; }
}`;
const plainShader = (text) =>
  text.replace(/\/\*[\s\S]*?\*\//g, "").replace(/[ \t]*\/\/.*$/gm, "").replace(/^\s+/gm, "").replace(/\n+/g, "\n");

await build({
  entryPoints: ["bundle_entry.mjs"],
  outfile: "three.bundle.js",
  bundle: true,
  minify: true,
  format: "iife",
  globalName: "MBS_THREE",
  target: "es2020",
  charset: "utf8",
  legalComments: "none",
  banner: { js: "/* three.js (MIT licence, see three.LICENSE), the classes that viewer.js uses */" },
  plugins: [{
    name: "small",
    setup({ onLoad, onResolve }) {
      onResolve({ filter: /^three$/ }, () => ({ path: resolve("node_modules/three/src/Three.js") }));
      onLoad({ filter: unused }, () => ({ contents: "export const vertex = '', fragment = '';" }));
      onLoad({ filter: /WebXRManager\.js$/ }, () => ({ contents: noHeadset, resolveDir: resolve("node_modules/three/src/renderers/webxr") }));
      onLoad({ filter: /\.glsl\.js$/ }, async ({ path }) => ({ contents: plainShader(await readFile(path, "utf8")) }));
    },
  }],
});
