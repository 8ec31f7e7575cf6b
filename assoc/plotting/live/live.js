"use strict";
// Draws what the server pushes: sensors, plots that fade, tracks with their trails, speeds and ids.
const byId = (id) => document.getElementById(id);
const canvas = byId("map"), state = byId("state"), detail = byId("detail");
const show = { labels: true, plots: true, rings: true };
const TRAIL = 40, FADE = 4, LEADER = 30, NEAR = 18, STEP = 1.5;
let scene = null, time = 0, tracks = [], trails = new Map(), plots = [], counts = {}, names = [], called = {}, view = null, held = false, ended = false, pending = false, chosen = null;

function style(name) { return getComputedStyle(document.documentElement).getPropertyValue(name).trim(); }

// The traffic, with the radars near it; the whole region while there is none.
function fit() {
  let [[x0, x1], [y0, y1]] = scene.region;
  const seen = [...tracks.map(([, x, y]) => [x, y]), ...(tracks.length ? [] : plots.flat())];
  if (seen.length) {
    const spot = (k, all) => [Math.min(...all.map((one) => one[k])), Math.max(...all.map((one) => one[k]))];
    const wide = Math.max(...[0, 1].map((k) => { const [low, high] = spot(k, seen); return high - low; }), 2000);
    const middle = [0, 1].map((k) => { const [low, high] = spot(k, seen); return (low + high) / 2; });
    const near = scene.sensors.filter(([, x, y]) => x !== null && Math.hypot(x - middle[0], y - middle[1]) < wide).map(([, x, y]) => [x, y]);
    [[x0, x1], [y0, y1]] = [0, 1].map((k) => { const [low, high] = spot(k, [...seen, ...near]); return [low - 0.1 * wide, high + 0.1 * wide]; });
  }
  const scale = 0.92 * Math.min(canvas.clientWidth / (x1 - x0), canvas.clientHeight / (y1 - y0));
  view = { x: (x0 + x1) / 2, y: (y0 + y1) / 2, scale: scale };
}

function place(x, y) {
  return [canvas.clientWidth / 2 + (x - view.x) * view.scale, canvas.clientHeight / 2 - (y - view.y) * view.scale];
}

// Zoom by a factor; what is at the point (a, b) of the canvas stays there.
function zoom(factor, a = canvas.clientWidth / 2, b = canvas.clientHeight / 2) {
  if (!view) return;
  held = true;
  const away = [a - canvas.clientWidth / 2, canvas.clientHeight / 2 - b];
  const now = view.scale * factor;
  view = { x: view.x + away[0] / view.scale - away[0] / now, y: view.y + away[1] / view.scale - away[1] / now, scale: now };
  redraw();
}

function move(right, down) {
  if (!view) return;
  held = true;
  view.x += right / view.scale; view.y -= down / view.scale;
  redraw();
}

function redraw() { if (!pending) { pending = true; requestAnimationFrame(draw); } }

