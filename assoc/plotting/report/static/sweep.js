// The report of a study: a table that sorts, maps over the parameters, curves of the settings.
const MOST_COLOURED = 7;
const settingTable = byId('setting-table');
let chosenSetting = null;

const withInterval = (middle, low, high) => (middle === null ? '' : `${short(middle, 3)}<br>[${short(low, 3)} .. ${short(high, 3)}]`);

const drawMap = (map, measure) => {
  const [middle, low, high] = map.measures[measure];
  const annotations = [];
  const small = map.xs.length > 8;
  let least = Infinity;
  let most = -Infinity;
  middle.flat().forEach((value) => { if (value !== null) { least = Math.min(least, value); most = Math.max(most, value); } });
  const constant = most - least <= 1e-9 * Math.max(Math.abs(least), Math.abs(most));
  middle.forEach((row, y) => row.forEach((value, x) => {
    if (value === null || small) return;
    const light = !constant && value > (least + most) / 2;
    annotations.push({ x, y, text: window.innerWidth < 820 ? short(value, 3) : withInterval(value, low[y][x], high[y][x]), showarrow: false, font: { size: 11, color: light ? '#000' : '#fff' } });
  }));
  if (constant) {
    annotations.push({ xref: 'paper', yref: 'paper', x: 0, y: 1, yanchor: 'bottom', xanchor: 'left', showarrow: false, text: `${plain(data.measures[measure])}: ${short(most, 4)} everywhere` });
  }
  const layout = layoutOf(plain(map.across), plain(map.up), { annotations });
  Object.assign(layout.xaxis, { tickvals: map.xs.map((_, i) => i), ticktext: map.xs.map(plain), showgrid: false });
  Object.assign(layout.yaxis, { tickvals: map.ys.map((_, i) => i), ticktext: map.ys.map(plain), showgrid: false });
  Plotly.react('map-plot', [{
    type: 'heatmap', z: middle, colorscale: 'Cividis', colorbar: { title: { text: plain(data.measures[measure]), side: 'right' }, thickness: 14 },
    // equal values need no scale: the value is stated above
    ...(constant ? { zmin: least - 1, zmax: least + 1, showscale: false } : {}),
    text: middle.map((row, y) => row.map((value, x) => `${plain(map.across)} ${plain(map.xs[x])}, ${plain(map.up)} ${plain(map.ys[y])}<br>${withInterval(value, low[y][x], high[y][x])}`)),
    hovertemplate: '%{text}<extra></extra>',
  }], layout, CONFIG);
};

const drawOver = (name, measure) => {
  const shown = data.settings.map((one, i) => [one, i]).filter(([one]) => one.values[name] !== undefined && one.values[name] !== null && one.means[measure][0] !== null);
  const means = shown.map(([one]) => one.means[measure]);
  Plotly.react('map-plot', [{
    type: 'scatter', mode: 'markers', x: shown.map(([one]) => (typeof one.values[name] === 'number' ? one.values[name] : plain(one.values[name]))),
    y: means.map((one) => one[0]), marker: { size: 8, color: COLOURS[0] },
    error_y: { type: 'data', symmetric: false, array: means.map((one) => one[2] - one[0]), arrayminus: means.map((one) => one[0] - one[1]), thickness: 1.2, color: COLOURS[0] },
    text: shown.map(([one]) => plain(one.title)), hovertemplate: '%{text}<br>%{y}<extra></extra>',
  }], layoutOf(plain(name), plain(data.measures[measure]), { hovermode: 'closest' }), CONFIG);
};

const drawParameters = () => {
  const measure = byId('measure').value;
  const [kind, which] = byId('parameters').value.split(' ');
  if (kind === 'map') drawMap(data.maps[Number(which)], measure);
  else drawOver(Object.keys(data.settings[0].values)[Number(which)], measure);
};

const drawCurves = () => {
  const column = byId('trace-axis').value;
  const traces = [];
  data.curves.forEach((curve, i) => {
    if (!curve[column]) return;
    const chosen = i === chosenSetting;
    const coloured = i < MOST_COLOURED - 1;
    traces.push({
      type: 'scatter', mode: 'lines', name: plain(data.settings[i].title), x: curve[column][0], y: curve[column][1], showlegend: coloured || chosen,
      line: { shape: 'hv', width: chosen ? 3 : coloured ? 2 : 1, color: chosen ? THEME.ink : coloured ? colourOf(i) : THEME.faint, dash: coloured && !chosen ? dashOf(i) : 'solid' },
      hovertemplate: `${plain(data.settings[i].title)}<br>%{y:.4g}<extra></extra>`, legendrank: i,
    });
  });
  // the best and the chosen setting are drawn last, on top
  traces.sort((a, b) => a.line.width - b.line.width);
  const layout = layoutOf(column === 'seconds' ? 'time (ms)' : 'iteration (number)', window.innerWidth < 820 ? 'excess cost (nats)' : 'mean cost above the best known (nats)', { hovermode: 'closest' });
  layout.xaxis.type = 'log';
  layout.yaxis.rangemode = 'tozero';
  const high = Math.max(...traces.map((one) => Math.max(...one.y)), 0);
  if (high === 0) layout.yaxis.range = [-0.1, 1];
  layout.legend = { orientation: 'h', x: 0, xanchor: 'left', y: window.innerWidth < 820 ? -0.32 : -0.18, yanchor: 'top', font: { size: 12 } };
  Plotly.react('curves-plot', traces, layout, CONFIG);
  byId('chosen-setting').textContent = chosenSetting === null ? '' : `chosen: ${data.settings[chosenSetting].title}`;
};

try {
  if (data.settings.length) {
    for (const [name, label] of Object.entries(data.measures)) byId('measure').append(element('option', label, { value: name }));
    data.maps.forEach((map, i) => byId('parameters').append(element('option', map.title, { value: `map ${i}` })));
    Object.keys(data.settings[0].values).forEach((name, i) => byId('parameters').append(element('option', `${name} alone`, { value: `one ${i}` })));
    // begin with the parameters that vary
    const differs = Object.keys(data.measures).find((name) => new Set(data.settings.map((one) => one.means[name][0])).size > 1);
    if (differs) byId('measure').value = differs;
    byId('measure').addEventListener('change', drawParameters);
    byId('parameters').addEventListener('change', drawParameters);
    byId('trace-axis').addEventListener('change', drawCurves);
    onRow(settingTable, (row) => {
      chosenSetting = row;
      markRow(settingTable, row);
      drawCurves();
    });
    if (byId('parameters').options.length) drawParameters();
    else byId('maps').hidden = true;
    drawCurves();
  }
  document.documentElement.dataset.ready = 'yes';
} catch (error) {
  fail(error);
}
