// The report of a registration: boxes of residuals before and after.
const drawResiduals = ({ component, unit, sensors }) => {
  const traces = [['before', 1], ['after', 0]].map(([name, colour]) => ({
    type: 'box', name, x: sensors.flatMap((one) => one[name].map(() => plain(one.name))), y: sensors.flatMap((one) => one[name]),
    boxpoints: false, marker: { color: colourOf(colour) }, line: { width: 1.4 },
  }));
  const edge = (one, i, sign) => ({ type: 'line', xref: 'x', yref: 'y', x0: i - 0.45, x1: i + 0.45, y0: sign * one.limit, y1: sign * one.limit, line: { dash: 'dot', width: 1.4, color: THEME.ink } });
  const shapes = sensors.flatMap((one, i) => [edge(one, i, -1), edge(one, i, 1)]);
  Plotly.react(`residuals-${component}`, traces, layoutOf('', `${component} (${unit})`, { boxmode: 'group', shapes }), CONFIG);
};
try {
  data.residuals.forEach(drawResiduals);
  document.documentElement.dataset.ready = 'yes';
} catch (error) {
  fail(error);
}
