import {OrbitControls} from 'three/examples/jsm/controls/OrbitControls.js';
import {
  BufferAttribute, BufferGeometry, Color, Line, LineBasicMaterial, LineDashedMaterial,
  PerspectiveCamera, Points, PointsMaterial, Scene, Vector3, WebGLRenderer,
} from 'three';
import uPlot from 'uplot';

const data = JSON.parse(document.getElementById('data').textContent);
const page = document.getElementById('page');
const cohort = data.headline ? data.headline.cohort : data.trackers.includes('subspace') ? 'subspace' : null;

// ---- small helpers ----

const el = (tag, attributes = {}, ...children) => {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === 'class') element.className = value;
    else if (name === 'style') element.style.cssText = value;
    else element.setAttribute(name, value);
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return element;
};
const section = (title, ...children) => {
  const element = el('section', {}, el('h2', {}, title), ...children);
  page.append(element);
  return element;
};
const plural = (n, word) => `${n} ${word}${n === 1 ? '' : 's'}`;
const list = (names) =>
  names.length < 2 ? names.join('') : `${names.slice(0, -1).join(', ')} and ${names.at(-1)}`;
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// Three significant digits; a dash for what is not there.
const digits = (value) => {
  if (value === null || value === undefined) return '\u2013';
  if (!Number.isFinite(value)) return 'failed';
  if (value === 0) return '0';
  if (Number.isInteger(value)) return String(value);
  const places = Math.max(0, Math.min(4, 2 - Math.floor(Math.log10(Math.abs(value)))));
  return value.toFixed(places);
};
const percent = (share) => (share === null ? '\u2013' : `${Math.round(100 * share)}\u00a0%`);
// As numpy's percentile, also of lists with Infinity.
const quantile = (values, share) => {
  if (!values.length) return null;
  const sorted = [...values].sort((a, b) => a - b);
  const place = share * (sorted.length - 1);
  const low = sorted[Math.floor(place)];
  const high = sorted[Math.ceil(place)];
  if (low === high) return low;
  return low + (high - low) * (place - Math.floor(place));
};

// ---- the results ----

const key = (...parts) => parts.join('\u0000');
const values = new Map();  // sequence, level, tracker, backend, metric -> values over seeds
const addValue = (value, ...names) => {
  const name = key(...names);
  if (!values.has(name)) values.set(name, []);
  values.get(name).push(value);
};
for (const [sequence, level, tracker, backend, , metric, value] of data.rows) {
  addValue(value, sequence, level, tracker, backend, metric);
  if (metric === 'halves_failed' && value) addValue(Infinity, sequence, level, tracker, backend, 'halves_disagreement');
}
const valuesOf = (sequence, level, tracker, backend, metric) =>
  values.get(key(sequence, level, tracker, backend, metric)) || [];
const runs = (...cell) => valuesOf(...cell, 'failed').length;
const failures = (...cell) => valuesOf(...cell, 'failed').filter((failed) => failed).length;

const METRICS = {
  ate: {name: 'camera error', unit: 'mm', factor: 1000},
  halves_disagreement: {name: 'disagreement of halves', unit: '% of the path', factor: 100},
  point_error_median: {name: 'point error', unit: 'mm', factor: 1000},
  mean_track_length: {name: 'track length', unit: 'frames', factor: 1},
  observed_error_median: {name: 'track error', unit: 'px', factor: 1},
};
// A figure of the tracks stands under the backend '' unless a second pass has made other tracks.
const figure = (sequence, level, tracker, backend, metric) => {
  const own = valuesOf(sequence, level, tracker, backend, metric);
  const found = own.length ? own : valuesOf(sequence, level, tracker, '', metric);
  return found.map((value) => value * METRICS[metric].factor);
};

