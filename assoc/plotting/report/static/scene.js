// The scene of one scan, in plan or in space: truth, measurements, association, false alarms.
const SYMBOLS = ['circle-open', 'square-open', 'triangle-up-open', 'diamond-open', 'triangle-down-open', 'pentagon-open', 'hexagon-open'];
const SYMBOLS_IN_SPACE = ['circle-open', 'square-open', 'diamond-open', 'square', 'diamond', 'circle', 'cross'];
const TRAIL = 20;
const CONFIDENCE = Math.sqrt(5.991); // 95 % of a plane normal distribution

// Metres below 3 km, else kilometres.
const unitOf = (points) => {
  let reach = 0;
  for (const p of points) reach = Math.max(reach, Math.abs(p[0]), Math.abs(p[1]));
  return reach > 3000 ? { name: 'km', factor: 1e-3 } : { name: 'm', factor: 1 };
};

const metres = (value) => (Math.abs(value) >= 1e4 ? `${short(value / 1e3, 5)} km` : `${short(value, 4)} m`);

const componentText = (sensor, c, value) => {
  const degrees = sensor.angles[c];
  const shown = degrees ? `${short((value * 180) / Math.PI, 3)}\u00b0` : `${short(value, 3)} m`;
  return { shown, sigmas: `${short(value / sensor.sigma[c], 2)} \u03c3` };
};

// Description and residuals of a tuple: text for hovering, rows for the panel.
const residualRows = (source, scan, target) => {
  const rows = [];
  scan.tuples[target].forEach((index, s) => {
    const sensor = source.sensors[s];
    if (index === 0) { rows.push([sensor.name, 'missed', '', '']); return; }
    if (!scan.view?.residuals) { rows.push([sensor.name, `no. ${index}`, '', '']); return; }
    let before = 0;
    for (let t = 0; t < target; t += 1) if (scan.tuples[t][s] !== 0) before += 1;
    scan.view.residuals[s][before].forEach((value, c) => {
      const { shown, sigmas } = componentText(sensor, c, value);
      rows.push([c === 0 ? `${sensor.name} no. ${index}` : '', sensor.components[c], shown, sigmas]);
    });
  });
  return rows;
};

const tupleText = (scan, target) => `(${scan.tuples[target].join(', ')})`;

// Degrees, if the scene has an origin on the earth.
const onEarth = (places, i) => (places ? [`${places[i][0].toFixed(5)}\u00b0, ${places[i][1].toFixed(5)}\u00b0`] : []);

const targetHover = (source, scan, target) => {
  const place = scan.view.positions[target];
  const sigma = scan.view.sigmas[target];
  const lines = [`<b>target ${target + 1}</b>, tuple ${tupleText(scan, target)}`, `cost ${short(scan.costs[target], 5)}`];
  ['x', 'y', 'z'].forEach((axis, i) => lines.push(`${axis} ${metres(place[i])} \u00b1 ${short(sigma[i], 3)} m`));
  lines.push(...onEarth(scan.view.degrees, target));
  residualRows(source, scan, target).forEach(([name, component, shown, sigmas]) => {
    lines.push(`${plain(name)} ${component} ${shown}${sigmas ? `, ${sigmas}` : ''}`);
  });
  return lines.join('<br>');
};

const measurementHover = (source, scan, s, i) => {
  const measured = scan.view.measured[s];
  const target = measured.target[i];
  const lines = [`<b>${plain(source.sensors[s].name)} no. ${i + 1}</b>`];
  if (target < 0) lines.push('declared a false alarm');
  else lines.push(`target ${target + 1}, tuple ${tupleText(scan, target)}, cost ${short(scan.costs[target], 5)}`);
  if (target >= 0) {
    const row = residualRows(source, scan, target);
    let at = row.findIndex((one) => one[0] === `${source.sensors[s].name} no. ${i + 1}`);
    for (; at >= 0 && at < row.length && (row[at][0] === '' || row[at][0] === `${source.sensors[s].name} no. ${i + 1}`); at += 1) {
      lines.push(`${row[at][1]} ${row[at][2]}, ${row[at][3]}`);
    }
  }
  if (measured.source) lines.push(measured.source[i] < 0 ? 'in truth a false alarm' : `in truth of target id ${measured.source[i]}`);
  return lines.join('<br>');
};

