'use strict';
// The page of `seal_friction monitor`. Values reach it as JSON only and are written as text only, never as HTML.

const token = new URLSearchParams(location.search).get('token') || '';
const byId = (id) => document.getElementById(id);
const address = (path, values = {}) => `${path}?${new URLSearchParams({...values, token})}`;

const GREY = '#7f7f7f', BLUE = '#0072b2', SKY = '#56b4e9', ORANGE = '#e69f00', VERMILLION = '#d55e00', GREEN = '#009e73',
  PURPLE = '#cc79a7', RED = '#b3261e';
const LOST_AFTER = 1500;  // [ms] without a frame
const UNCONFIRMED_AFTER = 2500;  // [ms] after a click on OFF without an answer of the monitor
const ARMED_FOR = 5000;  // [ms] the second click that lifts OFF
const JOINED = 0.2;  // [s] data further apart are not joined by a line
const TOO_OLD = 0.5;  // [s]
const WORDS_PERIOD = 250;  // [ms] numbers that change faster cannot be read
const KEPT = 30;  // [s] of rows in the page while it follows; while it holds, up to MOST_ROWS
const MOST_ROWS = 12000;
const READ_PERIOD = 1000;  // [ms] between two questions how far a bag has been read
const CAUSES = {node: 'NODE GONE', inputs: 'NO INPUTS', estimate: 'NO ESTIMATE'};
const EARLIER = 'this page is of an earlier monitor: open the new address, which the command printed';
const UNANSWERED = 'NOT CONFIRMED: the monitor does not answer; stop the machine another way';
const KINDS = ['no', 'waiting', 'gone', 'yes'];  // of the lines of OFF, failures first
const LEVELS = ['good', 'look', 'bad', 'bad'];
const LEVEL_WORDS = ['OK', 'WARN', 'ERROR', 'STALE'];
const LAMPS = ['CLAMP', 'SLEW', 'FADE'];
const SETTINGS = {scale: 1, lead_time: 1e3, force_limit: 1};  // name -> its SI unit in the unit of the page
// A curve: column, name, colour, and how it is drawn. A band lies between its two columns.
const PLOTS = [
  {id: 'friction', title: 'Friction', unit: 'N', band: ['high', 'low', SKY, '95 % of readings'],
    curves: [['measured', 'measured', GREY], ['estimate', 'estimated', BLUE]], empty: 'no estimate'},
  {id: 'feedforward', title: 'Feed-forward', unit: 'N',
    curves: [['feedforward', 'force', VERMILLION], ['limit', 'limit', GREY, 'dashed'], ['below', '', GREY, 'dashed']],
    empty: 'no feed-forward: it needs a reference'},
  {id: 'error', title: 'Tracking error', note: 'reference less position', unit: 'µm',
    curves: [['error', 'error', PURPLE]], empty: 'no reference or no position'},
  {id: 'pressure', title: 'Chamber pressures', unit: 'bar', shade: true,
    curves: [['pressure_a', 'a', BLUE], ['pressure_b', 'b', VERMILLION]], empty: 'no pressure'},
  {id: 'scale', title: 'Adaptation: friction over that of the seal files', unit: '', band: ['scale_high', 'scale_low', GREEN, '95 %'],
    curves: [['scale', 'scale', GREEN]], adaptation: true, empty: 'nothing learnt'},
  {id: 'residual', title: 'Residual: what the estimate leaves', unit: 'N',
    curves: [['residual', 'residual', GREY]], adaptation: true, empty: 'no residual'},
];

let about = null;  // of the server: mode, columns, whether changes are allowed
let label = '';  // actuator that is shown
let columns = {};  // name -> array, one entry a row
let now = null;  // situation of the actuator
let end = 0;  // [s] right end of the time axis
let span = 5;  // [s]
let zoomed = null;  // [s, s] or null: follow
let held = false;  // whether the time axis stands still
let lastWords = 0;  // [ms] when the numbers were written
let lastFrame = 0;  // [ms] when a frame came
let drawing = false;
let charts = [];
let stream = null;
let watch = null;  // timer that looks for frames
let off = null;  // state of OFF in the monitor; null: not latched
let pressed = null;  // a click on OFF that is not in a frame yet: time [ms], presses before it, what was answered

