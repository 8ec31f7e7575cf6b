// The ants of a scan: bars for tuples, and a slider over the cycles.
const ANTS = [
  ['pheromone', 'pheromone', 'pheromone \u03c4', 'linear'],
  ['probability', 'probability to be drawn', 'probability p (%)', 'linear'],
  ['visibility', 'visibility', 'visibility \u03b7', 'log'],
];
const ants = { shown: null, cycle: 0, move: null };

const drawAnts = () => {
  const plot = byId('ants-plot');
  const shown = ants.shown;
  if (!shown || !shown.cycles.length) {
    Plotly.purge(plot);
    plot.style.height = 'auto';
    plot.replaceChildren(element('p', 'No ant walked in this scan: the bound proved the first cover to be optimal.', { class: 'note' }));
    return;
  }
  if (!plot.data) plot.replaceChildren();
  const [name, , label, scale] = ANTS.find((one) => one[0] === byId('ants-measure').value);
  const values = shown[name][ants.cycle];
  const all = shown[name].flat().filter((value) => value !== null && value > 0);
  const bars = (chosen) => ({
    type: 'bar',
    orientation: 'h',
    name: chosen ? 'chosen' : 'not chosen',
    y: shown.tuples.filter((_, i) => shown.chosen[i] === chosen),
    x: values.filter((_, i) => shown.chosen[i] === chosen),
    marker: { color: chosen ? COLOURS[0] : '#8c959f', pattern: { shape: chosen ? '' : '/' } },
    hovertemplate: '%{y}: %{x:.3g}<extra></extra>',
  });
  const layout = layoutOf(label, '', { hovermode: 'closest', bargap: 0.25, height: 120 + 20 * shown.tuples.length });
  layout.yaxis = { ...layout.yaxis, autorange: 'reversed', categoryorder: 'array', categoryarray: shown.tuples, tickfont: { size: 11 }, dtick: 1 };
  const high = Math.max(...all, 1e-300);
  // the same scale for all cycles, so that growth can be seen
  layout.xaxis.type = scale;
  layout.xaxis.range = scale === 'log' ? [Math.max(Math.log10(Math.min(...all)), Math.log10(high) - 12) - 0.2, Math.log10(high) + 0.1] : [0, 1.05 * high];
  if (scale === 'log') { layout.xaxis.exponentformat = 'power'; layout.xaxis.nticks = 6; }
  // the card grows with the bars
  plot.style.height = `${layout.height}px`;
  Plotly.react(plot, [bars(true), bars(false)], layout, CONFIG);
};

const showAnts = (index) => {
  if (!byId('ants-plot')) return;
  ants.shown = data.scans[index].ants;
  const count = ants.shown ? ants.shown.cycles.length : 0;
  if (!ants.move) {
    for (const [name, title] of ANTS) byId('ants-measure').append(element('option', title, { value: name }));
    byId('ants-measure').addEventListener('change', drawAnts);
    const label = (i) => (ants.shown && ants.shown.cycles.length ? `cycle ${ants.shown.cycles[i]} of ${ants.shown.cycles[ants.shown.cycles.length - 1]}` : 'no cycle');
    ants.move = makeSlider(Math.max(count, 1), label, (i) => { ants.cycle = i; drawAnts(); }, 'cycle-');
  }
  ants.move(Math.max(count, 1) - 1, Math.max(count, 1));
};