const ellipse = (centre, [xx, xy, yy]) => {
  const trace = xx + yy;
  const root = Math.sqrt(Math.max(0, ((xx - yy) / 2) ** 2 + xy ** 2));
  const a = CONFIDENCE * Math.sqrt(Math.max(0, trace / 2 + root));
  const b = CONFIDENCE * Math.sqrt(Math.max(0, trace / 2 - root));
  const turn = 0.5 * Math.atan2(2 * xy, xx - yy);
  const points = [];
  for (let k = 0; k <= 36; k += 1) {
    const phi = (2 * Math.PI * k) / 36;
    const u = a * Math.cos(phi);
    const v = b * Math.sin(phi);
    points.push([centre[0] + u * Math.cos(turn) - v * Math.sin(turn), centre[1] + u * Math.sin(turn) + v * Math.cos(turn), centre[2]]);
  }
  return points;
};

// All points of a source, for the unit and for axes that are the same for all scans.
const pointsOf = (number) => {
  const source = data.sources[number];
  // many targets fill the view; a double click shows the sensors
  const crowded = data.scans.some((scan) => scan.source === number && scan.targets > 40);
  const points = crowded ? [] : source.sensors.map((sensor) => sensor.place);
  const far = [];
  for (const scan of data.scans) {
    if (scan.source !== number || !scan.view) continue;
    scan.view.truth.forEach((one) => points.push(one.slice(1)));
    far.push(...scan.view.positions);
    scan.view.measured.forEach((one, s) => { if (!source.sensors[s].ray) far.push(...one.at); });
  }
  return [points, far];
};

const boxOf = (points, far) => [0, 1, 2].map((axis) => {
  let low = Infinity;
  let high = -Infinity;
  for (const p of points) { low = Math.min(low, p[axis]); high = Math.max(high, p[axis]); }
  // most targets and false alarms as well, but not the few farthest
  const sorted = far.map((p) => p[axis]).sort((a, b) => a - b);
  if (sorted.length) {
    low = Math.min(low, sorted[Math.floor(0.03 * sorted.length)]);
    high = Math.max(high, sorted[Math.floor(0.97 * (sorted.length - 1))]);
  }
  const margin = 0.05 * (high - low) || 1;
  return [low - margin, high + margin];
});

const frames = data.sources.map((source, number) => {
  if (!source.scene) return null;
  const [points, far] = pointsOf(number);
  return { unit: unitOf(points), box: boxOf(points, far) };
});

const series = (name, points, unit, space, more) => ({
  type: space ? 'scatter3d' : 'scatter',
  name,
  x: points.map((p) => (p ? p[0] * unit.factor : null)),
  y: points.map((p) => (p ? p[1] * unit.factor : null)),
  ...(space ? { z: points.map((p) => (p ? p[2] * unit.factor : null)) } : {}),
  ...more,
});

// Lines with gaps between them.
const strokes = (parts) => parts.flatMap((part) => [...part, null]);

const truthTrails = (index) => {
  const scan = data.scans[index];
  const trails = new Map();
  for (let k = Math.max(0, index - TRAIL); k <= index; k += 1) {
    const other = data.scans[k];
    if (other.source !== scan.source || !other.view) continue;
    other.view.truth.forEach(([id, ...place]) => {
      if (!trails.has(id)) trails.set(id, []);
      trails.get(id).push(place);
    });
  }
  return strokes([...trails.values()]);
};

