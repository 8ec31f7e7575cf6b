"use strict";
// Draws what the server pushes: sensors, plots that fade, tracks with their trails, speeds and ids.
const canvas = document.getElementById("map"), state = document.getElementById("state");
const show = { labels: true, plots: true };
const TRAIL = 40, FADE = 4, LEADER = 30;
let scene = null, time = 0, tracks = [], trails = new Map(), plots = [], view = null, ended = false, pending = false;

function style(name) { return getComputedStyle(document.documentElement).getPropertyValue(name).trim(); }

function fit() {
  const [[x0, x1], [y0, y1]] = scene.region;
  const scale = 0.92 * Math.min(canvas.clientWidth / (x1 - x0), canvas.clientHeight / (y1 - y0));
  view = { x: (x0 + x1) / 2, y: (y0 + y1) / 2, scale: scale };
}

function place(x, y) {
  return [canvas.clientWidth / 2 + (x - view.x) * view.scale, canvas.clientHeight / 2 - (y - view.y) * view.scale];
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
  g.fillStyle = style("--sensor");
  for (const [name, x, y] of scene.sensors) {
    const [a, b] = place(x, y);
    g.beginPath(); g.moveTo(a, b - 6); g.lineTo(a + 6, b + 5); g.lineTo(a - 6, b + 5); g.fill();
    g.fillText(name, a + 9, b + 4);
  }
  if (show.plots) {
    g.fillStyle = style("--plot");
    plots.forEach((one, age) => {
      g.globalAlpha = 1 - age / FADE;
      for (const [x, y] of one) { const [a, b] = place(x, y); g.fillRect(a - 1.5, b - 1.5, 3, 3); }
    });
    g.globalAlpha = 1;
  }
  const ink = style("--ink"), colour = style("--track");
  for (const [id, x, y, z, vx, vy] of tracks) {
    g.strokeStyle = colour; g.fillStyle = colour; g.lineWidth = 1.5;
    g.globalAlpha = 0.5; g.beginPath();
    (trails.get(id) || []).forEach(([u, v], i) => { const [a, b] = place(u, v); if (i) g.lineTo(a, b); else g.moveTo(a, b); });
    g.stroke(); g.globalAlpha = 1;
    const [a, b] = place(x, y), [c, d] = place(x + LEADER * vx, y + LEADER * vy);
    g.beginPath(); g.moveTo(a, b); g.lineTo(c, d); g.stroke();
    g.beginPath(); g.arc(a, b, 4, 0, 2 * Math.PI); g.fill();
    if (show.labels) { g.fillStyle = ink; g.fillText(z === null ? String(id) : id + "  " + Math.round(z) + " m", a + 7, b - 7); }
  }
}

function ruler(g, h) {
  let length = 10 ** Math.floor(Math.log10(160 / view.scale));
  for (const step of [5, 2]) if (length * step * view.scale < 160) { length *= step; break; }
  const text = length >= 1000 ? length / 1000 + " km" : length + " m";
  g.strokeStyle = style("--soft"); g.fillStyle = style("--soft"); g.lineWidth = 1;
  g.beginPath(); g.moveTo(14, h - 20); g.lineTo(14, h - 14); g.lineTo(14 + length * view.scale, h - 14);
  g.lineTo(14 + length * view.scale, h - 20); g.stroke();
  g.fillText(text, 18, h - 20);
}

function take(picture) {
  time = picture.time; tracks = picture.tracks;
  plots = [picture.plots, ...plots].slice(0, FADE);
  const alive = new Map();
  for (const [id, x, y] of tracks) alive.set(id, [...(trails.get(id) || []), [x, y]].slice(-TRAIL));
  trails = alive;
  say(); redraw();
}

// Unix times as UTC.
function moment(time) {
  return time > 1e9 ? new Date(Math.round(1e3 * time)).toISOString().replace("T", " ").replace(/\.?0*Z$/, "Z") : Number(time.toFixed(3)) + " s";
}

function say(word) {
  const count = plots.length ? plots[0].length : 0;
  state.textContent = (word ? word + ": " : "") + moment(time) + ", " + tracks.length + " tracks, " + count + " plots";
}

const events = new EventSource("/events");
events.addEventListener("scene", (event) => {
  scene = JSON.parse(event.data);
  if (scene.title) { document.title = scene.title; document.querySelector("h1").textContent = scene.title; }
  redraw();
});
events.addEventListener("picture", (event) => take(JSON.parse(event.data)));
events.addEventListener("end", () => { ended = true; events.close(); say("ended"); });
events.onerror = () => { if (!ended) say("connection lost"); };

for (const name of ["labels", "plots"]) {
  const button = document.getElementById(name);
  button.addEventListener("click", () => {
    show[name] = !show[name]; button.setAttribute("aria-pressed", String(show[name])); redraw();
  });
}
document.getElementById("fit").addEventListener("click", () => { view = null; redraw(); });
window.addEventListener("resize", redraw);

let drag = null;
canvas.addEventListener("pointerdown", (event) => { drag = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
canvas.addEventListener("pointerup", () => { drag = null; });
canvas.addEventListener("pointermove", (event) => {
  if (!drag || !view) return;
  view.x -= (event.clientX - drag[0]) / view.scale; view.y += (event.clientY - drag[1]) / view.scale;
  drag = [event.clientX, event.clientY]; redraw();
});
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  if (view) { view.scale *= Math.exp(-0.0015 * event.deltaY); redraw(); }
}, { passive: false });