const PALETTE = ['#8250c4', '#b58900', '#8c564b', '#c2458a', '#00838f', '#7a7a00'];
const BLUES = ['#2a78b8', '#69aee0', '#174a78', '#9cc9ee'];
const GREENS = ['#1f8f63', '#74c9a4', '#0f5a3d', '#a8dfc7'];
const colors = new Map();
{
  let blue = 0, green = 0, other = 0;
  for (const tracker of data.trackers) {
    if (tracker === cohort) colors.set(tracker, '#e8590c');
    else if (/^klt\d*(-refined)?$/.test(tracker)) colors.set(tracker, BLUES[blue++ % BLUES.length]);
    else if (/^anchored-klt\d*(-refined)?$/.test(tracker)) colors.set(tracker, GREENS[green++ % GREENS.length]);
    else if (tracker === 'ceiling') colors.set(tracker, '#8a939b');
    else colors.set(tracker, PALETTE[other++ % PALETTE.length]);
  }
}
const ABOUT_TRACKERS = [
  [/^klt\d*$/, 'Lucas-Kanade from frame to frame, each feature for itself, checked by tracking back; the number is the window in pixels'],
  [/^anchored-klt\d*$/, 'KLT as a guide, then measured against the feature\u2019s own first frame; no joint constraint'],
  [/^subspace$/, 'cohort: all features together, each then measured where the others say it is; after the last frame measured again where a reconstruction says it is'],
  [/-online$/, 'the same without the second pass over the clip'],
  [/^(anchored-)?klt\d*-refined$/, 'the same, followed by cohort\u2019s second pass: every feature measured again where a reconstruction says it is'],
  [/^subspace-paper$/, 'the joint tracker as its paper prints it, without measurement'],
  [/^descent/, 'first-order descent of each feature for itself'],
  [/^ceiling$/, 'the true tracks plus the least noise with which a patch of 21 x 21 px can be located by itself in such darkness (Cram\u00e9r-Rao bound)'],
  [/^sift$/, 'COLMAP\u2019s own SIFT features and sequential matching on the same frames'],
  [/^rlof$/, 'robust local optical flow of OpenCV'],
];
const ABOUT_BACKENDS = {
  ceres: 'cohort\u2019s own reconstruction',
  colmap: 'COLMAP\u2019s incremental mapper',
  triangulation: 'points alone, seen from the true cameras: the tracks without the solver',
};

// ---- opening ----

// Rows and runs of the headline by level and backend; the first standing rival has a table of its own.
const FIRST_RIVAL = data.headline ? data.headline.main_rival : null;
const headlineRow = (level, backend, metric, rival) => data.headline.rows.find((row) =>
  row.level === level && row.backend === backend && row.metric === metric && row.rival === rival);
const cohortRuns = data.headline ? data.headline.runs.filter((runs) => runs.tracker === cohort) : [];
const rivalRuns = (own) => data.headline.runs.filter((runs) =>
  runs.level === own.level && runs.backend === own.backend && runs.tracker !== cohort);
const roleOf = (name) => data.headline.rivals.find((rival) => rival.name === name).role;

// Of how many clips, where it is not all: failures have no error to compare.
const someClips = (row, own) => (row.clips < own.clips ? `${row.clips} of ${own.clips} clips` : null);
const ratioSpan = (row, own) => {
  if (!row) return '\u2013';
  const spread = row.least !== row.largest ? `${digits(row.least)} to ${digits(row.largest)}` : null;
  const won = roleOf(row.rival) === 'bound' ? '' : row.ratio > 1 ? 'win' : 'lose';
  return el('span', {},
    el('span', {class: won}, `${digits(row.ratio)}\u00d7`),
    [spread, someClips(row, own)].filter((text) => text).map((text) => el('small', {}, text)));
};

page.append(
  el('h1', {}, data.headline ? 'Tracking in the dark: cohort against KLT' : 'Comparison of trackers'),
  el('p', {class: 'lead'},
    'Feature points were tracked through video, and cameras and points were reconstructed from the tracks. ',
    `${plural(data.sequences.length, 'clip')}, ${plural(data.levels.length, 'level')} of darkness, `,
    `${plural(data.trackers.length, 'tracker')}, ${plural(data.backends.length, 'reconstruction method')}, `,
    `${plural(data.seeds.length, 'seed')} of the noise. Nothing but the tracker changes between columns that are compared.`));

const compared = (value, whose) => {
  const times = digits(Math.max(value, 1 / value));
  if (Number(times) === 1) return `the same as ${whose}`;
  return `${times}\u00d7 ${value > 1 ? 'smaller' : 'larger'} than ${whose}`;
};
const openingCards = () => {
  const cards = el('div', {class: 'cards'});
  for (const own of cohortRuns) {
    const {level, backend} = own;
    const metric = ['ate', 'point_error_median'].find((name) => headlineRow(level, backend, name, FIRST_RIVAL));
    if (!metric) continue;
    const row = headlineRow(level, backend, metric, FIRST_RIVAL);
    const wins = row.ratio > 1;
    const others = data.headline.rivals
      .filter((rival) => rival.role === 'contender' && rival.name !== FIRST_RIVAL)
      .map((rival) => headlineRow(level, backend, metric, rival.name)).filter((found) => found);
    cards.append(el('div', {class: 'card'},
      el('div', {class: 'soft'}, `${level}, ${backend}`),
      el('b', {class: wins ? 'win' : 'lose'}, `${digits(wins ? row.ratio : 1 / row.ratio)}\u00d7`),
      `${wins ? 'smaller' : 'larger'} ${METRICS[metric].name} than the best ${FIRST_RIVAL}${someClips(row, own) ? `, in ${someClips(row, own)}` : ''}`,
      others.map((other) => el('div', {class: 'soft'}, compared(other.ratio, `the best ${other.rival}`)))));
  }
  return cards.children.length ? cards : null;
};