function draw() {
  pending = false;
  if (!scene) return;
  const ratio = window.devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
  if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) {
    canvas.width = Math.round(w * ratio); canvas.height = Math.round(h * ratio);
  }
  if (!view) fit();
  const g = canvas.getContext("2d");
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  g.clearRect(0, 0, w, h);
  g.font = "12px system-ui, sans-serif";
  ruler(g, h);
  const taken = [];
  if (show.rings) rings(g);
  g.fillStyle = style("--sensor");
  for (const [name, x, y] of scene.sensors) {
    if (x === null) continue;
    const [a, b] = place(x, y);
    g.beginPath(); g.moveTo(a, b - 6); g.lineTo(a + 6, b + 5); g.lineTo(a - 6, b + 5); g.fill();
    label(g, taken, name, a, b);
  }
  if (show.plots) {
    g.fillStyle = style("--plot");
    plots.forEach((one, age) => {
      g.globalAlpha = 1 - age / FADE;
      for (const [x, y] of one) { const [a, b] = place(x, y); g.fillRect(a - 1.5, b - 1.5, 3, 3); }
    });
    g.globalAlpha = 1;
  }
  const ink = style("--ink"), colour = style("--track"), marked = style("--chosen"), alarm = style("--sensor");
  // the chosen one first, so that it has its label
  for (const [id, x, y, height, vx, vy, , , status, quality] of [...tracks].sort((one, other) => (other[0] === chosen) - (one[0] === chosen))) {
    g.strokeStyle = g.fillStyle = id === chosen ? marked : alarming(quality) ? alarm : colour; g.lineWidth = id === chosen ? 2.5 : 1.5;
    g.globalAlpha = 0.5; g.beginPath();
    (trails.get(id) || []).forEach(([u, v], i) => { const [a, b] = place(u, v); if (i) g.lineTo(a, b); else g.moveTo(a, b); });
    g.stroke(); g.globalAlpha = 1;
    const [a, b] = place(x, y), [c, d] = place(x + LEADER * vx, y + LEADER * vy);
    // hollow without a detection now, dashed when lost
    g.setLineDash(status === "lost" ? [3, 3] : []);
    g.beginPath(); g.moveTo(a, b); g.lineTo(c, d); g.stroke();
    g.beginPath(); g.arc(a, b, 4, 0, 2 * Math.PI); if (status === "confirmed") g.fill(); else g.stroke();
    g.setLineDash([]);
    if (show.labels || id === chosen) { g.fillStyle = ink; label(g, taken, words(id, height, vx, vy, quality), a, b); }
  }
}

function alarming(quality) { return quality !== null && !quality[1]; }

// Code (or number), level and speed, as on a radar's screen.
function words(id, height, vx, vy, quality) {
  // a height that nothing has measured may be anything
  const level = height === null || height < -1000 || height > 30000 ? "" : height < 1500 ? "  " + Math.round(height) + " m" : "  FL" + String(Math.round(height / 30.48)).padStart(3, "0");
  return (called[id] || id) + (alarming(quality) ? "!" : "") + level + "  " + Math.round(Math.hypot(vx, vy) * 3600 / 1852) + " kt";
}

// Rings of range around each radar, out to its reach: as far apart as the ruler is long.
function rings(g) {
  const length = ruled(), w = canvas.clientWidth, h = canvas.clientHeight;
  g.strokeStyle = style("--line"); g.fillStyle = style("--soft"); g.lineWidth = 1;
  for (const [, x, y, reach] of scene.sensors) {
    if (x === null || reach === null) continue;
    const [a, b] = place(x, y), far = Math.min(reach * view.scale, Math.hypot(w, h) + Math.hypot(a - w / 2, b - h / 2));
    for (let r = length; r * view.scale <= far; r += length) {
      g.beginPath(); g.arc(a, b, r * view.scale, 0, 2 * Math.PI); g.stroke();
    }
  }
}

// Write a text beside a point where none is yet, or not at all.
function label(g, taken, text, a, b) {
  const w = g.measureText(text).width, h = 13;
  for (const [x, y] of [[a + 8, b - 7], [a + 8, b + 15], [a - 8 - w, b - 7], [a - 8 - w, b + 15]]) {
    const box = [x - 2, y - h, x + w + 2, y + 3];
    if (box[0] < 0 || box[2] > canvas.clientWidth) continue;
    if (taken.some((other) => box[0] < other[2] && other[0] < box[2] && box[1] < other[3] && other[1] < box[3])) continue;
    taken.push(box);
    // lines behind it do not disturb
    g.strokeStyle = style("--wash"); g.lineWidth = 3; g.strokeText(text, x, y);
    g.fillText(text, x, y);
    return;
  }
}

function ruled() {
  const length = 10 ** Math.floor(Math.log10(160 / view.scale));
  return length * ([5, 2].find((step) => length * step * view.scale < 160) || 1);
}