// -- small helpers ------------------------------------------------------------------------------------------------

function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

function element(tag, text = '', className = '') {
  const made = document.createElement(tag);
  if (text) made.textContent = text;
  if (className) made.className = className;
  return made;
}

function replaceIfChanged(node, key, make) {
  const told = JSON.stringify(key);
  if (node.dataset.told === told) return;
  node.dataset.told = told;
  node.replaceChildren(...make());
}

function number(value, unit = '', digits = 3) {
  if (value === null || value === undefined) return 'none';
  let text = Math.abs(value) >= 1000 ? value.toFixed(0) : value.toPrecision(digits);
  if (text.includes('e')) text = value === 0 ? '0' : value.toFixed(Math.min(digits + 2, 6));
  if (Number(text) === 0) text = '0';
  return unit ? `${text} ${unit}` : text;
}

const line = (...cells) => {
  const made = element('tr');
  made.append(...cells.map((cell) => element('td', cell)));
  return made;
};

// Newest number of a curve at a row or shortly before.
function valueAt(list, index) {
  const times = columns.time || [];
  for (let place = index; place >= 0 && times[index] - times[place] <= joined(); place -= 1) {
    if (list[place] !== null && list[place] !== undefined) return list[place];
  }
  return null;
}

// -- plots --------------------------------------------------------------------------------------------------------

function range() {
  if (zoomed) return zoomed;
  return about.mode === 'bag' && end < span ? [0, span] : [end - span, end];
}

const joined = () => Math.max(JOINED, 2.5 * about.period);

// Pairs of neighbouring numbers of a curve that no line joins, -1 before the first and after the last one. A band ends where
// the rod rests: there are estimates and no band.
function breaksOf(isBand, times, values, first, last) {
  const found = [], longest = joined();
  let before = -1, rests = false;
  for (let place = first; place <= last; place += 1) {
    if (values[place] === null || values[place] === undefined) {
      rests = rests || (isBand && columns.estimate[place] !== null);
      continue;
    }
    if (before < 0 || rests || times[place] - times[before] > longest) found.push([before, place]);
    before = place;
    rests = false;
  }
  return [...found, [before, -1]];
}

const curve = (column, isBand = false) => ({
  label: column, spanGaps: false,
  gaps: (chart, index, first, last) => {
    const at = (place) => chart.valToPos(chart.data[0][place], 'x', true);
    const breaks = breaksOf(isBand, chart.data[0], chart.data[index], first, last);
    return breaks.slice(1, -1).map(([before, place]) => [at(before), at(place)]);
  },
  points: {show: false, size: 3, filter: (chart, index) => {  // a number that no line reaches
    const breaks = breaksOf(isBand, chart.data[0], chart.data[index], ...chart.series[0].idxs);
    const alone = breaks.slice(1).filter(([before], place) => before >= 0 && before === breaks[place][1]);
    return alone.length ? alone.map(([before]) => before) : null;
  }},
});

function series(plot) {
  const [high, low, shade] = plot.band || [];
  const bands = plot.band ? [high, low].map((column) => ({...curve(column, true), stroke: 'transparent', width: 0})) : [];
  const curves = plot.curves.map(([column, , colour, style]) => (
    {...curve(column), stroke: colour, width: column === 'estimate' ? 2 : 1.5, ...(style === 'dashed' ? {dash: [6, 4], auto: false} : {})}));
  return {list: [{label: 'time'}, ...bands, ...curves], bands: plot.band ? [{series: [1, 2], fill: `${shade}55`}] : undefined};
}

function shadeRange(chart) {
  if (!now || now.range[0] === null || now.range[1] === null) return;
  const {ctx, bbox} = chart;
  const [high, low] = [now.range[1], now.range[0]].map((value) => (
    Math.min(Math.max(chart.valToPos(value, 'y', true), bbox.top), bbox.top + bbox.height)));
  ctx.save();
  ctx.fillStyle = '#d0342c1c';
  ctx.fillRect(bbox.left, bbox.top, bbox.width, high - bbox.top);
  ctx.fillRect(bbox.left, low, bbox.width, bbox.top + bbox.height - low);
  ctx.fillStyle = '#009e7314';
  ctx.fillRect(bbox.left, high, bbox.width, low - high);
  ctx.restore();
}

