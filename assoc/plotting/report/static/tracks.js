// The report of a tracker: paths over the truth, a slider over time, a metric, the life of each track.
const TRAIL = 20;
const now = { index: 0, track: null, zoom: null };
const trackTable = byId('track-table');

// Hundreds of targets fill the view, without the sensors around them, and markers shrink.
const most = Math.max(data.truth.length, data.tracks.length);
const crowded = most > 60;
const sign = (size) => Math.max(0.45, Math.min(1, Math.sqrt(60 / Math.max(most, 1)))) * size;

const near = (() => {
  const box = [[Infinity, -Infinity], [Infinity, -Infinity]];
  const take = (x, y) => [[x, 0], [y, 1]].forEach(([value, axis]) => {
    box[axis] = [Math.min(box[axis][0], value), Math.max(box[axis][1], value)];
  });
  data.truth.forEach((one) => one.x.forEach((x, i) => take(x, one.y[i])));
  if (!crowded) data.sensors.forEach((one) => take(one.place[0], one.place[1]));
  const points = data.tracks.flatMap((one) => one.x.map((x, i) => [x, one.y[i]]));
  // most tracks as well, but not the few farthest
  [0, 1].forEach((axis) => {
    const sorted = points.map((p) => p[axis]).sort((a, b) => a - b);
    if (!sorted.length) return;
    const cut = data.truth.length ? 0.02 : 0;
    box[axis] = [Math.min(box[axis][0], sorted[Math.floor(cut * sorted.length)]), Math.max(box[axis][1], sorted[Math.floor((1 - cut) * (sorted.length - 1))])];
  });
  return box.map(([low, high]) => (low > high ? [-1, 1] : [low - 0.05 * (high - low) - 1, high + 0.05 * (high - low) + 1]));
})();
const reach = Math.max(...near.flat().map(Math.abs));
const unit = reach > 3000 ? { name: 'km', factor: 1e-3 } : { name: 'm', factor: 1 };

const until = (path, time) => {
  let count = 0;
  while (count < path.t.length && path.t[count] <= time + 1e-6) count += 1;
  return count;
};

const stretch = (path, first, last) => [
  path.x.slice(first, last).map((x) => x * unit.factor), path.y.slice(first, last).map((y) => y * unit.factor),
];

// One trace of many lines.
const linesOf = (parts) => {
  const x = [];
  const y = [];
  parts.forEach(([px, py]) => { x.push(...px, null); y.push(...py, null); });
  return { type: 'scatter', mode: 'lines', x, y, hoverinfo: 'skip' };
};

// A track or target exists at a time if one of its rows is at most about a slider step old.
const step = data.instants.length > 1 ? (data.instants[data.instants.length - 1] - data.instants[0]) / (data.instants.length - 1) : 1;
const present = (path, time) => {
  const count = until(path, time);
  return count > 0 && (path.t[count - 1] > time - 0.75 * step || (count < path.t.length && path.t[count] - path.t[count - 1] > step)) ? count - 1 : -1;
};

// What a track is called: by its call sign, address or code, where that is known.
const nameOf = (track) => plain(track.target || track.id);
const trackHover = (track, i) => [`<b>${nameOf(track)}</b>${track.target ? ` (track ${track.id})` : ''}, t ${moment(track.t[i])}`,
  ...['x', 'y', 'z'].map((axis) => `${axis} ${short(track[axis][i] * unit.factor, 5)} ${unit.name}`),
  ...(track.lat ? [`${track.lat[i].toFixed(5)}\u00b0, ${track.lon[i].toFixed(5)}\u00b0`] : []),
  ].join('<br>');