function ruler(g, h) {
  const length = ruled();
  const text = length >= 1000 ? length / 1000 + " km" : length + " m";
  g.strokeStyle = style("--soft"); g.fillStyle = style("--soft"); g.lineWidth = 1;
  g.beginPath(); g.moveTo(14, h - 20); g.lineTo(14, h - 14); g.lineTo(14 + length * view.scale, h - 14);
  g.lineTo(14 + length * view.scale, h - 20); g.stroke();
  g.fillText(text, 18, h - 20);
}

function take(picture) {
  // the first view is on the traffic
  if (view && !held && !tracks.length && (picture.tracks.length || !plots.flat().length)) view = null;
  time = picture.time; tracks = picture.tracks; counts = picture.counts; called = picture.names;
  plots = [picture.plots, ...plots].slice(0, FADE);
  const alive = new Map();
  for (const [id, x, y] of tracks) alive.set(id, [...(trails.get(id) || []), [x, y]].slice(-TRAIL));
  trails = alive;
  chips(picture.heard); describe(); say(); redraw();
}

// A chip for each sensor: when it was heard last, and how many plots were taken and refused.
function chips(heard) {
  names = heard.map(([name]) => name);
  byId("sensors").replaceChildren(...heard.map(([name, last, count, refused, silent]) => {
    const chip = document.createElement("li");
    const ago = last === null ? "not heard yet" : silent ? "silent since " + moment(last) : Math.max(0, time - last).toFixed(1) + " s ago";
    chip.textContent = name + ": " + ago + ", " + count + " plots" + (refused ? ", " + refused + " refused" : "");
    chip.classList.toggle("silent", silent || last === null);
    return chip;
  }));
}

// Unix times as UTC.
function moment(time) {
  return time > 1e9 ? new Date(Math.round(1e3 * time)).toISOString().replace("T", " ").replace(/\.?0*Z$/, "Z") : Number(time.toFixed(3)) + " s";
}

function say(word) {
  const count = plots.length ? plots[0].length : 0;
  const odd = Object.entries(counts).filter(([, number]) => number).map(([kind, number]) => ", " + number + " " + kind).join("");
  const of = (what, some) => { const number = tracks.filter(some).length; return number ? number + " " + what : null; };
  const lives = [of("coasting", (one) => one[8] === "coasting"), of("lost", (one) => one[8] === "lost"), of("inconsistent", (one) => alarming(one[9]))].filter(Boolean);
  state.textContent = (word ? word + ": " : "") + moment(time) + ", " + tracks.length + " tracks" + (lives.length ? " (" + lives.join(", ") + ")" : "") + ", " + count + " plots" + odd;
}

function choose(id) { chosen = id; describe(); redraw(); }

function describe() {
  const track = tracks.find((one) => one[0] === chosen);
  detail.hidden = chosen === null;
  if (chosen === null) return;
  if (!track) { detail.textContent = "Track " + chosen + " has ended"; return; }
  const [id, x, y, height, vx, vy, hits, started, status, quality, latitude, longitude] = track;
  const heading = (Math.atan2(vx, vy) * 180 / Math.PI + 360) % 360;
  const rows = [["Track", id], ...(called[id] ? [["Code", called[id]]] : []), ["Status", status], ["x, y", (x / 1000).toFixed(2) + ", " + (y / 1000).toFixed(2) + " km"]];
  if (latitude !== undefined) rows.push(["Place", latitude.toFixed(5) + "\u00b0, " + longitude.toFixed(5) + "\u00b0"]);
  rows.push(["Height", height === null ? "unknown" : Math.round(height) + " m"], ["Speed", Math.hypot(vx, vy).toFixed(1) + " m/s"]);
  rows.push(["Heading", heading.toFixed(0) + "\u00b0"], ["Since", moment(started)], ["Hits", hits]);
  if (quality) {
    quality[2].forEach((number, s) => rows.push(["from " + names[s], number]));
    rows.push(["NIS", quality[0] === null ? "not known yet" : quality[0] + (quality[1] ? "" : ": inconsistent")]);
  }
  const list = document.createElement("dl");
  for (const [name, value] of rows) {
    for (const [tag, text] of [["dt", name], ["dd", value]]) list.appendChild(document.createElement(tag)).textContent = text;
  }
  detail.replaceChildren(list);
}