// Range of the values, but for spikes (of a faulty sensor): those leave the plot, so that the rest can be seen.
function paddedRange(chart, low, high) {
  if (low === null || high === null) return [0, 1];
  const [first, last] = range(), times = columns.time, values = [];
  const stride = Math.ceil(times.length / 500);
  for (let place = 0; place < times.length; place += stride) {
    if (times[place] < first || times[place] > last) continue;
    for (let curve = 1; curve < chart.data.length; curve += 1) {
      if (chart.series[curve].dash) continue;  // a limit may be far off
      const value = chart.data[curve][place];
      if (value !== null && value !== undefined) values.push(value);
    }
  }
  values.sort((one, other) => one - other);
  const share = (part) => values[Math.min(Math.floor(part * values.length), values.length - 1)];
  const [few, most] = [share(0.02), share(0.98)];
  const width = Math.max(most - few, Math.abs(most) * 1e-3);
  if (values.length > 20 && high - low > 20 * width) [low, high] = [Math.max(low, few - 0.5 * width), Math.min(high, most + 0.5 * width)];
  const pad = Math.max((high - low) * 0.08, Math.abs(high) * 1e-3, high === low ? 1 : 1e-6);
  return [low - pad, high + pad];
}

function makeCharts() {
  for (const chart of charts) chart.plot.destroy();
  byId('plots').replaceChildren();
  charts = PLOTS.filter((plot) => !plot.adaptation || (now && now.adaptation !== 'off')).map((plot) => {
    const figure = element('figure');
    figure.id = `plot-${plot.id}`;
    const title = element('h2', plot.title);
    const unit = [plot.unit && `[${plot.unit}]`, plot.note].filter(Boolean).join(' ');
    if (unit) title.append(' ', element('small', unit));
    const legend = element('div', '', 'legend');
    const named = (text, colour, style) => {
      const entry = element('span', text, style), value = element('b');
      entry.style.borderColor = colour;
      if (style !== 'area') entry.append(value);
      legend.append(entry);
      return value;
    };
    const values = plot.curves.filter(([, name]) => name).map(([column, name, colour, style]) => ({column, value: named(`${name} `, colour, style)}));
    if (plot.band) named(plot.band[3], `${plot.band[2]}88`, 'area');
    if (plot.shade) named('identified range', '#009e7344', 'area');
    const empty = element('div', plot.empty, 'empty');
    figure.append(title, legend, empty);
    byId('plots').append(figure);
    const {list, bands} = series(plot);
    const font = '12px system-ui, "DejaVu Sans", sans-serif';
    const chart = new uPlot({
      width: Math.max(figure.clientWidth - 26, 200), height: 190, series: list, bands, legend: {show: false},
      scales: {x: {time: false, range: () => range()}, y: {range: paddedRange}},
      axes: [{font, stroke: '#444', grid: {stroke: '#ececec'}, size: 30, values: (_, ticks) => ticks.map((tick) => `${+tick.toFixed(3)} s`), space: 64},
        {font, stroke: '#444', grid: {stroke: '#ececec'}, size: 58, space: 28,
          values: (_, ticks) => ticks.map((tick) => (Math.abs(tick) >= 1e5 ? tick.toExponential(0) : String(+tick.toPrecision(4))))}],
      cursor: {sync: {key: 'time'}, drag: {x: true, y: false, setScale: false}, points: {size: 6}},
      hooks: {
        drawClear: plot.shade ? [shadeRange] : [],
        setSelect: [(chart) => {
          const {left, width} = chart.select;
          if (width > 6) zoom([chart.posToVal(left, 'x'), chart.posToVal(left + width, 'x')]);
        }],
        setCursor: [() => writeLegends()],
      },
    }, dataOf(list), figure);
    chart.over.addEventListener('dblclick', () => zoom(null));
    return {plot: chart, list, values, empty, curves: plot.curves, unit: plot.unit};
  });
}

