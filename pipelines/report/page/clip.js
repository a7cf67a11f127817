import {OrbitControls} from 'three/examples/jsm/controls/OrbitControls.js';
import {
  BufferAttribute, BufferGeometry, Color, InstancedMesh, Line, LineBasicMaterial, LineSegments, Matrix4,
  MeshBasicMaterial, PerspectiveCamera, Points, PointsMaterial, Raycaster, Scene, SphereGeometry, Vector2, Vector3,
  WebGLRenderer,
} from 'three';
import uPlot from 'uplot';

const data = JSON.parse(document.getElementById('data').textContent);
const page = document.getElementById('page');

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
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const box = (id, text, mark) => {
  const input = el('input', {type: 'checkbox', id});
  input.checked = true;
  return [input, el('label', {for: id}, input, mark, text)];
};

// ---- words first ----

const theme = el('button', {id: 'theme', type: 'button', title: 'light or dark'}, 'Light / dark');
page.append(
  el('header', {}, el('h1', {}, data.title), theme),
  el('div', {class: 'facts'}, data.facts.map(([name, value]) =>
    el('div', {class: 'fact'}, el('b', {}, value), el('span', {class: 'soft'}, name)))));
if (data.sentences.length) {
  page.append(el('section', {}, el('h2', {}, 'What to know'),
    el('ul', {class: 'words'}, data.sentences.map((sentence) => el('li', {}, sentence)))));
}
const pair = el('div', {class: 'pair'});
page.append(pair);
const redraws = [];  // when the theme or the size changes
const frames = data.per_frame.frame;  // all, also those that are not shown

// ---- the clip, with its tracks ----

const player = el('canvas', {id: 'player'});
const slider = el('input', {type: 'range', id: 'slider', min: 0, max: data.frames.length - 1, value: 0,
  'aria-label': 'frame'});
const play = el('button', {id: 'play', type: 'button'}, 'Play');
const frameText = el('span', {id: 'frame', class: 'soft'});
const [observedBox, observedLabel] = box('observed', 'observed', el('i', {class: 'dot', style: 'background:var(--observed)'}));
const [predictedBox, predictedLabel] =
  box('predicted', 'predicted', el('i', {class: 'ring', style: 'border-color:var(--predicted)'}));
const [tailsBox, tailsLabel] = box('tails', 'tails');

// Of every frame: track -> [x, y, observed].
const positions = data.frames.map(({positions: flat}) => {
  const frame = new Map();
  for (let i = 0; i + 3 < flat.length; i += 4) {
    frame.set(flat[i], [flat[i + 1] / data.units_per_px, flat[i + 2] / data.units_per_px, flat[i + 3] === 1]);
  }
  return frame;
});
const pictures = data.frames.map(({picture}) => {
  const image = new Image();
  image.src = picture;
  return image;
});
let current = 0;
let markCamera = () => {};
let markPlots = () => {};

