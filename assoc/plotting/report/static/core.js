// Shared by all reports: numbers as text, sortable tables, the slider, the style of plots.
const data = JSON.parse(document.getElementById('data').textContent);
const byId = (id) => document.getElementById(id);

// Colours of the light or dark page, as the reader prefers; a change takes effect after a reload.
const DARK = window.matchMedia('(prefers-color-scheme: dark)').matches;
const LIGHT = { ink: '#000', soft: '#57606a', line: '#8c959f', grid: '#e5e8eb', faint: '#d3d7db', paper: '#fff' };
const THEME = DARK ? { ink: '#e6edf3', soft: '#a3adb8', line: '#8b949e', grid: '#30363d', faint: '#3d444d', paper: '#161b22' } : LIGHT;
const PHONE = window.innerWidth < 820;

const COLOURS = [DARK ? '#3d9be0' : '#0072B2', '#E69F00', '#009E73', '#CC79A7', '#56B4E9', '#D55E00', THEME.ink];
const DASHES = ['solid', 'dash', 'dashdot', 'dot', 'longdash', 'longdashdot', '5px,1px'];
const colourOf = (number) => COLOURS[number % COLOURS.length];
const dashOf = (number) => DASHES[number % DASHES.length];

// plotly parses tags and entities in texts: names from files must be escaped
const plain = (text) => String(text).replace(/&/g, '&amp;').replace(/</g, '&lt;').replace(/>/g, '&gt;');

const short = (value, digits = 4) => {
  if (value === null || value === undefined) return 'unknown';
  if (value === 0) return '0';
  const size = Math.abs(value);
  const text = size >= 1e6 || size < 1e-4 ? value.toExponential(digits - 1) : value.toFixed(
    Math.max(0, digits - 1 - Math.floor(Math.log10(size))));
  return text.replace('-', '\u2212');
};

// A time to the millisecond; from 1e9 s on a Unix time, as UTC.
const UNIX = 1e9;
const moment = (time) => (time > UNIX ? new Date(Math.round(1e3 * time)).toISOString().replace('T', ' ').replace(/\.?0*Z$/, 'Z') : `${Number(time.toFixed(3))} s`);
// Times as plotly's axes take them.
const onAxis = (times) => (times.length && times[0] > UNIX ? times.map((time) => new Date(1e3 * time).toISOString().slice(0, -1)) : times);

const element = (tag, content, attributes = {}) => {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  if (Array.isArray(content)) made.append(...content);
  else if (content !== undefined && content !== null) made.textContent = String(content);
  return made;
};

// A table of texts; cells that start like a number, and their headings, are right-aligned.
const numberClass = (cell) => (/^[\u2212-]?[0-9]/.test(String(cell)) ? { class: 'number' } : {});
const simpleTable = (headers, rows) => {
  const first = rows[0] || headers;
  const body = rows.map((row) => element('tr', row.map((cell) => element('td', cell, numberClass(cell)))));
  return element('table', [
    element('thead', [element('tr', headers.map((header, i) => element('th', header, { scope: 'col', ...numberClass(first[i]) })))]),
    element('tbody', body),
  ]);
};

const keyOf = (cell) => {
  const key = cell.dataset.key;
  const value = Number(key);
  return key === '' || key === 'None' ? null : Number.isNaN(value) ? key : value;
};

const compare = (a, b) => {
  if (a === null || b === null) return a === b ? 0 : a === null ? 1 : -1;
  if (typeof a === 'number' && typeof b === 'number') return a - b;
  return String(a).localeCompare(String(b));
};

const makeSortable = (table) => {
  const heads = [...table.tHead.rows[0].cells];
  const body = table.tBodies[0];
  heads.forEach((head, column) => {
    if (body.rows.length && body.rows[0].cells[column].classList.contains('number')) head.classList.add('number');
    head.querySelector('button').addEventListener('click', () => {
      const down = head.getAttribute('aria-sort') === 'ascending';
      heads.forEach((one) => one.removeAttribute('aria-sort'));
      head.setAttribute('aria-sort', down ? 'descending' : 'ascending');
      const keyed = [...body.rows].map((row) => [keyOf(row.cells[column]), row]);
      // unknown values stay last in both directions
      keyed.sort(([a], [b]) => (a === null || b === null ? compare(a, b) : (down ? -1 : 1) * compare(a, b)));
      body.append(...keyed.map(([, row]) => row));
    });
  });
};

// Mark a row and scroll to it inside its box, without scrolling the page.
const markRow = (table, number) => {
  if (!table) return;
  for (const row of table.tBodies[0].rows) {
    if (Number(row.dataset.row) !== number) { row.removeAttribute('aria-current'); continue; }
    row.setAttribute('aria-current', 'true');
    const box = table.closest('.scroll');
    const top = row.offsetTop - table.tHead.offsetHeight;
    if (top < box.scrollTop) box.scrollTop = top;
    else if (row.offsetTop + row.offsetHeight > box.scrollTop + box.clientHeight) {
      box.scrollTop = row.offsetTop + row.offsetHeight - box.clientHeight;
    }
  }
};