const dataOf = (list) => list.map(({label: column}) => columns[column] || []);

function zoom(wanted) {
  zoomed = wanted;
  for (const {plot} of charts) plot.setSelect({left: 0, width: 0, top: 0, height: 0}, false);
  drawSoon();
}

function writeLegends() {
  for (const {plot, values} of charts) {
    const index = plot.cursor.idx;
    for (const {column, value} of values) {
      const list = columns[column] || [];
      const given = valueAt(list, index === null || index === undefined ? list.length - 1 : index);
      setText(value, given === null ? '-' : number(given));
    }
  }
}

function drawSoon() {
  if (drawing) return;
  drawing = true;
  requestAnimationFrame(() => {
    drawing = false;
    for (const {plot, list, empty, curves} of charts) {
      plot.setData(dataOf(list));
      const first = columns[curves[0][0]] || [], [begin, last] = range();
      empty.hidden = first.some((value, place) => value !== null && columns.time[place] >= begin && columns.time[place] <= last);
    }
    writeLegends();
  });
}

// -- frames -------------------------------------------------------------------------------------------------------

function clearRows() {
  columns = Object.fromEntries(about.columns.map((name) => [name, []]));
}

function takeFrame(frame) {
  lastFrame = performance.now();
  off = frame.off || null;
  writeOff();
  if (!frame.label) {
    const names = Object.keys(frame.nodes), unread = unreadNodes(frame.nodes);
    if (unread.length) verdict('bad', 'bad', `the configuration cannot be read: ${unread.join('; ')}`);
    else verdict('waiting', 'waiting', names.length
      ? `for the configuration of ${names.join(', ')}`
      : 'for an estimator: start friction_estimator or machine_estimator, check ROS_DOMAIN_ID');
    return;
  }
  const hadAdaptation = now && now.adaptation !== 'off', isOther = frame.label !== label;
  if (isOther) {
    clearRows();
    lastWords = 0;
  }
  label = frame.label;
  now = frame.now;
  if (isOther || !charts.length || hadAdaptation !== (now.adaptation !== 'off')) makeCharts();
  for (const row of frame.rows) about.columns.forEach((name, place) => columns[name].push(row[place]));
  const rows = columns.time.length;
  const oldest = columns.time.findIndex((time) => time > frame.time - KEPT);
  const surplus = zoomed || held || about.mode === 'bag' ? Math.max(rows - MOST_ROWS, 0) : oldest < 0 ? rows : oldest;
  if (surplus > 0) for (const name of about.columns) columns[name].splice(0, surplus);
  if (!held) end = frame.time;
  writeWords(frame);
  drawSoon();
}

const unreadNodes = (nodes) => Object.entries(nodes || {}).filter(([, why]) => why).map(([name, why]) => `${name}: ${why}`);

function verdict(kind, word, reason) {
  byId('verdict').className = kind;
  setText(byId('verdict-word'), word);
  setText(byId('reason'), reason);
}

function writeWords(frame) {
  verdict(now.verdict, now.verdict, now.reason);
  writeLamps();
  writeTabs(frame.actuators);
  if (frame.diagnostics) writeDiagnostics(frame.diagnostics);
  writeSliders();
  writeAges();
  const moment = performance.now();
  if (about.mode === 'live' && moment - lastWords < WORDS_PERIOD) return;
  lastWords = moment;
  setText(byId('state'), now.state);
  const band = ` ± ${number(now.band, 'N', 2)}`, slides = /^sliding/.test(now.state); // at rest that of what acts
  setText(byId('friction'), slides ? number(now.coulomb) + band : number(now.coulomb, 'N'));
  const acts = slides ? number(now.friction, 'N') : number(now.friction) + band;
  setText(byId('friction-more'), `acts now ${acts}, measured ${number(now.measured, 'N')}`);
  setText(byId('feedforward'), now.feedforward === null ? 'none' : number(now.feedforward, 'N'));
  const {scale, force_limit: limit} = now.settings;
  setText(byId('feedforward-more'), scale === 0 ? 'OFF: scale is 0' : scale === null ? '' : `scale ${number(scale)}, at most ${number(limit, 'N')}`);
  writeTracking();
  const isOff = now.adaptation === 'off';
  setText(byId('adaptation'), isOff ? 'off' : number(now.adaptation_scale));
  setText(byId('adaptation-more'), isOff ? '' : `${now.adaptation === 'on' ? 'in use' : 'observed only'}, std ${number(now.adaptation_scale_std, '', 2)}, offset ${number(now.offset, 'N', 2)}`);
  replaceIfChanged(byId('faults'), now.faults, () => (now.faults.length ? now.faults.map((text) => element('li', text)) : [element('li', 'none')]));
  writeInputAges();
  replaceIfChanged(byId('seals'), now.seals, () => now.seals.map((name) => element('li', name)));
  setText(byId('range'), now.range[1] === null ? '' : `identified from ${number(now.range[0])} to ${number(now.range[1], 'bar')}`);
  const source = [['node', frame.node], ['frame', now.frame || 'none'], ...unreadNodes(frame.nodes).map((text) => ['not shown', text])];
  replaceIfChanged(byId('source'), source, () => source.map(([name, text]) => line(name, text)));
}

