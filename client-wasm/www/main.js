// The page around the picture: says what is wrong where something is, shows progress, panel and
// attribution, and gives embedders `window.treeline`. Everything that moves or draws is in wasm.
import { notice, show, Panel } from "./panel.js";

const element = (id) => document.getElementById(id);
const canvas = element("view");

/** What stands in the way before anything is loaded, or null. */
function obstacle() {
  if (navigator.gpu) return null;
  // Outside a secure context browsers hide WebGPU: it looks as if they had none.
  return window.isSecureContext ? "no-webgpu" : "insecure";
}

/** The thin bar at the top, and its counts for those who cannot see it. */
function progress(resident, wanted) {
  const bar = element("progress");
  const share = wanted > 0 ? resident / wanted : 1;
  bar.classList.toggle("busy", share < 1);
  bar.firstElementChild.style.transform = `scaleX(${share})`;
  bar.setAttribute("aria-valuenow", String(Math.round(100 * share)));
  bar.setAttribute("aria-valuetext", `${resident} of ${wanted} tiles`);
}

/** What the engine reports while it runs. */
function report(kind, ...details) {
  if (kind === "progress") progress(...details);
  else if (kind === "notice") notice(...details);
  else show(kind, details[0]);
}

async function main() {
  const problem = obstacle();
  if (problem) return show(problem);
  let map;
  try {
    const wasm = await import("./treeline.js");
    await wasm.default();
    map = await wasm.open(canvas, report);
  } catch (error) {
    console.error(error);
    return show(error?.kind ?? "failed", error?.message ?? String(error));
  }
  const scene = map.scene();
  document.title = `${scene.name} – Treeline`;
  element("title").textContent = scene.name;
  element("attribution").textContent = scene.attribution.join(" · ");
  new Panel(map, scene);

  window.treeline = Object.freeze({
    /** {lon, lat, height, heading_deg, pitch_deg, fov_y_deg} */
    camera: () => map.camera(),
    setCamera: (camera) => map.set_camera(camera),
    /** Resolves once every tile that the view wants is drawn. */
    settled: () => map.settled(),
    stats: () => map.stats(),
    /** Tiles of the ground: [{level, row, column, visible, wanted, resident}], coarsest first. */
    loadMap: () => map.load_map(),
    pause: () => map.pause(),
    resume: () => map.resume(),
    /** Draws one frame, paused or not; resolves once it is done. */
    step: () => map.step(),
    /** Size of the picture in pixels; the page then no longer follows the window. */
    setSize: (width, height) => map.set_size(width, height),
  });
}

main();