const events = new EventSource("/events");
events.addEventListener("scene", (event) => {
  scene = JSON.parse(event.data);
  if (scene.title) { document.title = scene.title; document.querySelector("h1").textContent = scene.title; }
  chips(scene.sensors.map(([name]) => [name, null, 0, 0, false]));
  redraw();
});
events.addEventListener("trails", (event) => { trails = new Map(Object.entries(JSON.parse(event.data)).map(([id, trail]) => [Number(id), trail])); });
events.addEventListener("picture", (event) => take(JSON.parse(event.data)));
events.addEventListener("end", () => { ended = true; events.close(); say("ended"); });
events.onerror = () => { if (!ended) say("connection lost"); };

for (const name of ["labels", "plots", "rings"]) {
  const button = byId(name);
  button.addEventListener("click", () => {
    show[name] = !show[name]; button.setAttribute("aria-pressed", String(show[name])); redraw();
  });
}
byId("fit").addEventListener("click", () => { view = null; redraw(); });
byId("nearer").addEventListener("click", () => zoom(STEP));
byId("farther").addEventListener("click", () => zoom(1 / STEP));
window.addEventListener("resize", redraw);

// Pointers on the map: one drags or clicks, two pinch.
const pointers = new Map();
let moved = false;
const spread = () => { const [one, other] = [...pointers.values()]; return Math.hypot(one[0] - other[0], one[1] - other[1]); };
canvas.addEventListener("pointerdown", (event) => {
  pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
  moved = pointers.size > 1;
  try { canvas.setPointerCapture(event.pointerId); } catch { /* a pointer that is gone already */ }
});
canvas.addEventListener("pointermove", (event) => {
  const before = pointers.get(event.pointerId);
  if (!before || !view) return;
  const here = [event.offsetX, event.offsetY];
  if (pointers.size === 2) {
    const apart = spread();
    pointers.set(event.pointerId, here);
    const [one, other] = [...pointers.values()];
    if (apart > 0) zoom(spread() / apart, (one[0] + other[0]) / 2, (one[1] + other[1]) / 2);
    return;
  }
  if (!moved && Math.hypot(here[0] - before[0], here[1] - before[1]) < 4) return;
  moved = true;
  pointers.set(event.pointerId, here);
  move(before[0] - here[0], before[1] - here[1]);
});
for (const name of ["pointerup", "pointercancel"]) {
  canvas.addEventListener(name, (event) => {
    pointers.delete(event.pointerId);
    if (moved || !view || name === "pointercancel") return;
    const far = tracks.map(([id, x, y]) => { const [a, b] = place(x, y); return [Math.hypot(a - event.offsetX, b - event.offsetY), id]; });
    const [distance, id] = far.sort((one, other) => one[0] - other[0])[0] || [Infinity, null];
    choose(distance < NEAR ? id : null);
  });
}
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  zoom(Math.exp(-0.0015 * event.deltaY), event.offsetX, event.offsetY);
}, { passive: false });

const KEYS = {
  ArrowLeft: () => move(-60, 0), ArrowRight: () => move(60, 0), ArrowUp: () => move(0, -60), ArrowDown: () => move(0, 60),
  "+": () => zoom(STEP), "=": () => zoom(STEP), "-": () => zoom(1 / STEP), 0: () => { view = null; redraw(); },
  n: () => next(1), p: () => next(-1), Escape: () => choose(null),
};
function next(step) {
  const ids = tracks.map(([id]) => id), at = ids.indexOf(chosen);
  if (ids.length) choose(ids[at < 0 ? 0 : (at + step + ids.length) % ids.length]);
}
canvas.addEventListener("keydown", (event) => {
  if (!KEYS[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
  event.preventDefault();
  KEYS[event.key]();
});