const drawTracks = () => {
  const time = data.instants[now.index];
  const since = data.instants[Math.max(0, now.index - TRAIL)];
  const traces = [];
  if (data.truth.length) {
    traces.push({ ...linesOf(data.truth.map((one) => stretch(one, 0, one.t.length))), name: 'truth', line: { color: THEME.faint, width: sign(6) } });
  }
  const scan = data.measured.find((one) => Math.abs(one.t - time) < 1e-6);
  if (data.measured.length) {
    const at = scan ? scan.at : [];
    traces.push({ type: 'scatter', mode: 'markers', name: 'measurements', x: at.map((p) => p[0] * unit.factor), y: at.map((p) => p[1] * unit.factor), hoverinfo: 'skip', marker: { symbol: 'x-thin', size: sign(6), line: { width: 1, color: THEME.line } } });
  }
  traces.push({ ...linesOf(data.tracks.map((one) => stretch(one, 0, one.t.length))), name: 'whole tracks', line: { color: '#7aa6c8', width: 1, dash: 'dot' } });
  COLOURS.forEach((colour, c) => {
    const group = data.tracks.filter((_, i) => i % COLOURS.length === c);
    const parts = group.map((one) => { const last = until(one, time); return stretch(one, Math.max(0, until(one, since) - 1), last); });
    traces.push({ ...linesOf(parts), name: `last ${TRAIL} steps`, showlegend: c === 0, legendgroup: 'trail', line: { color: colour, width: sign(2.5), dash: dashOf(c) } });
  });
  if (now.track !== null) {
    const one = data.tracks[now.track];
    traces.push({ ...linesOf([stretch(one, 0, one.t.length)]), name: `track ${nameOf(one)}`, line: { color: '#D55E00', width: 3 } });
  }
  const here = data.truth.map((one) => [one, present(one, time)]).filter(([, i]) => i >= 0);
  if (data.truth.length) {
    traces.push({ type: 'scatter', mode: 'markers', name: 'targets', x: here.map(([one, i]) => one.x[i] * unit.factor), y: here.map(([one, i]) => one.y[i] * unit.factor), hovertext: here.map(([one]) => `target ${plain(one.name || one.id)}`), hoverinfo: 'text', marker: { symbol: 'cross-thin', size: sign(14), line: { width: sign(2), color: THEME.ink } } });
  }
  const live = data.tracks.map((one, number) => [one, present(one, time), number]).filter(([, i]) => i >= 0);
  const named = live.length <= 40;
  traces.push({
    type: 'scatter', mode: named ? 'markers+text' : 'markers', name: 'tracks', x: live.map(([one, i]) => one.x[i] * unit.factor), y: live.map(([one, i]) => one.y[i] * unit.factor),
    text: live.map(([one]) => nameOf(one)), textposition: 'top right', textfont: { size: 11 }, customdata: live.map(([, , number]) => number),
    hovertext: live.map(([one, i]) => trackHover(one, i)), hoverinfo: 'text', marker: { symbol: 'circle', size: sign(8), color: live.map(([, , number]) => colourOf(number)), line: { width: 1, color: THEME.paper } },
  });
  if (data.sensors.length) {
    traces.push({ type: 'scatter', mode: 'markers', name: 'sensors', x: data.sensors.map((one) => one.place[0] * unit.factor), y: data.sensors.map((one) => one.place[1] * unit.factor), hovertext: data.sensors.map((one) => plain(one.name)), hoverinfo: 'text', marker: { symbol: 'triangle-up', size: 10, color: THEME.soft } });
  }
  const layout = layoutOf(`x (${unit.name})`, `y (${unit.name})`, { hovermode: 'closest', uirevision: now.zoom ? JSON.stringify(now.zoom) : 'whole', margin: { l: 62, r: 10, t: 10, b: 46 } });
  const ranges = (now.zoom || near).map((range) => range.map((value) => value * unit.factor));
  layout.xaxis.range = ranges[0];
  Object.assign(layout.yaxis, { range: ranges[1], scaleanchor: 'x' });
  layout.showlegend = byId('legend').getAttribute('aria-pressed') === 'true';
  layout.legend = { orientation: 'h', x: 0, xanchor: 'left', y: window.innerWidth < 820 ? -0.3 : -0.17, yanchor: 'top', font: { size: 12 } };
  const plot = byId('scene-plot');
  Plotly.react(plot, traces, layout, CONFIG);
  if (!plot.dataset.listens) {
    plot.dataset.listens = 'yes';
    plot.on('plotly_click', (event) => { if (typeof event.points[0].customdata === 'number') chooseTrack(event.points[0].customdata); });
  }
  byId('detail').textContent = `${live.length} tracks${data.truth.length ? `, ${here.length} targets` : ''} at this time${now.track === null ? '' : `; chosen: track ${data.tracks[now.track].target || data.tracks[now.track].id}`}`;
};