const sceneTraces = (index, space, chosen) => {
  const scan = data.scans[index];
  const source = data.sources[scan.source];
  const { unit } = frames[scan.source];
  const view = scan.view;
  const symbols = space ? SYMBOLS_IN_SPACE : SYMBOLS;
  // many targets need smaller markers
  const many = view.positions.length;
  const crowd = many > 150 ? 0.32 : many > 40 ? 0.6 : 1;
  // overlapping markers: denser regions are darker
  const opacity = many > 150 ? 0.65 : 1;
  const stroke = many > 150 ? 1 : 2;
  const size = crowd * (space ? 0.55 : 1);
  const traces = [];
  const add = (name, points, more) => traces.push(series(name, points, unit, space, more));
  if (view.truth.length) {
    add(`truth, last ${TRAIL} scans`, truthTrails(index), { mode: 'lines', line: { color: THEME.line, width: space ? 3 : 1.5 }, hoverinfo: 'skip' });
    add('truth', view.truth.map((one) => one.slice(1)), {
      mode: 'markers',
      marker: space ? { symbol: 'cross', size: 4, color: THEME.ink } : { symbol: 'cross-thin', size: 15 * crowd, color: THEME.ink, opacity, line: { width: stroke, color: THEME.ink } },
      hovertext: view.truth.map(([id, x, y, z]) => `truth, target id ${id}<br>x ${metres(x)}<br>y ${metres(y)}<br>z ${metres(z)}`), hoverinfo: 'text',
    });
  }
  const links = [];
  const rays = { of: [], lost: [] };
  view.measured.forEach((measured, s) => measured.at.forEach((at, i) => {
    const target = measured.target[i];
    const sensor = source.sensors[s];
    if (sensor.ray) rays[target < 0 ? 'lost' : 'of'].push([[sensor.place[0], sensor.place[1], at[2]], at]);
    if (target >= 0) links.push([at, view.positions[target]]);
  }));
  if (rays.lost.length) add('bearings of false alarms', strokes(rays.lost), { mode: 'lines', line: { color: THEME.faint, width: 1, dash: 'dot' }, hoverinfo: 'skip' });
  if (rays.of.length) add('bearings of targets', strokes(rays.of), { mode: 'lines', line: { color: '#56B4E9', width: 1 }, hoverinfo: 'skip' });
  if (!space) {
    add('95 % ellipses', strokes(view.positions.map((p, t) => ellipse(p, view.ellipses[t]))), { mode: 'lines', line: { color: THEME.soft, width: 1, dash: 'dot' }, hoverinfo: 'skip' });
  }
  add('association', strokes(links), { mode: 'lines', line: { color: THEME.ink, width: space ? 2 : 1 }, hoverinfo: 'skip' });
  const lost = { at: [], text: [] };
  view.measured.forEach((measured, s) => {
    const kept = measured.at.map((_, i) => i).filter((i) => measured.target[i] >= 0);
    measured.at.forEach((at, i) => {
      if (measured.target[i] >= 0) return;
      lost.at.push(at);
      lost.text.push(measurementHover(source, scan, s, i));
    });
    add(plain(source.sensors[s].name), kept.map((i) => measured.at[i]), {
      mode: 'markers',
      marker: { symbol: symbols[s % symbols.length], size: (15 - 2 * (s % 3)) * size, color: colourOf(s), opacity, line: { width: stroke, color: colourOf(s) } },
      hovertext: kept.map((i) => measurementHover(source, scan, s, i)), hoverinfo: 'text',
      customdata: kept.map((i) => measured.target[i]),
    });
  });
  add('false alarms', lost.at, {
    mode: 'markers', hovertext: lost.text, hoverinfo: 'text',
    marker: space ? { symbol: 'circle', size: 3, color: THEME.line } : { symbol: 'x-thin', size: 8 * Math.sqrt(crowd), color: THEME.line, line: { width: 1.5, color: THEME.line } },
  });
  add('targets found', view.positions, {
    mode: 'markers', marker: { symbol: 'circle', size: 6 * crowd * (space ? 0.7 : 1), color: THEME.ink },
    hovertext: view.positions.map((_, t) => targetHover(source, scan, t)), hoverinfo: 'text',
    customdata: view.positions.map((_, t) => t),
  });
  add('sensors', source.sensors.map((sensor) => sensor.place), {
    mode: 'markers+text', text: source.sensors.map((sensor) => plain(sensor.name)), textposition: 'bottom center', textfont: { size: 11, color: THEME.soft },
    marker: { symbol: space ? 'diamond' : 'triangle-up', size: 11 * size, color: THEME.soft }, hoverinfo: 'text', hovertext: source.sensors.map((sensor) => plain(sensor.name)),
  });
  if (chosen !== null && chosen < view.positions.length) {
    add('chosen', [view.positions[chosen]], {
      mode: 'markers', hoverinfo: 'skip', showlegend: false,
      marker: { symbol: 'circle-open', size: space ? 14 : 28, color: '#D55E00', line: { width: 3, color: '#D55E00' } },
    });
  }
  return traces;
};