// Ages grow while no frame comes.
const grown = (age) => (age === null || about.mode === 'bag' ? age : age + (performance.now() - lastFrame) / 1000);

function writeInputAges() {
  const ages = [...Object.entries(now.ages), ['estimate', now.answer_age]].map(([name, age]) => [name, grown(age)]);
  byId('ages').replaceChildren(...ages.map(([name, age]) => {
    const made = line(name, age === null ? 'never came' : `${age.toFixed(2)} s`);
    if (age === null || age > TOO_OLD) made.className = 'old';
    return made;
  }));
}

function writeAges() {
  for (const tile of document.querySelectorAll('.tile')) {
    const age = grown(now[tile.dataset.age]), isOld = age !== null && age > TOO_OLD;
    tile.classList.toggle('old', isOld);
    setText(tile.querySelector('em'), isOld ? `${age.toFixed(1)} s old` : '');
  }
}

function writeLamps() {
  for (const name of LAMPS) byId(`lamp-${name}`).classList.toggle('lit', now.feedforward !== null && now.lamps[name]);
}

function writeTracking() {
  const recent = (columns.error || []).slice(-300).filter((value) => value !== null);
  setText(byId('error'), recent.length ? number(recent[recent.length - 1], 'µm') : 'none');
  const rms = Math.sqrt(recent.reduce((sum, value) => sum + value * value, 0) / Math.max(recent.length, 1));
  setText(byId('error-more'), recent.length ? `RMS of 3 s: ${number(rms, 'µm')}` : 'no reference or position');
}

function writeTabs(actuators) {
  const tabs = byId('tabs');
  replaceIfChanged(tabs, actuators.map((one) => one.label), () => actuators.map((one) => {
    const tab = element('button');
    tab.type = 'button';
    tab.append(element('span', one.label), element('b'));
    tab.addEventListener('click', () => choose(one.label));
    return tab;
  }));
  actuators.forEach((one, place) => {
    tabs.children[place].setAttribute('aria-pressed', String(one.label === label));
    const value = tabs.children[place].lastChild, force = one.feedforward === null ? '' : ` ${one.feedforward.toFixed(1)} N`;
    value.className = one.verdict;
    setText(value, `${one.verdict}${force}`);
  });
  tabs.hidden = actuators.length < 2;
}

function writeDiagnostics(list) {
  const open = new Set([...byId('diagnostics').querySelectorAll('details[open]')].map((node) => node.dataset.part));
  byId('diagnostics').replaceChildren(...(list.length ? list.map((one) => {
    const made = element('div', '', `status ${LEVELS[one.level] || 'bad'}`);
    made.append(element('b', `${one.part}: ${LEVEL_WORDS[one.level] || one.level}`), element('div', one.message));
    const more = element('details');
    more.dataset.part = one.part;
    more.open = open.has(one.part);
    const table = element('table');
    table.append(...Object.entries(one.values).map(([name, value]) => line(name, value)));
    more.append(element('summary', `${Object.keys(one.values).length} values`), table);
    made.append(more);
    return made;
  }) : [element('p', 'none received')]));
}