// ---- headline tables ----

const HEADLINE_METRICS = ['ate', 'point_error_median', 'mean_track_length'];
// Lines: of each the cohort's runs and a rival's.
const headlineTable = (id, names, lines) => {
  const metrics = HEADLINE_METRICS.filter((metric) => lines.some(([own, runs]) => headlineRow(own.level, own.backend, metric, runs.tracker)));
  return el('div', {class: 'scroll'}, el('table', {id},
    el('thead', {}, el('tr', {},
      names.map((title) => el('th', {class: 'name'}, title)), el('th', {}, 'clips'),
      metrics.map((metric) => el('th', {}, METRICS[metric].name)),
      ['frames registered: cohort / rival', 'clips failed: cohort / rival'].map((title) => el('th', {}, title)))),
    el('tbody', {}, lines.map(([own, runs]) => el('tr', {},
      [own.level, own.backend, runs.tracker].slice(0, names.length).map((text) => el('td', {class: 'name'}, text)),
      el('td', {}, own.clips === runs.clips ? String(own.clips) : `${own.clips} / ${runs.clips}`),
      metrics.map((metric) => el('td', {}, ratioSpan(headlineRow(own.level, own.backend, metric, runs.tracker), own))),
      el('td', {}, `${percent(own.registered)} / ${percent(runs.registered)}`),
      el('td', {}, `${own.failed} / ${runs.failed}`))))));
};

if (data.headline) {
  const lines = cohortRuns.flatMap((own) => rivalRuns(own).map((runs) => [own, runs]));
  const first = lines.filter(([, runs]) => runs.tracker === FIRST_RIVAL);
  const others = lines.filter(([, runs]) => runs.tracker !== FIRST_RIVAL);
  const hasBound = data.headline.rivals.some((rival) => rival.role === 'bound');
  const figures = [
    'Errors are so many times smaller, tracks so many times longer. Each is the geometric mean over the clips in which both have a reconstruction, of the median over seeds, a failed seed being an infinite error; small print: the least and the largest of a single seed, and of how many clips if not of all. ',
    'A run fails if fewer than 80 % of its frames get a camera. A clip in which at least half of the seeds fail has no error to compare: it is counted on the right.'];
  if (first.length) {
    section('Who won, and by how much',
      openingCards(),
      el('p', {}, `How many times better cohort is than ${FIRST_RIVAL}, which stands for the best of its settings in each clip, chosen after the fact, in its favour. `, figures),
      headlineTable('headline', ['darkness', 'reconstruction'], first));
  }

  if (others.length) {
    section(first.length ? 'The other rivals' : 'The rivals',
      el('p', {}, first.length ? 'The same beside each of the others: above' : ['How many times better cohort is than each. ', ...figures, ' Above'],
        ' 1\u00d7 cohort is better by that factor. ',
        hasBound ? 'The ceiling is no rival, and its figures are the other way round: how many times worse cohort is; 1\u00d7 is the goal. It is what true tracks reach with the least noise that patches of 21 x 21 px allow, each measured by itself; wider patches, other features and a second pass can go beyond.' : ''),
      headlineTable('others', ['darkness', 'reconstruction', 'rival'], others));
  }

  const contenders = data.headline.rivals.filter((rival) => rival.role === 'contender').map((rival) => rival.name).join(' or ');
  const losses = data.headline.losses;
  const text = (loss) => {
    const metric = METRICS[loss.metric];
    const ours = loss.cohort === null ? 'cohort failed' : `cohort ${digits(loss.cohort * metric.factor)} ${metric.unit}`;
    return `${loss.sequence}, ${loss.level}, ${loss.backend}: ${metric.name}: ${ours}, ${loss.rival} ${digits(loss.best * metric.factor)} ${metric.unit}`;
  };
  const size = (loss) => (loss.cohort === null ? Infinity : loss.cohort / loss.best);
  const sorted = [...losses].sort((a, b) => size(b) - size(a));
  const items = (part) => el('ul', {}, part.map((loss) => el('li', {}, text(loss))));
  section('Where cohort does not win',
    losses.length === 0
      ? el('p', {}, `In none of ${data.headline.contests} comparisons (clip, darkness, reconstruction; camera error and point error) was ${contenders} better.`)
      : el('p', {}, `In ${losses.length} of ${data.headline.contests} comparisons (clip, darkness, reconstruction; camera error and point error) ${contenders} was better. The widest first:`),
    items(sorted.slice(0, 8)),
    sorted.length > 8 ? el('details', {}, el('summary', {}, `${sorted.length - 8} more`), items(sorted.slice(8))) : null);
}

