// The panel, and the page that is shown where there can be no picture.

const element = (id) => document.getElementById(id);

const MESSAGES = {
  "insecure": {
    title: "This address is not secure, so the browser hides WebGPU",
    text: "Browsers offer WebGPU only over https, or over http on localhost.",
    mend: () => `Open the map at https://${location.host}/ if the server offers that, or put a server with a certificate (Caddy, nginx) before it. On the server's own machine http://localhost:${location.port || 80}/ works too.`,
  },
  "no-webgpu": {
    title: "This browser has no WebGPU",
    text: "The landscape is drawn with WebGPU, which this browser lacks or has switched off.",
    mend: () => "Current Chrome and Edge have it everywhere; Safari from version 26, Firefox on Windows and macOS. On Linux, Chrome may need chrome://flags/#enable-unsafe-webgpu.",
  },
  "no-adapter": {
    title: "No graphics adapter for WebGPU",
    text: "The browser has WebGPU, but offers no graphics adapter for it.",
    mend: () => "Hardware acceleration may be off in the browser's settings, or the graphics driver may be on its block list (chrome://gpu says so).",
    again: true,
  },
  "device-lost": {
    title: "The graphics device was lost",
    text: "It was opened again, and lost again.",
    mend: () => "Another program may use up the graphics memory, or the driver may have been restarted.",
    again: true,
  },
  "server-gone": {
    title: "The server does not answer",
    text: "The description of the landscape could not be loaded.",
    mend: () => "It may be starting, or the connection may be down.",
    again: true,
  },
  "empty-scene": {
    title: "There is no landscape here",
    text: "The server answers, but its terrain model has nothing to show.",
    mend: () => "treeline check --dem terrain.tif says what is in the file; --nodata NUMBER says which value stands for no data where the file declares the wrong one.",
    again: true,
  },
  "failed": { title: "Something went wrong", text: "The map could not be started.", mend: () => "", again: true },
};

/** Covers the page with what is wrong and how to mend it. */
export function show(kind, detail = "") {
  const { title, text, mend, again = false } = MESSAGES[kind] ?? MESSAGES.failed;
  const message = element("message");
  message.dataset.kind = kind;
  message.querySelector("h2").textContent = title;
  const [what, how] = message.querySelectorAll("p");
  what.textContent = text;
  how.textContent = [mend(), detail && `(${detail})`].filter(Boolean).join(" ");
  const button = message.querySelector("button");
  button.hidden = !again;
  button.onclick = () => location.reload();
  message.hidden = false;
}

/** How long a passing line stays, milliseconds: long enough to be read twice. */
const PASSING = 12000;

/** Puts a line over the picture, one for each thing it may be about; an empty text takes it away. */
export function notice(about, text, passing) {
  const list = element("notice");
  let line = list.querySelector(`[data-about="${about}"]`);
  if (!text) return line?.remove();
  if (!line) {
    line = document.createElement("p");
    line.dataset.about = about;
    list.append(line);
  }
  line.textContent = text;
  line.classList.toggle("lasting", !passing);
  if (!passing) return;
  const close = document.createElement("button");
  close.type = "button";
  close.textContent = "×";
  close.setAttribute("aria-label", "Close");
  close.onclick = () => line.remove();
  line.append(close);
  clearTimeout(line.timer);
  line.timer = setTimeout(() => line.remove(), PASSING);
}

/** Numbers as people read them. */
const metres = (value) => (Math.abs(value) >= 10000 ? `${(value / 1000).toFixed(1)} km` : `${value.toFixed(0)} m`);
const bytes = (value) => (value >= 1e6 ? `${(value / 1e6).toFixed(1)} MB` : `${(value / 1e3).toFixed(0)} kB`);
const sum = (object = {}) => Object.values(object).reduce((total, value) => total + value, 0);

function fill(list, rows) {
  const nodes = [];
  for (const [name, value] of rows) {
    const term = document.createElement("dt");
    const detail = document.createElement("dd");
    term.textContent = name;
    detail.textContent = value;
    nodes.push(term, detail);
  }
  list.replaceChildren(...nodes);
}

/** Degrees of a tile's side. */
const span = (level) => 180 / 2 ** level;
/** Degrees of longitude from one meridian to another, the short way. */
const eastward = (from, to) => ((((to - from) % 360) + 540) % 360) - 180;

