// The report of an association: slider, scene, tables and histories, all linked.
const state = { scan: 0, chosen: null, space: false, zoom: null };
const scanTable = byId('scan-table');

const scanLabel = (index) => {
  const scan = data.scans[index];
  const several = data.sources.length > 1 ? `${data.sources[scan.source].title}, ` : '';
  return `${several}scan ${scan.scan}${scan.time === null ? '' : `, t = ${moment(scan.time)}`} (${index + 1} of ${data.scans.length})`;
};

const drawScene = () => {
  const scan = data.scans[state.scan];
  const plot = byId('scene-plot');
  const source = data.sources[scan.source];
  byId('dimensions').hidden = !scan.view || !source.height;
  byId('zooms').hidden = !scan.view;
  if (!scan.view) {
    Plotly.purge(plot);
    plot.replaceChildren(element('p', source.scene
      ? 'This scan is not drawn: its detail was left out to keep the file small. Its targets are in the table.'
      : 'An assignment problem has no places to draw. Its chosen tuples are in the table.', { class: 'note' }));
    plot.classList.remove('large');
    plot.parentElement.classList.add('bare');
    return;
  }
  plot.classList.add('large');
  plot.parentElement.classList.remove('bare');
  if (!plot.data) plot.replaceChildren();
  const space = state.space && source.height;
  Plotly.react(plot, sceneTraces(state.scan, space, state.chosen), sceneLayout(scan.source, space, space ? null : state.zoom), space ? SPACE_CONFIG : CONFIG);
  if (!plot.dataset.listens) {
    plot.dataset.listens = 'yes';
    plot.on('plotly_click', (event) => {
      const target = event.points[0].customdata;
      // a 3-D scene fires "clicked" while it draws, and again in every drawing until the button is up
      if (typeof target === 'number') window.setTimeout(() => { if (target !== state.chosen) chooseTarget(target); });
    });
  }
};

// For each sensor a heading, and under it the residuals of its measurement.
const residualTable = (rows, caption) => {
  const body = [];
  for (const [name, component, shown, sigmas] of rows) {
    if (name !== '') body.push(element('tr', [element('th', shown === '' ? `${name}: ${component}` : name, { colspan: '3', scope: 'rowgroup' })]));
    if (shown !== '') body.push(element('tr', [element('td', component), ...[shown, sigmas].map((cell) => element('td', cell, { class: 'number' }))]));
  }
  return element('table', [element('caption', caption), element('tbody', body)]);
};

const drawDetail = () => {
  const scan = data.scans[state.scan];
  const source = data.sources[scan.source];
  const box = byId('detail');
  byId('nearer').disabled = state.chosen === null || !scan.view;
  if (state.chosen === null) {
    box.replaceChildren(element('p', scan.targets ? 'Choose a target, in the picture or in the table, to see its tuple, cost and residuals.' : 'No target was found in this scan.', { class: 'note' }));
    return;
  }
  const target = state.chosen;
  const lines = [element('h3', `Target ${target + 1}, tuple ${tupleText(scan, target)}`), element('p', `cost ${short(scan.costs[target], 6)}`)];
  if (scan.view) {
    const place = scan.view.positions[target];
    const sigma = scan.view.sigmas[target];
    lines.push(simpleTable(['', 'position', '\u03c3'], ['x', 'y', 'z'].map((axis, i) => [axis, metres(place[i]), `${short(sigma[i], 3)} m`])));
    const caption = scan.view.residuals ? 'Residuals, measured less expected' : 'Measurements of different times: no residuals';
    lines.push(residualTable(residualRows(source, scan, target), caption));
  } else {
    lines.push(simpleTable(['sensor', 'measurement'], scan.tuples[target].map((index, s) => [source.sensors[s].name, index || 'missed'])));
  }
  box.replaceChildren(...lines);
};

const drawTargets = () => {
  const scan = data.scans[state.scan];
  const box = byId('targets');
  const sure = scan.probabilities;
  const order = scan.tuples.map((_, t) => t);
  // those most in doubt first
  if (sure) order.sort((a, b) => sure[a][1] - sure[b][1]);
  const percent = (value) => `${short(100 * value, 3)} %`;
  const cells = (t) => [t + 1, tupleText(scan, t), short(scan.costs[t], 5), ...(sure ? [percent(sure[t][1]), `${percent(sure[t][0])} to ${percent(sure[t][2])}`] : [])];
  const table = simpleTable(['target', 'tuple', 'cost', ...(sure ? ['probability', 'proved'] : [])], order.map(cells));
  [...table.tBodies[0].rows].forEach((row, place) => {
    const t = order[place];
    row.dataset.row = String(t);
    row.tabIndex = 0;
    if (t === state.chosen) row.setAttribute('aria-current', 'true');
    row.addEventListener('click', () => chooseTarget(t));
    row.addEventListener('keydown', (event) => { if (event.key === 'Enter') chooseTarget(t); });
  });
  box.replaceChildren(table);
};

const drawTrace = () => {
  const scan = data.scans[state.scan];
  const axis = Number(byId('trace-axis').value);
  const x = scan.trace.map((one) => (axis ? 1e3 * one[1] : one[0]));
  const curve = (name, column, more) => ({
    type: 'scatter', mode: 'lines+markers', name, x, y: scan.trace.map((one) => one[column]), ...more,
  });
  const layout = layoutOf(axis ? 'time (ms)' : 'iteration', 'cost (nats)', { hovermode: 'closest' });
  if (!axis && x[x.length - 1] - x[0] < 5) layout.xaxis.dtick = 1;
  layout.yaxis.range = rangeFor([...scan.trace.map((one) => one[2]), ...scan.trace.map((one) => one[3])]);
  Plotly.react('trace-plot', [
    curve('cost of the best known', 2, { line: { shape: 'hv', color: COLOURS[0] }, marker: { symbol: 'circle', size: 9 } }),
    curve('lower bound', 3, { line: { shape: 'hv', color: COLOURS[5], dash: 'dash' }, marker: { symbol: 'x-thin', size: 11, line: { width: 2, color: COLOURS[5] } } }),
  ], layout, CONFIG);
};