// ---- error against darkness ----

const themed = [];  // drawn anew when the theme or the width changes
const trackerKey = (trackers) => el('div', {class: 'key'}, trackers.map((tracker) =>
  el('span', {}, el('i', {class: tracker === 'ceiling' ? 'dashed' : '', style: `color:${colors.get(tracker)}`}), tracker)));

const byDarkness = [...data.levels].sort((a, b) => {
  const place = (level) => (level.name === 'as-is' ? -1 : level.darkness ?? 99);
  return place(a) - place(b);
});

// 1, 2, 5, 10 ... between two bounds, or 1, 10, 100 ... where these would be too many.
const roundNumbers = (min, max) => {
  const steps = max / min > 300 ? [1] : [1, 2, 5];
  const numbers = [];
  for (let power = Math.floor(Math.log10(min)); power <= Math.log10(max); ++power) {
    for (const step of steps) {
      const number = Number(`${step}e${power}`);
      if (number >= min && number <= max) numbers.push(number);
    }
  }
  return numbers;
};

const darknessPlot = (holder, backend, metric) => {
  const xs = byDarkness.map((_, i) => i);
  // What is measured of the tracks does not fail with the reconstruction; halves that failed are
  // among the values already, and a clip without the truth has no figure to fail.
  const isOfTracks = metric === 'observed_error_median' || metric === 'mean_track_length';
  const canHave = (sequence) => (metric === 'ate' ? sequence.has_poses
    : metric === 'point_error_median' || metric === 'observed_error_median' ? sequence.has_track_truth
      : metric === 'mean_track_length');
  const failuresAt = (level, tracker) => data.sequences.filter(canHave).reduce((sum, sequence) =>
    sum + failures(sequence.name, level.name, tracker, isOfTracks ? '' : backend), 0);
  const has = (tracker) => data.sequences.some((sequence) =>
    byDarkness.some((level) => figure(sequence.name, level.name, tracker, backend, metric).length));
  if (!data.trackers.some(has)) return false;
  const trackers = data.trackers.filter((tracker) =>
    has(tracker) || byDarkness.some((level) => failuresAt(level, tracker)));
  const columns = [xs];
  const series = [{}];
  const bands = [];
  const failedAt = [];
  for (const tracker of trackers) {
    const low = [], middle = [], high = [];
    byDarkness.forEach((level, i) => {
      const all = data.sequences.flatMap((sequence) => figure(sequence.name, level.name, tracker, backend, metric));
      for (let n = failuresAt(level, tracker); n > 0; --n) all.push(metric === 'mean_track_length' ? 0 : Infinity);
      const finite = all.filter(Number.isFinite);
      const clip = (value) => (Number.isFinite(value) ? value : null);
      const median = quantile(all, 0.5);
      const least = quantile(all, 0.25);
      middle.push(clip(median));
      low.push(clip(least));
      high.push(Number.isFinite(median) ? Math.min(quantile(all, 0.75), Math.max(...finite)) : null);
      if (median === Infinity) failedAt.push({tracker, i});
    });
    const color = colors.get(tracker);
    bands.push({series: [series.length, series.length + 1], fill: color + '22'});
    columns.push(high, low, middle);
    const thin = {stroke: color + '55', width: 1, points: {show: byDarkness.length < 2, size: 4}};
    series.push(thin, thin, {
      label: tracker, stroke: color, width: tracker === cohort ? 3 : 2,
      dash: tracker === 'ceiling' ? [6, 4] : undefined,
      points: {show: true, size: tracker === cohort ? 9 : 6, fill: color},
    });
  }
  const ink = css('--soft');
  const grid = {stroke: css('--line'), width: 1};
  const logarithmic = metric !== 'mean_track_length';
  const marks = (u) => {  // failures: crosses at the top, beside each other
    const context = u.ctx;
    context.save();
    context.lineWidth = 2 * devicePixelRatio;
    const seen = new Map();
    for (const {tracker, i} of failedAt) {
      const n = seen.get(i) || 0;
      seen.set(i, n + 1);
      const x = u.valToPos(i, 'x', true) + (n - 0.5) * 14 * devicePixelRatio;
      const y = u.bbox.top + 8 * devicePixelRatio;
      const r = 4 * devicePixelRatio;
      context.strokeStyle = colors.get(tracker);
      context.beginPath();
      context.moveTo(x - r, y - r); context.lineTo(x + r, y + r);
      context.moveTo(x - r, y + r); context.lineTo(x + r, y - r);
      context.stroke();
    }
    context.restore();
  };
  new uPlot({
    width: Math.max(260, holder.clientWidth), height: 300, series, bands,
    cursor: {show: false}, legend: {show: false},
    scales: {
      x: {time: false, range: [-0.4, xs.length - 0.6]},
      y: {distr: logarithmic ? 3 : 1, range: logarithmic
        ? (u, min, max) => (min > 0 ? [min / 1.5, max * 1.9] : [0.1, 10])
        : (u, min, max) => [0, Math.max(1, max * 1.15)]},
    },
    axes: [
      {stroke: ink, grid, ticks: grid, splits: () => xs, values: () => byDarkness.map((level) => level.name)},
      {stroke: ink, grid, ticks: grid, size: 62, ...(logarithmic ? {splits: (u, i, min, max) => roundNumbers(min, max)} : {}), values: (u, splits) => splits.map((v) => (v === null ? '' : String(+v.toPrecision(3))))},
    ],
    hooks: {draw: [marks]},
  }, columns, holder);
  return true;
};