const onRow = (table, choose) => table.tBodies[0].addEventListener('click', (event) => {
  const row = event.target.closest('tr');
  if (!row) return;
  event.preventDefault();
  choose(Number(row.dataset.row));
});

// A toggle button; calls `draw` when it changes.
const makeToggle = (button, pressed, draw) => {
  button.setAttribute('aria-pressed', String(pressed));
  button.addEventListener('click', () => {
    button.setAttribute('aria-pressed', String(button.getAttribute('aria-pressed') !== 'true'));
    draw();
  });
};

// A slider with its buttons; choose(i) moves it from elsewhere, and may change its number of positions.
const makeSlider = (places, label, show, prefix = '') => {
  let count = places;
  const range = byId(`${prefix}slider`);
  const text = byId(`${prefix}slider-label`);
  const play = byId(`${prefix}play`);
  let timer = null;
  const choose = (wanted) => {
    const number = Math.min(Math.max(wanted, 0), count - 1);
    range.value = String(number);
    text.textContent = label(number);
    range.setAttribute('aria-valuetext', label(number));
    show(number);
  };
  const stop = () => {
    if (timer !== null) window.clearInterval(timer);
    timer = null;
    play.textContent = 'Play';
    play.setAttribute('aria-pressed', 'false');
  };
  range.max = String(count - 1);
  range.addEventListener('input', () => { stop(); choose(Number(range.value)); });
  byId(`${prefix}before`).addEventListener('click', () => { stop(); choose(Number(range.value) - 1); });
  byId(`${prefix}after`).addEventListener('click', () => { stop(); choose(Number(range.value) + 1); });
  play.addEventListener('click', () => {
    if (timer !== null) { stop(); return; }
    play.textContent = 'Pause';
    play.setAttribute('aria-pressed', 'true');
    timer = window.setInterval(() => choose((Number(range.value) + 1) % count), 400);
  });
  return (number, now = count) => {
    stop();
    count = now;
    range.max = String(count - 1);
    choose(number);
  };
};

const FONT = { family: 'system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif', size: 13, color: THEME.ink };
const AXIS = { zeroline: false, gridcolor: THEME.grid, linecolor: THEME.line, ticks: 'outside', automargin: true, tickcolor: THEME.line };
// The data stay here: charts have only the buttons named below, no server, and cannot open windows.
window.open = () => null;
const configOf = (...buttons) => ({ responsive: true, displaylogo: false, plotlyServerURL: '', displayModeBar: window.innerWidth < 820 ? false : 'hover', modeBarButtons: [['toImage'], buttons] });
const CONFIG = configOf('zoom2d', 'pan2d', 'zoomIn2d', 'zoomOut2d', 'resetScale2d');
const SPACE_CONFIG = configOf('zoom3d', 'pan3d', 'orbitRotation', 'tableRotation', 'resetCameraDefault3d');
const layoutOf = (x, y, more = {}) => ({
  font: FONT,
  paper_bgcolor: THEME.paper,
  plot_bgcolor: THEME.paper,
  margin: { l: 62, r: 14, t: 34, b: 48 },
  xaxis: { ...AXIS, title: { text: x } },
  yaxis: { ...AXIS, title: { text: y } },
  legend: { orientation: 'h', x: 0, xanchor: 'left', y: 1.02, yanchor: 'bottom', font: { size: 12 } },
  hoverlabel: { align: 'left', font: { size: 12 } },
  ...more,
});

// Axes whose values are equal, up to rounding, need some extent.
const rangeFor = (values) => {
  const known = values.filter((value) => value !== null);
  const low = Math.min(...known);
  const high = Math.max(...known);
  if (!known.length || high - low > 1e-6 * Math.max(1, Math.abs(low), Math.abs(high))) return undefined;
  return [low - 1, high + 1];
};

const fail = (error) => {
  const box = byId('failure');
  box.hidden = false;
  box.textContent = `This report could not be drawn: ${error.message}. Its tables are below.`;
  console.error(error);
};

// Charts have the width of the window: on paper that of the page, in ink.
const PAPER = 690;
const toPlots = (change) => document.querySelectorAll('.js-plotly-plot').forEach((plot) => Plotly.relayout(plot, change(plot)));
const coloured = ({ paper, ink, grid }) => ({ paper_bgcolor: paper, plot_bgcolor: paper, 'font.color': ink, 'xaxis.gridcolor': grid, 'yaxis.gridcolor': grid });
window.addEventListener('beforeprint', () => toPlots(() => ({ autosize: false, width: PAPER, ...coloured(LIGHT) })));
window.addEventListener('afterprint', () => toPlots(() => ({ autosize: true, width: null, ...coloured(THEME) })));

document.querySelectorAll('table.sortable').forEach(makeSortable);