const MEASURES = [
  ['cost', 'cost and lower bound', 'cost (nats)'],
  ['gap', 'gap', 'gap (cost units)'],
  ['ms', 'time in the solver', 'time (ms)'],
  ['targets', 'targets found', 'targets'],
  ['falseAlarms', 'false alarms declared', 'measurements'],
  ['correct', 'share of true tuples correct', 'correct (%)'],
];

const valuesOf = (name) => data.scans.map((scan) => {
  if (name !== 'correct') return scan[name];
  return scan.trueTuples ? (100 * scan.correct) / scan.trueTuples : null;
});

const drawScans = () => {
  const [name, title, label] = MEASURES.find((one) => one[0] === byId('measure').value);
  const x = data.scans.map((_, i) => i);
  const many = data.scans.length > 60;
  // markers of thousands of scans overlap, and drawing them takes a second
  const signs = data.scans.length <= 300;
  const traces = [{
    type: 'scatter', mode: signs ? 'lines+markers' : 'lines', name: title, x, y: valuesOf(name), line: { color: COLOURS[0], width: 1.2 }, marker: { size: many ? 4 : 7 },
    hovertext: x.map((i) => plain(scanLabel(i))), hovertemplate: '%{hovertext}<br>%{y}<extra></extra>',
  }];
  if (name === 'cost') {
    traces[0].name = 'cost';
    traces.push({ type: 'scatter', mode: signs ? 'markers' : 'lines', name: 'lower bound', x, y: valuesOf('bound'), line: { color: COLOURS[5], width: 1.2, dash: 'dash' }, marker: { symbol: 'x-thin', size: 8, line: { width: 1.5, color: COLOURS[5] } }, hoverinfo: 'skip' });
  }
  const here = { type: 'line', x0: state.scan, x1: state.scan, yref: 'paper', y0: 0, y1: 1, line: { color: THEME.soft, width: 1.5, dash: 'dot' } };
  const layout = layoutOf(data.sources.length > 1 ? 'row' : 'scan', label, { hovermode: 'closest', shapes: [here], showlegend: name === 'cost' });
  if (data.sources.length === 1) {
    // scans keep their numbers when only some of them were solved
    const step = Math.max(1, Math.ceil(data.scans.length / 10));
    layout.xaxis.tickvals = x.filter((i) => i % step === 0);
    layout.xaxis.ticktext = layout.xaxis.tickvals.map((i) => String(data.scans[i].scan));
  }
  Plotly.react('scans-plot', traces, layout, CONFIG);
  const plot = byId('scans-plot');
  if (!plot.dataset.listens) {
    plot.dataset.listens = 'yes';
    plot.on('plotly_click', (event) => choose(event.points[0].x));
  }
};

const chooseTarget = (target) => {
  state.chosen = target;
  if (state.zoom !== null) state.zoom = boxAround(data.scans[state.scan], target);
  drawScene();
  drawDetail();
  drawTargets();
};

let pending = 0;

const showScan = (index) => {
  const moved = index !== state.scan;
  state.scan = index;
  if (moved) { state.chosen = null; state.zoom = null; }
  drawScene();
  drawDetail();
  drawTargets();
  markRow(scanTable, index);
  // the scene follows the slider at once, the histories when idle
  window.clearTimeout(pending);
  pending = window.setTimeout(() => { drawTrace(); drawScans(); showAnts(index); }, 30);
};

const setSpace = (space) => {
  state.space = space;
  byId('plan').setAttribute('aria-pressed', String(!space));
  byId('space').setAttribute('aria-pressed', String(space));
  Plotly.purge('scene-plot');
  delete byId('scene-plot').dataset.listens;
  drawScene();
};

let choose = () => {};

try {
  if (data.scans.length) {
    for (const [name, title] of MEASURES) {
      if (valuesOf(name).some((value) => value !== null)) byId('measure').append(element('option', title, { value: name }));
    }
    choose = makeSlider(data.scans.length, scanLabel, showScan);
    makeToggle(byId('legend'), !PHONE, drawScene);
    byId('plan').addEventListener('click', () => setSpace(false));
    byId('space').addEventListener('click', () => setSpace(true));
    byId('nearer').addEventListener('click', () => {
      state.zoom = boxAround(data.scans[state.scan], state.chosen);
      if (state.space) setSpace(false); else drawScene();
    });
    byId('whole').addEventListener('click', () => {
      state.zoom = null;
      if (byId('scene-plot').data) { Plotly.purge('scene-plot'); delete byId('scene-plot').dataset.listens; }
      drawScene();
    });
    byId('trace-axis').addEventListener('change', drawTrace);
    byId('measure').addEventListener('change', drawScans);
    byId('to-row').addEventListener('click', (event) => {
      event.preventDefault();
      byId('scans').scrollIntoView({ behavior: 'smooth' });
      markRow(scanTable, state.scan);
    });
    onRow(scanTable, (number) => {
      choose(number);
      byId('scene').scrollIntoView({ behavior: 'smooth' });
    });
    const named = /^#scan-(\d+)$/.exec(window.location.hash);
    choose(named ? Number(named[1]) : 0);
  }
  document.documentElement.dataset.ready = 'yes';
} catch (error) {
  fail(error);
}