{
  const plots = ['ate', 'halves_disagreement', 'point_error_median', 'observed_error_median', 'mean_track_length'];
  const holders = new Map();
  const grid = el('div', {class: 'pair'});
  for (const metric of plots) {
    const holder = el('div', {class: 'plot'});
    const box = el('figure', {}, el('h3', {}, `${METRICS[metric].name} [${METRICS[metric].unit}]`), holder);
    holders.set(metric, [box, holder]);
    grid.append(box);
  }
  let backend = data.backends[0];
  const draw = () => {
    for (const [metric, [box, holder]] of holders) {
      holder.replaceChildren();
      box.hidden = false;
      box.hidden = !darknessPlot(holder, backend, metric);
    }
  };
  const buttons = data.backends.map((name) => {
    const button = el('button', {type: 'button', 'aria-pressed': String(name === backend)}, name);
    button.onclick = () => {
      backend = name;
      for (const other of buttons) other.setAttribute('aria-pressed', String(other === button));
      draw();
    };
    return button;
  });
  section('Error against darkness',
    el('p', {}, 'Median over clips and seeds, shaded from the first to the third quartile; a failed reconstruction counts as an infinite camera and point error. A cross at the top: at least half fail there. Errors on a logarithmic scale.'),
    el('ul', {class: 'soft'}, byDarkness.map((level) => el('li', {}, el('b', {}, level.name), `: ${level.about}`))),
    data.backends.length > 1 ? el('div', {class: 'choice', 'aria-label': 'reconstruction'}, buttons) : null,
    trackerKey(data.trackers), grid);
  themed.push(draw);
}

// ---- tracks over a dark frame ----

if (data.pictures && data.pictures.trackers.length) {
  const {sequence, level, seed, frame, has_truth: hasTruth, trackers} = data.pictures;
  const dot = (color, text, kind = 'dot') =>
    el('span', {}, el('i', {class: kind, style: kind === 'dot' ? `background:${color}` : `border-color:${color}`}), text);
  section('The tracks over the darkest frame',
    el('p', {}, `Clip ${sequence}, ${level}, seed ${seed}, frame ${frame}, contrast stretched so that you can see it. ${hasTruth ? 'The first clip with true tracks' : 'The first clip'} and the darkest level of the run, not chosen by result. A line is where the feature was in the last eight frames.`),
    hasTruth
      ? el('div', {class: 'key'}, dot('#14c896', 'within 1 px of the truth'), dot('#f0be28', 'within 3 px'), dot('#eb3c3c', 'further off'), dot('#14c896', 'predicted, not confirmed by this frame', 'ring'), el('span', {}, '+ true position'))
      : el('div', {class: 'key'}, dot('#50c8e6', 'confirmed by this frame'), dot('#ffa03c', 'predicted, not confirmed', 'ring')),
    el('div', {class: 'gallery'}, trackers.map((tracker) => el('figure', {},
      el('img', {src: tracker.src, width: tracker.width, height: tracker.height, alt: `tracks of ${tracker.tracker}`, loading: 'lazy'}),
      el('figcaption', {}, el('b', {}, tracker.tracker), `: ${plural(tracker.observed, 'observed position')}`,
        tracker.known ? `, of ${tracker.known} with known truth ${Math.round(100 * tracker.near / tracker.known)} % within 1 px, ${Math.round(100 * tracker.far / tracker.known)} % beyond 3 px` : '',
        tracker.predicted ? `; ${tracker.predicted} predicted` : '')))));
}

// ---- reconstructions ----

const ERROR_COLORS = [  // by a point's error as a share of its distance
  ['#12a37a', 'within 1 % of its distance'], ['#e0a100', 'within 5 %'], ['#e03131', 'further off']];