// -- changes ------------------------------------------------------------------------------------------------------

// Why the monitor refuses a request: its own page has a wrong token only if it is of another start.
const refusal = async (response) => (response.status === 403 ? EARLIER : response.text());

// What the monitor answers, however late; what it refuses counts as an answer that confirms nothing.
async function send(path, document) {
  try {
    const response = await fetch(address(path), {
      method: 'POST', headers: {'Content-Type': 'application/json'}, body: JSON.stringify(document),
    });
    return response.ok ? await response.json() : [{confirmed: false, text: `NOT CONFIRMED: ${await refusal(response)}`}];
  } catch (error) {
    return [{confirmed: false, text: UNANSWERED}];
  }
}

async function change(name, value, inputs) {
  const output = byId('change-answer');
  if (name === 'scale' && value > 1 && !confirm(`Scale ${value}: more force than the friction, the rod may move by itself. Set it?`)) {
    for (const input of inputs) input.value = input.dataset.shown;
    return;
  }
  output.className = 'waiting';
  output.textContent = 'sent, waiting for the answer of the node';
  const answers = await send('/change', {actuator: label, parameter: name, value});
  const isDone = answers.every((answer) => answer.confirmed);
  output.className = isDone ? 'yes' : 'no';
  output.textContent = answers.map((answer) => answer.text).join('; ');
  if (!isDone) for (const input of inputs) input.value = input.dataset.shown;
}

async function pressOff() {
  const mine = {time: performance.now(), presses: off ? off.presses : 0, lines: null};
  pressed = mine;
  writeOff();
  setTimeout(writeOff, UNCONFIRMED_AFTER);
  mine.lines = (await send('/off', {})).map((answer) => [answer.confirmed ? 'yes' : 'no', answer.text]);
  writeOff();
}

function offLines() {
  if (pressed && off && off.presses > pressed.presses) pressed = null;  // the state of the monitor has it
  if (pressed && pressed.lines) return isLost() ? pressed.lines.map(([kind, text]) => [kind === 'yes' ? 'gone' : kind, text]) : pressed.lines;
  if (pressed && performance.now() - pressed.time < UNCONFIRMED_AFTER) return [['waiting', 'sent, waiting for the answer of the node']];
  if (pressed) return [['no', UNANSWERED]];
  if (off && isLost()) return [['no', `NOT KNOWN: no connection to the monitor; pressed at ${off.since}`]];
  return off ? off.lines : [];
}

function writeOff() {
  const lines = offLines(), events = off ? off.events : [];
  byId('off-state').hidden = !lines.length;
  byId('off-answer').className = KINDS.find((kind) => lines.some((one) => one[0] === kind)) || '';
  replaceIfChanged(byId('off-answer'), lines, () => lines.map(([kind, text]) => element('li', text, kind)));
  replaceIfChanged(byId('off-events'), events, () => events.map((text) => element('li', text)));
  byId('lift').hidden = !off || isLost();
}

// Two clicks: the first one arms the second.
function pressLift() {
  const button = byId('lift'), isArmed = button.classList.contains('armed');
  const arm = (armed) => {
    button.classList.toggle('armed', armed);
    setText(button, armed ? 'Really lift? A scale may then be set again' : 'Lift OFF');
  };
  arm(!isArmed);
  if (isArmed) send('/lift', {});
  else setTimeout(() => arm(false), ARMED_FOR);
}

const inputsOf = (name) => [byId(`slide-${name}`), byId(`field-${name}`)];

function listenToSliders() {
  for (const [name, factor] of Object.entries(SETTINGS)) {
    for (const input of inputsOf(name)) {
      input.addEventListener('change', () => input.value !== '' && change(name, Number(input.value) / factor, inputsOf(name)));
    }
  }
}

function writeSliders() {
  const box = byId('settings');
  if (about.mode !== 'live' || !now.seals.length) return;
  box.hidden = false;
  if (box.dataset.told !== label) byId('slide-force_limit').max = Math.max(Math.ceil(2 * (now.settings.force_limit || 0)), 10);
  box.dataset.told = label;
  for (const [name, factor] of Object.entries(SETTINGS)) {  // what the node has, unless somebody is changing it
    const value = now.settings[name];
    for (const input of inputsOf(name)) {
      input.disabled = !about.can_change || (name === 'scale' && off !== null);
      const shown = value === null ? '' : String(+(value * factor).toPrecision(6));
      if (input !== document.activeElement && input.dataset.shown !== shown) input.value = input.dataset.shown = shown;
    }
  }
}