const drawFrame = () => {
  const image = pictures[current];
  if (!image || !image.naturalWidth) return;
  const zoom = 2;  // marks are finer than the picture
  player.width = image.naturalWidth * zoom;
  player.height = image.naturalHeight * zoom;
  const context = player.getContext('2d');
  context.scale(zoom, zoom);
  context.drawImage(image, 0, 0);
  context.lineWidth = 0.8;
  for (const [track, [x, y, observed]] of positions[current]) {
    if (!(observed ? observedBox : predictedBox).checked) continue;
    const color = css(observed ? '--observed' : '--predicted');
    context.strokeStyle = color;
    context.fillStyle = color;
    if (tailsBox.checked) {
      context.beginPath();
      context.moveTo(x, y);
      for (let i = current - 1; i >= Math.max(0, current - 8); --i) {
        const before = positions[i].get(track);
        if (!before) break;
        context.lineTo(before[0], before[1]);
      }
      context.stroke();
    }
    context.beginPath();
    context.arc(x, y, observed ? 1.6 : 2.2, 0, 2 * Math.PI);
    if (observed) context.fill();
    else context.stroke();
  }
  const {frame} = data.frames[current];
  const observed = data.per_frame.observed[frames.indexOf(frame)];
  const predicted = data.per_frame.predicted[frames.indexOf(frame)];
  const drawn = positions[current].size;
  frameText.textContent = `frame ${frame}: ${observed} observed, ${predicted} predicted` +
    (drawn < observed + predicted ? `, ${drawn} of them drawn` : '');
};
const show = (i) => {
  current = Math.max(0, Math.min(data.frames.length - 1, i));
  slider.value = current;
  drawFrame();
  markCamera();
  markPlots();
};
let timer = null;
const stop = () => {
  clearInterval(timer);
  timer = null;
  play.textContent = 'Play';
};
play.addEventListener('click', () => {
  if (timer !== null) {
    stop();
    return;
  }
  play.textContent = 'Pause';
  timer = setInterval(() => show((current + 1) % data.frames.length), 80);
});
slider.addEventListener('input', () => {
  stop();
  show(Number(slider.value));
});
for (const input of [observedBox, predictedBox, tailsBox]) input.addEventListener('change', drawFrame);
pair.append(el('section', {}, el('h2', {}, 'The clip'), player,
  el('div', {class: 'bar'}, play, slider), el('div', {class: 'bar'}, observedLabel, predictedLabel, tailsLabel),
  el('p', {}, frameText),
  el('p', {class: 'soft', id: 'thinned'}, [
    frames.length > data.frames.length ? `${data.frames.length} of ${frames.length} frames, so that the page stays small.` : null,
    data.tracks.all > data.tracks.shown ? `${data.tracks.shown} of ${data.tracks.all} tracks, the longest.` : `All ${data.tracks.all} tracks.`,
    'Brightened for the eye.'].filter((text) => text).join(' '))));
for (const image of pictures) image.addEventListener('load', () => { if (image === pictures[current]) drawFrame(); });
redraws.push(drawFrame);

// ---- the model ----

const median = (values) => [...values].sort((a, b) => a - b)[values.length >> 1] || 0;
const vectors = (flat) => {
  const result = [];
  for (let i = 0; i + 2 < flat.length; i += 3) result.push(new Vector3(flat[i], flat[i + 1], flat[i + 2]));
  return result;
};
const middleOf = (list) => new Vector3(...['x', 'y', 'z'].map((axis) => median(list.map((v) => v[axis]))));
const geometry = (list) => new BufferGeometry().setFromPoints(list);

// Eigenvectors and values of a symmetric 3x3 matrix by Jacobi's rotations: the axes of its ellipsoid.
const axesOf = ([xx, xy, xz, yy, yz, zz]) => {
  const a = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
  const v = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  for (let sweep = 0; sweep < 12; ++sweep) {
    for (const [p, q] of [[0, 1], [0, 2], [1, 2]]) {
      if (a[p][q] === 0) continue;
      const angle = 0.5 * Math.atan2(2 * a[p][q], a[q][q] - a[p][p]);
      const c = Math.cos(angle);
      const s = Math.sin(angle);
      for (let k = 0; k < 3; ++k) [a[k][p], a[k][q]] = [c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]];
      for (let k = 0; k < 3; ++k) [a[p][k], a[q][k]] = [c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]];
      for (let k = 0; k < 3; ++k) [v[k][p], v[k][q]] = [c * v[k][p] - s * v[k][q], s * v[k][p] + c * v[k][q]];
    }
  }
  return [0, 1, 2].map((i) => new Vector3(v[0][i], v[1][i], v[2][i]).multiplyScalar(Math.sqrt(Math.max(a[i][i], 0))));
};

// Spheres stretched to the deviations, `factor` times as large.
const ellipsoids = (list, factor, material) => {
  const mesh = new InstancedMesh(new SphereGeometry(1, 10, 8), material, list.length);
  list.forEach(({at, covariance}, i) => {
    const [x, y, z] = axesOf(covariance).map((axis) => axis.multiplyScalar(factor));
    mesh.setMatrixAt(i, new Matrix4().makeBasis(x, y, z).setPosition(at));
  });
  return mesh;
};