/** The plan of the tiles: north is up, the camera a dot with its field of view, all in sight fits in. */
function drawPlan(canvas, tiles, camera) {
  const style = getComputedStyle(canvas);
  const colour = (name) => style.getPropertyValue(name).trim();
  const scale = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (!width || !height) return;
  canvas.width = width * scale;
  canvas.height = height * scale;
  const brush = canvas.getContext("2d");
  brush.scale(scale, scale);
  const shrink = Math.max(Math.cos((camera.lat * Math.PI) / 180), 0.02);
  // Offsets from the camera in degrees of latitude: west, north, side.
  const squares = tiles.map((tile) => {
    const side = span(tile.level);
    const west = eastward(camera.lon, -180 + tile.column * side) * shrink;
    return { ...tile, west, north: 90 - tile.row * side - camera.lat, wide: side * shrink, high: side };
  });
  const shown = squares.filter((tile) => tile.visible || (tile.wanted && !tile.resident));
  const frame = { west: -1e-4, east: 1e-4, south: -1e-4, north: 1e-4 };
  for (const tile of shown) {
    // Nobody needs all of a large tile, of which a corner is in sight.
    const most = 40 * Math.min(...shown.map((other) => other.high));
    frame.west = Math.min(frame.west, Math.max(tile.west, -most));
    frame.east = Math.max(frame.east, Math.min(tile.west + tile.wide, most));
    frame.north = Math.max(frame.north, Math.min(tile.north, most));
    frame.south = Math.min(frame.south, Math.max(tile.north - tile.high, -most));
  }
  const zoom = 0.94 * Math.min(width / (frame.east - frame.west), height / (frame.north - frame.south));
  const x = (west) => width / 2 + (west - (frame.west + frame.east) / 2) * zoom;
  const y = (north) => height / 2 - (north - (frame.south + frame.north) / 2) * zoom;
  const finest = Math.max(...squares.map((tile) => tile.level), 1);
  const box = (tile) => [x(tile.west), y(tile.north), tile.wide * zoom, tile.high * zoom];
  for (const tile of squares) {
    brush.globalAlpha = 1;
    if (tile.visible) {
      brush.fillStyle = colour("--accent");
      brush.globalAlpha = 0.25 + 0.65 * Math.max(0, 1 - (finest - tile.level) / 8);
      brush.fillRect(...box(tile));
      brush.globalAlpha = 1;
    }
    brush.lineWidth = tile.wanted && !tile.resident ? 1.5 : 0.75;
    brush.strokeStyle = colour(tile.wanted && !tile.resident ? "--warning" : tile.visible ? "--text" : "--line");
    brush.strokeRect(...box(tile));
  }
  const heading = (camera.heading_deg * Math.PI) / 180;
  const half = Math.atan(Math.tan((camera.fov_y_deg * Math.PI) / 360) * (window.innerWidth / Math.max(window.innerHeight, 1)));
  brush.fillStyle = colour("--text");
  brush.globalAlpha = 0.18;
  brush.beginPath();
  brush.moveTo(x(0), y(0));
  brush.arc(x(0), y(0), 2 * width, heading - half - Math.PI / 2, heading + half - Math.PI / 2);
  brush.fill();
  brush.globalAlpha = 1;
  brush.beginPath();
  brush.arc(x(0), y(0), 3.5, 0, 7);
  brush.fill();
}

export class Panel {
  #map;
  #timer = 0;

  constructor(map, scene) {
    this.#map = map;
    const toggle = element("toggle");
    const panel = element("panel");
    toggle.addEventListener("click", () => {
      panel.hidden = !panel.hidden;
      toggle.setAttribute("aria-expanded", String(!panel.hidden));
      clearInterval(this.#timer);
      if (!panel.hidden) {
        this.#update();
        this.#timer = setInterval(() => this.#update(), 500);
      }
    });
    panel.addEventListener("keydown", (event) => {
      if (event.key === "Escape") {
        toggle.click();
        toggle.focus();
      }
    });
    element("home").addEventListener("click", () => map.set_camera(scene.camera));
    const places = scene.places ?? [];
    element("places-box").hidden = places.length === 0;
    for (const place of places) {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = place.name;
      button.addEventListener("click", () => map.set_camera(place.camera));
      element("places").append(button);
    }
    const sun = element("sun");
    sun.value = map.time().slice(0, 16);
    sun.addEventListener("change", () => sun.value && map.set_time(`${sun.value}:00Z`));
    const [wind, clouds] = [element("wind"), element("clouds")];
    const told = () => {
      wind.nextElementSibling.textContent = `${wind.value} m/s`;
      clouds.nextElementSibling.textContent = `${clouds.value} %`;
    };
    wind.value = map.wind();
    clouds.value = 100 * map.clouds();
    told();
    for (const slider of [wind, clouds]) {
      slider.addEventListener("input", () => {
        map.set_weather(Number(wind.value), Number(clouds.value) / 100);
        told();
      });
    }
    for (const button of element("seasons").children) {
      button.addEventListener("click", () => {
        map.set_season(button.value);
        sun.value = map.time().slice(0, 16);
      });
    }
  }

  #update() {
    const camera = this.#map.camera();
    fill(element("camera"), [
      ["Longitude", `${camera.lon.toFixed(5)}°`],
      ["Latitude", `${camera.lat.toFixed(5)}°`],
      ["Height", metres(camera.height)],
      ["Heading", `${camera.heading_deg.toFixed(0)}°`],
      ["Pitch", `${camera.pitch_deg.toFixed(0)}°`],
    ]);
    const stats = this.#map.stats();
    const rows = [
      ["Adapter", stats.adapter === "Cpu" ? "software" : stats.adapter || "unnamed"],
      ["Picture", `${stats.page.width} × ${stats.page.height}`],
      ["Frame", `${stats.page.frame_milliseconds.toFixed(0)} ms`],
      ["Frames drawn", stats.page.frames_drawn],
      ["Requests", stats.requests.failed ? `${stats.requests.started}, ${stats.requests.failed} failed` : stats.requests.started],
      ["Loaded", bytes(sum(stats.bytes))],
    ];
    for (const [layer, count] of Object.entries(stats.tiles ?? {})) rows.push([`Tiles: ${layer}`, count]);
    for (const [pass, milliseconds] of Object.entries(stats.passes ?? {})) rows.push([`Pass: ${pass}`, `${milliseconds.toFixed(1)} ms`]);
    if (stats.survey) {
      rows.push(["Load maps", stats.survey.made], ["Load map read after", `${stats.survey.latency_milliseconds.toFixed(0)} ms`]);
      if (stats.survey.threshold > 1) rows.push(["Coarser, for lack of memory", `${stats.survey.threshold.toFixed(1)} ×`]);
    }
    if (stats.undergrowth) rows.push(["Plants near by", stats.undergrowth.plants]);
    if (stats.memory) rows.push(["Tiles in graphics memory", `${bytes(stats.memory.used_bytes)} of ${bytes(stats.memory.budget_bytes)}`]);
    fill(element("stats"), rows);
    drawPlan(element("load-map"), this.#map.load_map(), camera);
  }
}