// -- live and recorded --------------------------------------------------------------------------------------------

function choose(wanted) {
  label = '';
  zoomed = null;
  if (about.mode === 'live') connect(wanted);
  else showBag(wanted);
}

function connect(wanted = '', since = -1) {
  if (stream) stream.close();
  stream = new EventSource(address('/stream', {actuator: wanted, since}));
  const mine = stream;
  stream.onmessage = (event) => {
    const frame = JSON.parse(event.data);
    if (frame.label && frame.now.cause) mode('dead', CAUSES[frame.now.cause]);
    else mode('live', 'LIVE');
    takeFrame(frame);
  };
  stream.onerror = () => {
    mine.close();
    if (mine !== stream) return;
    lost();
    setTimeout(() => mine === stream && reconnect(label || wanted), 1000);
  };
}

// Ask what the server shows; whether it answers. A refusal has a reason, which the page then says.
async function describe() {
  const response = await fetch(address('/describe'));
  if (response.ok) about = await response.json();
  else refused(await refusal(response));
  return response.ok;
}

// Go on where the stream broke off; with another monitor from the beginning.
async function reconnect(wanted) {
  const before = about.start;
  try {
    if (!await describe()) return;
    if (about.start !== before) clearRows();
  } catch (error) {  // not there yet
  }
  connect(wanted, columns.time.length ? columns.time.at(-1) : -1);
}

const isLost = () => document.body.classList.contains('lost');

function mode(kind, text) {
  byId('mode').className = `badge ${kind}`;
  setText(byId('mode'), text);
  document.body.classList.toggle('lost', kind === 'lost');
}

function lost() {
  mode('lost', 'NO CONNECTION');
  verdict('lost', 'old', 'the monitor is gone: it does not answer. Is it still running, and the tunnel? What is shown is old');
  if (now) {
    writeAges();
    writeInputAges();
  }
  writeOff();
}

function refused(text) {
  clearInterval(watch);
  mode('lost', 'NO CONNECTION');
  verdict('lost', 'refused', text);
  writeOff();
}

let busy = false, again = null, playing = null;

async function showBag(wanted = label) {
  if (busy) {
    again = wanted;
    return;
  }
  busy = true;
  try {
    const until = Number(byId('time').value);
    const response = await fetch(address('/view', {actuator: wanted, since: until - span, until}));
    if (!response.ok) throw new Error(await response.text());
    const frame = await response.json();
    if (columns.time) clearRows();
    takeFrame(frame);
    writeMarks();
    const read = about.loaded < about.duration ? `, read to ${about.loaded.toFixed(0)} s` : '';
    setText(byId('clock'), `${frame.time.toFixed(1)} of ${about.duration.toFixed(1)} s${read}`);
    mode('bag', `RECORDING ${about.name}`);
  } catch (error) {
    lost();
  }
  busy = false;
  if (again !== null) {
    const next = again;
    again = null;
    showBag(next);
  }
}

const goTo = (time) => {
  byId('time').value = Math.min(time + span / 2, about.duration);
  showBag();
};

// The next fault after the middle of the window; after the last one the first.
function nextFault() {
  const starts = (about.faults[label] ?? []).map(([begin]) => begin), middle = Number(byId('time').value) - span / 2;
  if (starts.length) goTo(starts.find((begin) => begin > middle + 0.06) ?? starts[0]);
}