const modelSection = () => {
  const holder = el('div', {class: 'view', id: 'view'});
  const reset = el('button', {id: 'reset', type: 'button'}, 'Reset view');
  const [pointsBox, pointsLabel] = box('points', 'points');
  const [camerasBox, camerasLabel] = box('cameras', 'cameras');
  const [sigmaBox, sigmaLabel] = box('uncertainty', 'uncertainty');
  sigmaBox.checked = false;
  const note = el('p', {class: 'soft', id: 'note'});
  const section = el('section', {}, el('h2', {}, 'The model'), holder,
    el('div', {class: 'bar'}, reset, pointsLabel, camerasLabel, sigmaLabel), note);
  pair.append(section);
  const sayInstead = (text) => section.replaceChildren(el('h2', {}, 'The model'), el('p', {}, text));

  const centers = data.cameras.map((camera) => new Vector3(...camera.center));
  const points = vectors(data.points.xyz);
  if (!centers.length) {
    sayInstead('There is no model of this clip.');
    return;
  }
  let renderer;
  try {
    renderer = new WebGLRenderer({antialias: true, alpha: true, preserveDrawingBuffer: true});
  } catch (error) {
    sayInstead('This browser has no WebGL for the 3-D view.');
    return;
  }
  const at = middleOf(centers);
  const target = points.length ? middleOf(points) : at;
  // Of nearly all cameras: one far away would leave the others a dot.
  const distances = centers.map((center) => center.distanceTo(at)).sort((a, b) => a - b);
  const span = Math.max(target.distanceTo(at), distances[Math.ceil(0.95 * (distances.length - 1))]) || 1;
  // Up is the cameras' own: against the direction from their upper to their lower corners.
  const up = new Vector3();
  for (const {corners} of data.cameras) {
    const [a, , , d] = vectors(corners);
    up.add(a).sub(d);
  }
  if (up.length() === 0) up.set(0, -1, 0);
  up.normalize();

  const scene = new Scene();
  const eye = new PerspectiveCamera(50, 4 / 3, span / 200, span * 200);
  eye.up.copy(up);
  const controls = new OrbitControls(eye, renderer.domElement);
  const toStart = () => {
    const ahead = target.clone().sub(at).normalize();
    const aside = new Vector3().crossVectors(up, ahead).normalize();
    eye.position.copy(at).addScaledVector(ahead, -0.6 * span).addScaledVector(aside, 0.6 * span).addScaledVector(up, 0.6 * span);
    controls.target.copy(at).lerp(target, 0.6);
    controls.update();
  };
  const cloud = geometry(points);
  // A dark clip's colours as bright as others', and no point as dark or bright as the page; one whose
  // colour no frame shown has is grey.
  const coloured = data.points.rgb.filter((value) => value !== null).sort((a, b) => a - b);
  const brightest = coloured[Math.floor(0.95 * coloured.length)] || 1;
  cloud.setAttribute('color', new BufferAttribute(new Float32Array(data.points.rgb.map((value) =>
    new Color().setRGB(value === null ? 0.5 : 0.25 + 0.55 * Math.min(1, value / brightest), 0, 0, 'srgb').r)), 3));
  const pointCloud = new Points(cloud, new PointsMaterial({vertexColors: true, size: 3 * devicePixelRatio, sizeAttenuation: false}));
  scene.add(pointCloud);

  // Frusta, of at most some hundred cameras, and the path.
  const size = 0.06 * span;
  const lineMaterial = new LineBasicMaterial();
  const every = Math.ceil(data.cameras.length / 100);
  const edges = [];
  data.cameras.forEach((camera, i) => {
    if (i % every) return;
    const corners = vectors(camera.corners).map((corner) => corner.multiplyScalar(size).add(centers[i]));
    corners.forEach((corner, k) => edges.push(centers[i], corner, corner, corners[(k + 1) % 4]));
  });
  const frusta = new LineSegments(geometry(edges), lineMaterial);
  const path = new Line(geometry(centers), lineMaterial);
  scene.add(frusta, path);
  const now = new LineSegments(new BufferGeometry(), new LineBasicMaterial());
  scene.add(now);

  // Deviations as they are would be too small to see.
  const known = ({covariance}) => covariance;
  const surePoints = data.points.covariances.map((covariance, i) => ({at: points[i], covariance})).filter(known);
  const pointsShown = surePoints.filter((_, i) => i % Math.ceil(surePoints.length / 4000) === 0);
  const shown = [...pointsShown, ...data.cameras.map((camera, i) => ({at: centers[i], covariance: camera.covariance})).filter(known)];
  let blobs = null;
  let factor = 1;
  if (shown.length) {
    const deviation = median(shown.map(({covariance: [xx, , , yy, , zz]}) => Math.sqrt((xx + yy + zz) / 3)));
    factor = deviation > 0 ? Math.max(1, 10 ** Math.floor(Math.log10(0.02 * span / deviation))) : 1;
    blobs = ellipsoids(shown, factor, new MeshBasicMaterial({transparent: true, opacity: 0.35, depthWrite: false}));
    blobs.visible = false;
    scene.add(blobs);
  } else {
    sigmaBox.disabled = true;
  }
  const outOf = (some, all) => (some < all ? `${some} of ${all}` : `${all}`);
  note.textContent = [
    `${outOf(points.length, data.points_in_all)} points, ${centers.length} cameras${every > 1 ? `, one in ${every} drawn` : ''}.`,
    'Drag to turn, scroll or pinch to come nearer, click a camera for its frame.',
    shown.length ? `Uncertainty: standard deviations of ${outOf(pointsShown.length, surePoints.length)} points and the cameras` +
      `${factor > 1 ? `, drawn ${factor} times as large` : ''}.` : 'Its uncertainty is not known.'].join(' ');

  holder.append(renderer.domElement);
  const render = () => renderer.render(scene, eye);
  controls.addEventListener('change', render);
  const fit = () => {
    lineMaterial.color = new Color(css('--soft'));
    now.material.color = new Color(css('--accent'));
    if (blobs) blobs.material.color = new Color(css('--observed'));
    renderer.setPixelRatio(devicePixelRatio);
    renderer.setSize(holder.clientWidth, holder.clientHeight);
    eye.aspect = holder.clientWidth / holder.clientHeight;
    eye.updateProjectionMatrix();
    render();
  };
  redraws.push(fit);
  reset.addEventListener('click', () => {
    toStart();
    render();
  });
  for (const [input, things] of [[pointsBox, [pointCloud]], [camerasBox, [frusta, path, now]], [sigmaBox, blobs ? [blobs] : []]]) {
    input.addEventListener('change', () => {
      for (const thing of things) thing.visible = input.checked;
      render();
    });
  }
  const cameraOfFrame = new Map(data.cameras.map((camera, i) => [camera.frame, i]));
  markCamera = () => {
    const i = cameraOfFrame.get(data.frames[current].frame);
    const list = [];
    if (i !== undefined) {
      const corners = vectors(data.cameras[i].corners).map((corner) => corner.multiplyScalar(2 * size).add(centers[i]));
      corners.forEach((corner, k) => list.push(centers[i], corner, corner, corners[(k + 1) % 4]));
    }
    now.geometry.dispose();
    now.geometry = geometry(list);
    render();
  };
  // The camera nearest to a click, if one is near: its frame, or the shown one before it.
  const picker = new Raycaster();
  let pressed = null;
  renderer.domElement.addEventListener('pointerdown', (event) => { pressed = [event.clientX, event.clientY]; });
  renderer.domElement.addEventListener('click', (event) => {
    if (pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 5) return;
    const area = renderer.domElement.getBoundingClientRect();
    picker.setFromCamera(new Vector2(2 * (event.clientX - area.left) / area.width - 1, 1 - 2 * (event.clientY - area.top) / area.height), eye);
    let nearest = null;
    let least = 0.05;
    centers.forEach((center, i) => {
      const distance = Math.sqrt(picker.ray.distanceSqToPoint(center)) / Math.max(eye.position.distanceTo(center), 1e-9);
      if (distance < least) [least, nearest] = [distance, i];
    });
    if (nearest === null) return;
    stop();
    const frame = data.cameras[nearest].frame;
    show(data.frames.findLastIndex((candidate) => candidate.frame <= frame));
  });
  toStart();
};
modelSection();