// The square around a target with its measurements, its ellipse, and a margin.
const boxAround = (scan, target) => {
  const centre = scan.view.positions[target];
  const points = [...ellipse(centre, scan.view.ellipses[target])];
  scan.view.measured.forEach((measured) => measured.at.forEach((at, i) => { if (measured.target[i] === target) points.push(at); }));
  let reach = 1;
  for (const p of points) reach = Math.max(reach, Math.abs(p[0] - centre[0]), Math.abs(p[1] - centre[1]));
  return [0, 1].map((axis) => [centre[axis] - 1.3 * reach, centre[axis] + 1.3 * reach]);
};

const IN_SPACE = { gridcolor: THEME.grid, backgroundcolor: THEME.paper, color: THEME.ink, nticks: PHONE ? 4 : 7 };

const sceneLayout = (number, space, zoom) => {
  const { unit, box } = frames[number];
  const scaled = (range) => range.map((value) => value * unit.factor);
  const key = `${number} ${space} ${zoom ? JSON.stringify(zoom) : ''}`;
  if (!space) {
    const layout = layoutOf(`x (${unit.name})`, `y (${unit.name})`, { uirevision: key, hovermode: 'closest', margin: { l: 62, r: 10, t: 10, b: 46 } });
    const ranges = zoom || box;
    Object.assign(layout.xaxis, { range: scaled(ranges[0]) });
    Object.assign(layout.yaxis, { range: scaled(ranges[1]), scaleanchor: 'x' });
    layout.showlegend = !byId('legend') || byId('legend').getAttribute('aria-pressed') === 'true';
    layout.legend = { orientation: 'h', x: 0, xanchor: 'left', y: PHONE ? -0.3 : -0.17, yanchor: 'top', font: { size: 12 } };
    return layout;
  }
  const reach = box.map(([low, high]) => high - low);
  const widest = Math.max(reach[0], reach[1]);
  return {
    font: PHONE ? { ...FONT, size: 11 } : FONT, paper_bgcolor: THEME.paper, margin: { l: 0, r: 0, t: 0, b: 0 }, uirevision: key,
    showlegend: !byId('legend') || byId('legend').getAttribute('aria-pressed') === 'true',
    hoverlabel: { align: 'left', font: { size: 12 } },
    legend: { orientation: 'h', x: 0, xanchor: 'left', y: 0, yanchor: 'top', font: { size: 12 } },
    scene: {
      xaxis: { ...IN_SPACE, title: { text: `x (${unit.name})` }, range: scaled(box[0]) },
      yaxis: { ...IN_SPACE, title: { text: `y (${unit.name})` }, range: scaled(box[1]) },
      zaxis: { ...IN_SPACE, title: { text: `z (${unit.name})` }, range: scaled(box[2]) },
      aspectmode: 'manual',
      // heights are stretched if they would look flat
      aspectratio: { x: (1.3 * reach[0]) / widest, y: (1.3 * reach[1]) / widest, z: Math.max(0.45, (1.3 * reach[2]) / widest) },
      camera: { eye: window.innerWidth < 820 ? { x: -1.5, y: -1.8, z: 1.2 } : { x: -1.1, y: -1.3, z: 0.9 } },
    },
  };
};