const views = [];
const vectors = (flat) => {
  const result = [];
  for (let i = 0; i + 2 < flat.length; i += 3) result.push(new Vector3(flat[i], flat[i + 1], flat[i + 2]));
  return result;
};
const middleOf = (points) => {
  const axis = (name) => quantile(points.map((point) => point[name]), 0.5) || 0;
  return new Vector3(axis('x'), axis('y'), axis('z'));
};
const geometry = (flat) => {
  const result = new BufferGeometry();
  result.setAttribute('position', new BufferAttribute(new Float32Array(flat), 3));
  return result;
};

const shares = (model) => {
  const known = model.error_classes.filter((i) => i < 3);
  if (!known.length) return '';
  const share = (i) => Math.round(100 * known.filter((other) => other === i).length / known.length);
  return `, ${share(0)} % within 1 %, ${share(2)} % beyond 5 %`;
};

// From behind, above and beside the cameras, looking to where the points are: depths show.
const viewpoint = (models) => {
  const shown = models.models.find((model) => !model.failed && model.points.length);
  if (!shown) return null;
  const path = vectors(models.truth.length ? models.truth : shown.path);
  const at = middleOf(path);
  const points = middleOf(vectors(shown.points));
  const span = Math.max(points.distanceTo(at), ...path.map((point) => point.distanceTo(at))) || 1;
  const ahead = points.clone().sub(at).normalize();
  const up = new Vector3(...models.up);
  const aside = up.clone().cross(ahead).normalize();
  return {
    target: at.clone().addScaledVector(ahead, 0.75 * span),
    position: at.clone().addScaledVector(ahead, -0.35 * span).addScaledVector(aside, 0.75 * span).addScaledVector(up, 0.7 * span),
    up,
    span,
  };
};

const makeView = (holder, model, truth, from) => {
  let renderer;
  try {
    renderer = new WebGLRenderer({antialias: true, alpha: true, preserveDrawingBuffer: true});
  } catch (error) {
    holder.append(el('p', {}, 'This browser has no WebGL for the 3-D view.'));
    return;
  }
  const scene = new Scene();
  const camera = new PerspectiveCamera(50, 4 / 3, from.span / 100, from.span * 100);
  camera.up.copy(from.up);
  camera.position.copy(from.position);
  const controls = new OrbitControls(camera, renderer.domElement);
  controls.target.copy(from.target);
  controls.update();
  const color = colors.get(model.tracker);
  const cloud = geometry(model.points);
  const shades = [...ERROR_COLORS.map(([shade]) => new Color(shade)), new Color(color)];
  cloud.setAttribute('color', new BufferAttribute(new Float32Array(model.error_classes.flatMap((i) => shades[i].toArray())), 3));
  scene.add(new Points(cloud, new PointsMaterial({vertexColors: true, size: 3 * devicePixelRatio, sizeAttenuation: false})));
  scene.add(new Line(geometry(model.path), new LineBasicMaterial({color})));
  const pathPoints = new Points(geometry(model.path), new PointsMaterial({color, size: 4 * devicePixelRatio, sizeAttenuation: false}));
  scene.add(pathPoints);
  const truthMaterial = new LineDashedMaterial({dashSize: from.span / 60, gapSize: from.span / 90});
  if (truth.length) {
    const line = new Line(geometry(truth), truthMaterial);
    line.computeLineDistances();
    scene.add(line);
  }
  holder.append(renderer.domElement);
  const view = {camera, controls, render: () => renderer.render(scene, camera)};
  view.fit = () => {
    truthMaterial.color = new Color(css('--true-path'));
    const width = holder.clientWidth;
    const height = holder.clientHeight;
    renderer.setPixelRatio(devicePixelRatio);
    renderer.setSize(width, height);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    view.render();
  };
  controls.addEventListener('change', () => {
    view.render();
    for (const other of views) {  // look at both from the same place
      if (other === view) continue;
      other.camera.position.copy(camera.position);
      other.camera.quaternion.copy(camera.quaternion);
      other.controls.target.copy(controls.target);
      other.render();
    }
  });
  views.push(view);
  themed.push(view.fit);
};