// ---- frame by frame ----

const {observed: observedCounts, predicted: predictedCounts, motion_px: motion, way_percent: way, residual_px: residual} = data.per_frame;
const perFrame = [
  {id: 'features', title: 'Features', lines: [[observedCounts, 'observed', '--observed'], [predictedCounts, 'predicted', '--predicted']],
    note: 'Observed: the picture confirms them. Predicted: held by the other features.'},
  {id: 'motion', title: 'Motion of the picture', lines: [[motion, 'px', '--observed']],
    note: 'How far the features moved since the frame before, median.'},
  {id: 'way', title: 'Way of the camera', lines: [[way, '% of the distance to the scene', '--observed']],
    note: 'Since the frame before. Gaps: frames without a pose.'},
  {id: 'residual', title: 'What the model leaves', lines: [[residual, 'px', '--observed']],
    note: 'How far the features are from where the model puts them, median.'},
].filter(({lines: [[values]]}) => values.some((value) => value !== null));
const plots = [];  // with what marks the frame shown
markPlots = () => {
  const {frame} = data.frames[current];
  const i = frames.indexOf(frame);
  for (const {plot, mark, texts, lines} of plots) {
    mark.style.left = `${plot.valToPos(frame, 'x')}px`;
    texts.forEach((text, k) => {
      const value = lines[k][0][i];
      text.textContent = `${value === null ? '\u2013' : +value.toPrecision(3)} ${lines[k][1]}`;
    });
  }
};
const wholeSteps = [0, 1, 2, 3, 4, 5, 6].flatMap((power) => [1, 2, 5].map((digit) => digit * 10 ** power));
const roomForLabels = (plot, labels) => Math.max(46, 18 + 7 * Math.max(0, ...(labels ?? []).map((label) => label.length)));
page.append(el('section', {}, el('h2', {}, 'Frame by frame'),
  el('p', {class: 'soft'}, 'The upright line is the frame shown above, the figures are its own. Click for another frame.'),
  el('div', {class: 'plots'}, perFrame.map(({id, title, note, lines}) => {
    const holder = el('div', {class: 'plot', id});
    const texts = lines.map(() => el('span', {}));
    const key = lines.map(([, , color], k) => el('span', {}, lines.length > 1
      ? el('i', {class: 'line', style: `border-color:var(${color});border-top-style:${k ? 'dashed' : 'solid'}`}) : null, texts[k]));
    let shown = null;
    redraws.push(() => {
      if (shown) {
        shown.plot.destroy();
        plots.splice(plots.indexOf(shown), 1);
      }
      const axis = {stroke: css('--soft'), grid: {stroke: css('--line'), width: 1}, ticks: {stroke: css('--line'), width: 1}};
      const plot = new uPlot({
        width: holder.clientWidth,
        height: 150,
        legend: {show: false},
        cursor: {drag: {x: false, y: false, click: () => {}}, sync: {key: 'frames'}, y: false},
        scales: {x: {time: false}, y: {range: (u, min, max) => [0, 1.05 * max || 1]}},
        axes: [{...axis, size: 30, incrs: wholeSteps}, {...axis, size: roomForLabels}],
        series: [{}, ...lines.map(([, , color], k) => ({stroke: css(color), width: 2, dash: k ? [6, 4] : undefined}))],
        hooks: {draw: [() => markPlots()]},
      }, [frames, ...lines.map(([values]) => values)], holder);
      const mark = el('div', {class: 'mark'});
      plot.over.append(mark);
      shown = {plot, mark, texts, lines};
      plots.push(shown);
      plot.over.addEventListener('click', () => {
        const frame = frames[plot.cursor.idx];
        if (frame === undefined) return;
        stop();
        show(data.frames.findLastIndex((candidate) => candidate.frame <= frame));
      });
    });
    return el('div', {}, el('div', {class: 'over'}, el('h3', {}, title), el('span', {class: 'soft key'}, key)), holder, el('p', {class: 'soft'}, note));
  }))));
page.append(el('p', {class: 'soft'}, `Written by ${data.program}.`));

// ---- theme and size ----

const redraw = () => { for (const draw of redraws) draw(); };
theme.addEventListener('click', () => {
  const dark = document.documentElement.dataset.theme
    ? document.documentElement.dataset.theme === 'dark' : matchMedia('(prefers-color-scheme: dark)').matches;
  document.documentElement.dataset.theme = dark ? 'light' : 'dark';
  redraw();
});
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', redraw);
let resized = null;
addEventListener('resize', () => {
  clearTimeout(resized);
  resized = setTimeout(redraw, 100);
});
redraw();
show(0);
document.body.dataset.ready = 'yes';