// Above the slider: friction of the whole bag, a tick for each reversal, and a mark for each fault, which goes there.
function writeMarks() {
  if (!about.overview[label]) return; // an actuator that came while the bag is read
  const duration = about.duration || 1, share = (time) => `${100 * Math.max(time, 0) / duration}%`;
  const faults = about.faults[label], {curve, reversals} = about.overview[label];
  replaceIfChanged(byId('marks'), faults, () => faults.map(([begin, last, words]) => {
    const made = element('button');
    made.type = 'button';
    made.title = `${begin.toFixed(1)} s: ${words}`;
    made.setAttribute('aria-label', made.title);
    made.style.left = share(begin);
    made.style.width = share(last - begin);
    made.addEventListener('click', () => goTo(begin));
    return made;
  }));
  byId('next-fault').disabled = !faults.length;
  const x = (time) => (1000 * time / duration).toFixed(1), known = curve.filter((point) => point[1] !== null);
  const [low, high] = [Math.min(...known.map((point) => point[1])), Math.max(...known.map((point) => point[2]))];
  const y = (force) => (32 - 30 * (force - low) / (high - low || 1)).toFixed(1);
  const path = curve.map(([time, least, most], place) => (
    least === null ? '' : `${place && curve[place - 1][1] !== null ? 'L' : 'M'}${x(time)} ${y(least)}V${y(most)}`));
  byId('friction-curve').setAttribute('d', path.join(''));
  byId('reversals').setAttribute('d', reversals.map((time) => `M${x(time)} 35V40`).join(''));
}

// What has been read meanwhile.
async function readOn() {
  try {
    if (!await describe()) return;
    showBag();
  } catch (error) {
    lost();
  }
  if (about.loaded < about.duration) setTimeout(readOn, READ_PERIOD);
}

function play() {
  if (playing) {
    clearInterval(playing);
    playing = null;
  } else {
    let before = performance.now();
    const slider = byId('time');
    if (Number(slider.value) >= about.duration) slider.value = Math.min(span, about.duration);
    let place = Number(slider.value);
    playing = setInterval(() => {
      const moment = performance.now();
      place += Number(byId('speed').value) * (moment - before) / 1000;
      before = moment;
      slider.value = place;
      showBag();
      if (place >= about.duration) play();
    }, 50);
  }
  setText(byId('play'), playing ? 'Pause' : 'Play');
}

function makeSpans(choices) {
  byId('spans').replaceChildren(...choices.map((seconds) => {
    const button = element('button', `${seconds} s`);
    button.type = 'button';
    button.setAttribute('aria-pressed', String(seconds === span));
    button.addEventListener('click', () => {
      span = seconds;
      zoomed = null;
      makeSpans(choices);
      if (about.mode === 'bag') showBag();
      else drawSoon();
    });
    return button;
  }));
}

async function begin() {
  try {
    if (!await describe()) return;
  } catch (error) {
    lost();
    return;
  }
  clearRows();
  const isLive = about.mode === 'live';
  makeSpans(isLive ? [2, 5, 10, 30] : [2, 5, 10, 60]);
  for (const id of ['hold', 'diagnostics-card', 'off']) byId(id).hidden = !isLive;
  byId('player').hidden = isLive;
  byId('off').disabled = !about.can_change;
  setText(byId('off-note'), about.can_change ? 'all feed-forwards' : 'read only');
  byId('off').title = about.can_change ? 'sets the scale of every feed-forward to 0' : 'start the monitor with --allow-changes';
  byId('off').addEventListener('click', pressOff);
  byId('lift').addEventListener('click', pressLift);
  listenToSliders();
  byId('hold').addEventListener('click', () => {
    held = !held;
    byId('hold').setAttribute('aria-pressed', String(held));
    setText(byId('hold'), held ? 'Follow' : 'Hold');
  });
  if (isLive) {
    connect();
    watch = setInterval(() => performance.now() - lastFrame > LOST_AFTER && lastFrame && lost(), 500);
  } else {
    document.title = `Seal friction: ${about.name}`;
    byId('time').max = about.duration;
    byId('time').value = Math.min(about.first + span, about.duration);
    byId('time').addEventListener('input', () => showBag());
    byId('play').addEventListener('click', play);
    byId('next-fault').addEventListener('click', nextFault);
    showBag('');
    if (about.loaded < about.duration) setTimeout(readOn, READ_PERIOD);
  }
}

addEventListener('resize', () => {
  for (const {plot} of charts) plot.setSize({width: Math.max(plot.root.parentNode.clientWidth - 26, 200), height: 190});
});
begin();