if (data.models && data.models.models.length) {
  const {sequence, level, seed, backend, truth, models} = data.models;
  const from = viewpoint(data.models);
  const boxes = models.map((model) => {
    const holder = el('div', {class: 'view'});
    return [el('figure', {}, holder, el('figcaption', {}, el('b', {}, model.tracker),
      model.failed ? ': no reconstruction' : `: ${model.path.length / 3} cameras, ${model.points.length / 3} points shown${shares(model)}`)), holder, model];
  });
  section('The reconstructions in 3-D',
    el('p', {}, `Clip ${sequence}, ${level}, ${backend}: ${list(models.map((model) => model.tracker))}; seed ${seed}, the first for which each has a reconstruction, if any. Drag to turn, scroll or pinch to come nearer; both views turn together.`),
    el('div', {class: 'key'},
      models.some((model) => model.error_classes && model.error_classes.some((i) => i < 3))
        ? [el('span', {}, 'point:'), ...ERROR_COLORS.map(([shade, text]) => el('span', {}, el('i', {class: 'dot', style: `background:${shade}`}), text))] : null,
      models.map((model) => el('span', {}, el('i', {style: `color:${colors.get(model.tracker)}`}), `cameras of ${model.tracker}`)),
      truth.length ? el('span', {}, el('i', {class: 'dashed', style: 'color:var(--true-path)'}), 'true path of the camera') : null),
    el('div', {class: 'pair'}, boxes.map(([box]) => box)));
  for (const [, holder, model] of boxes) {
    if (model.failed || !from) holder.append(el('p', {}, `${model.tracker} has no reconstruction of this clip`));
    else makeView(holder, model, truth, from);
  }
}

// ---- calibration ----

const calibrationPlot = (holder, entry) => {
  const bins = entry.histogram.length;
  const width = 2 * entry.sigmas / bins;
  const xs = entry.histogram.map((_, i) => -entry.sigmas + (i + 0.5) * width);
  const density = entry.histogram.map((count) => count / (entry.numbers * width));
  const normal = xs.map((x) => Math.exp(-x * x / 2) / Math.sqrt(2 * Math.PI));
  const ink = css('--soft');
  const grid = {stroke: css('--line'), width: 1};
  const color = colors.get(entry.tracker);
  new uPlot({
    width: Math.max(240, holder.clientWidth), height: 210,
    cursor: {show: false}, legend: {show: false},
    scales: {x: {time: false}, y: {range: (u, min, max) => [0, Math.max(0.45, max * 1.05)]}},
    axes: [{stroke: ink, grid, ticks: grid}, {stroke: ink, grid, ticks: grid}],
    series: [{}, {stroke: color, fill: color + '44', width: 1, paths: uPlot.paths.bars({size: [1, 100]}), points: {show: false}},
      {stroke: css('--ink'), width: 2, dash: [6, 4], points: {show: false}}],
  }, [xs, density, normal], holder);
};

if (data.calibration?.length) {
  const entries = data.calibration.filter((entry) => entry.tracker === cohort);
  const shown = entries.length ? entries : data.calibration;
  const holders = shown.map((entry) => {
    const holder = el('div', {class: 'plot'});
    return [el('figure', {}, el('h3', {}, `${entry.tracker}, ${entry.level}`), holder,
      el('figcaption', {}, `median squared error ${digits(entry.nees_ratio)} times what the covariances say (1 is right); ${entry.numbers} numbers`)), holder, entry];
  });
  section('Does the tracker know how wrong it is?',
    el('p', {}, 'Each measured position comes with a covariance. Errors against the truth, less the median error of their track (which says which point it follows, not how well), divided by what it says (whitened), should be standard normal: the dashed curve. Wider bars: the tracker is too sure of itself.'),
    el('div', {class: 'gallery'}, holders.map(([box]) => box)));
  themed.push(() => {
    for (const [, holder, entry] of holders) {
      holder.replaceChildren();
      calibrationPlot(holder, entry);
    }
  });
}

// ---- every cell ----