const marker = (at = onAxis(data.instants)[now.index]) => ({ type: 'line', x0: at, x1: at, yref: 'paper', y0: 0, y1: 1, line: { color: THEME.soft, width: 1.5, dash: 'dot' } });

const overTime = (id, curves, label) => {
  const layout = layoutOf(data.instants[0] > UNIX ? 'time (UTC)' : 'time (s)', label, { hovermode: 'closest', shapes: [marker()] });
  layout.yaxis.rangemode = 'tozero';
  // with many lines, names appear under the pointer: a legend would fill the plot
  layout.showlegend = curves.length <= 12;
  Plotly.react(id, curves.map(([name, x, y], i) => ({ type: 'scatter', mode: 'lines', name, x: onAxis(x), y, line: { color: colourOf(i), dash: dashOf(i), width: 1.8 } })), layout, CONFIG);
  const plot = byId(id);
  if (!plot.dataset.listens) {
    plot.dataset.listens = 'yes';
    plot.on('plotly_click', (event) => {
      const [{ curveNumber, pointNumber }] = event.points;
      const time = curves[curveNumber][1][pointNumber];
      const off = data.instants.map((one) => Math.abs(one - time));
      choose(off.indexOf(Math.min(...off)));
    });
  }
};

const countsOf = (paths) => data.instants.map((time) => paths.filter((one) => present(one, time) >= 0).length);
const counts = [['tracks', data.instants, countsOf(data.tracks)]];
if (data.truth.length) counts.push(['targets', data.instants, countsOf(data.truth)]);

const drawHistories = () => {
  const gospa = data.gospa;
  if (byId('metric-plot')) {
    overTime('metric-plot', [['GOSPA', gospa.times, gospa.distance], ['localisation', gospa.times, gospa.localisation], ['missed', gospa.times, gospa.missed], ['false', gospa.times, gospa.false]], 'GOSPA (m)');
  }
  if (byId('rates-plot')) {
    overTime('rates-plot', ['CT', 'MT', 'IT'].map((name) => [name, data.rates.times, data.rates[name]]), 'percent');
  }
  if (byId('altitude-plot')) {
    // only the longest tracks: more lines cannot be distinguished
    const told = data.tracks.filter((one) => one.h && one.h.some((h) => h !== null));
    const longest = [...told].sort((a, b) => b.t.length - a.t.length).slice(0, 30);
    overTime('altitude-plot', longest.map((one) => [`track ${nameOf(one)}`, one.t, one.h]), 'altitude (m)');
  }
  overTime('counts-plot', counts, 'tracks (number)');
};

const chooseTrack = (number) => {
  now.track = number;
  byId('nearer').disabled = false;
  markRow(trackTable, number);
  drawTracks();
};

let pending = 0;
const showTime = (index) => {
  now.index = index;
  drawTracks();
  window.clearTimeout(pending);
  pending = window.setTimeout(drawHistories, 30);
};

let choose = () => {};
try {
  if (data.instants.length) {
    choose = makeSlider(data.instants.length, (i) => `t = ${moment(data.instants[i])} (${i + 1} of ${data.instants.length})`, showTime);
    byId('nearer').addEventListener('click', () => {
      const one = data.tracks[now.track];
      const range = (values) => {
        const [low, high] = [Math.min(...values), Math.max(...values)];
        return [low - 0.1 * (high - low) - 50, high + 0.1 * (high - low) + 50];
      };
      now.zoom = [range(one.x), range(one.y)];
      drawTracks();
    });
    makeToggle(byId('legend'), !PHONE, drawTracks);
    byId('whole').addEventListener('click', () => {
      now.zoom = null;
      Plotly.purge('scene-plot');
      delete byId('scene-plot').dataset.listens;
      drawTracks();
    });
    onRow(trackTable, (number) => {
      chooseTrack(number);
      const began = data.tracks[number].t[0];
      if (present(data.tracks[number], data.instants[now.index]) < 0) choose(Math.max(0, data.instants.findIndex((one) => one >= began - 1e-6)));
      byId('scene').scrollIntoView({ behavior: 'smooth' });
    });
    choose(data.instants.length - 1);
  } else {
    byId('numbers').hidden = true;
  }
  document.documentElement.dataset.ready = 'yes';
} catch (error) {
  fail(error);
}