{
  const columns = [  // metric, title, factor, whether it is an error: infinite where a seed failed
    ['ate', 'ATE [mm]', 1000, true], ['ate_to_undegraded', 'to the undegraded [mm]', 1000, true], ['halves_disagreement', 'halves [%]', 100], ['halves_frames', 'in both [%]', 100], ['rpe_rot', 'rotation [deg]', 1, true], ['point_error_median', 'point error [mm]', 1000, true],
    ['points', 'points', 1], ['mean_reprojection', 'reprojection [px]', 1, true], ['mean_track_length', 'length [frames]', 1],
    ['observed_error_median', 'track error [px]', 1], ['nees_ratio', 'NEES', 1],
  ].filter(([metric]) => [...values.keys()].some((name) => name.endsWith(key('', metric))));
  const lines = [];
  const notAvailable = new Set(data.not_available.map(([sequence, level, tracker, backend]) => key(sequence, level, tracker, backend)));
  for (const sequence of data.sequences) {
    for (const level of byDarkness) {
      for (const backend of data.backends) {
        for (const tracker of data.trackers) {
          const cell = [sequence.name, level.name, tracker, backend];
          if (!runs(...cell) && !notAvailable.has(key(...cell))) continue;
          const number = (metric) => {
            const own = valuesOf(...cell, metric);
            return own.length ? own : valuesOf(sequence.name, level.name, tracker, '', metric);
          };
          const failed = failures(...cell);
          const count = (metric) => quantile(valuesOf(...cell, metric), 0.5);
          const registered = notAvailable.has(key(...cell)) ? 'not available'
            : `${failed ? `FAILED ${failed} of ${runs(...cell)}; ` : ''}${digits(count('registered'))}/${digits(count('frames'))}`;
          lines.push(el('tr', {class: tracker === cohort ? 'is-cohort' : ''},
            cell.map((name) => el('td', {class: 'name'}, name)),
            el('td', {class: failed ? 'lose' : ''}, registered),
            columns.map(([metric, , factor, isError]) => {
              const found = number(metric);
              const median = quantile(isError && found.length ? [...found, ...Array(failed).fill(Infinity)] : found, 0.5);
              const td = el('td', {}, digits(median === null ? null : median * factor));
              if (median !== null) { td.dataset.metric = metric; td.dataset.value = String(median); }
              if (found.length > 1) td.append(el('small', {}, `${digits(Math.min(...found) * factor)} to ${digits(Math.max(...found) * factor)}`));
              return td;
            })));
        }
      }
    }
  }
  section('Every figure',
    el('p', {}, data.seeds.length > 1 ? 'Medians over the seeds, in which the errors of one that failed are infinite, and the range of the others.' : 'One seed.', ' The same, unrounded and for each seed, is in results.csv.'),
    el('div', {class: 'scroll'}, el('table', {id: 'cells'},
      el('thead', {}, el('tr', {}, ['clip', 'darkness', 'tracker', 'reconstruction'].map((name) => el('th', {class: 'name'}, name)), el('th', {}, 'registered'),
        columns.map(([, title]) => el('th', {}, title)))),
      el('tbody', {}, lines))));
}

// ---- failures ----

const noteList = (notes) => el('ul', {}, notes.map(([sequence, level, tracker, backend, seed, reason]) =>
  el('li', {}, el('b', {}, `${sequence}, ${level}, ${tracker}, ${backend || 'tracking'}, seed ${seed}`), `: ${reason}`)));
section('Failures',
  data.failures.length
    ? [el('p', {}, `${plural(data.failures.length, 'run')} failed:`), noteList(data.failures)]
    : el('p', {}, 'No run failed.'),
  data.not_available.length
    ? [el('p', {}, 'Not available, and no failure of a tracker:'), noteList(data.not_available)]
    : null);

// ---- words ----

section('What was run, and what the words mean',
  el('p', {}, `${data.program}; clips: ${list(data.sequences.map((sequence) => sequence.name))}${data.frames ? ` (frames ${data.frames})` : ''}; ${data.features} features alive at a time; seeds ${list(data.seeds)}.`),
  el('dl', {},
    data.trackers.flatMap((tracker) => {
      const about = ABOUT_TRACKERS.find(([pattern]) => pattern.test(tracker));
      return [el('dt', {}, tracker), el('dd', {}, about ? about[1] : 'a tracker with its own options')];
    }),
    data.backends.flatMap((backend) => [el('dt', {}, backend), el('dd', {}, ABOUT_BACKENDS[backend] || '')]),
    [['camera error (ATE)', 'root mean square distance of the camera centres from the true ones, after the best similarity alignment (a video tells no absolute scale)'],
      ['to the undegraded', 'real clips: the camera error against the reconstruction that the last plain KLT made of the undegraded frames, because their recorded truth is often worse than that'],
      ['halves', 'clips without true cameras: every other feature is reconstructed by itself, and so are those left out; root mean square distance between the two camera paths after the best similarity alignment, as a share of the path\u2019s own extent (0\u00a0% is the same path, 100\u00a0% has nothing in common). Halves that failed are infinitely far apart. An error that both halves share is not seen'],
      ['in both', 'frames that both halves gave a camera'],
      ['point error', 'median distance of the reconstructed points from the true surface, after that same alignment'],
      ['registered', 'frames that got a camera; below 80 % the reconstruction counts as failed'],
      ['track length', 'in how many frames the picture confirmed a feature, on average'],
      ['track error', 'median distance of confirmed positions from where the surface point truly is'],
      ['NEES', 'median squared error over what the tracker\u2019s covariances say; 1 is right'],
      ['seed', 'another draw of the noise, and of COLMAP\u2019s random numbers'],
    ].flatMap(([term, text]) => [el('dt', {}, term), el('dd', {}, text)])));

const drawAll = () => { for (const draw of themed) draw(); };
drawAll();
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', drawAll);
let width = innerWidth;
addEventListener('resize', () => {
  if (innerWidth === width) return;  // a phone's address bar changes the height alone
  width = innerWidth;
  drawAll();
});
document.body.dataset.ready = 'true';
