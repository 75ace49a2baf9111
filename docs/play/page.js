// The page: one episode that plays, and what a hundred others from starts nearby come to.
"use strict";

const { mazes, policies, archives, constants, horizon } = DATA;
for (const network of [archives, ...Object.values(policies)].flatMap(Object.values)) {
  const bytes = Uint8Array.from(atob(network.weights), (letter) => letter.charCodeAt(0));
  network.weights = new Float32Array(bytes.buffer);
}
const YOU = "You: arrow keys, or hold", ARCHIVE = "Many: choose a square";
const N_STARTS = 100, NEARBY = 1, THINNEST = 2;
const NOISE = 0.01, TURN = (5 * Math.PI) / 180;  // standard deviation, and radians at most
const STEERED = 10;  // units from the robot where the pointer steers as hard as may be
const element = Object.fromEntries(
  ["world", "said", "maze", "policy", "speed", "again", "pause", "hundred", "disturb", "draw", "clear"]
    .map((id) => [id, document.getElementById(id)]));
const canvas = element.world, context = canvas.getContext("2d");
const steering = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const pressed = new Set();
let maze, start, episode, others, drawn, elite, dragged = null, held = null, paused = false, told = 0;

function option(select, values) {
  select.replaceChildren(...values.map((value) => new Option(value, value)));
}

// Numbers in [0, 1[, the same each time (mulberry32).
function generator(seed) {
  return () => {
    seed = (seed + 0x6d2b79f5) | 0;
    let t = Math.imul(seed ^ (seed >>> 15), 1 | seed);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

function build() {
  const layout = mazes[element.maze.value];
  const range = 0.2 * Math.hypot(layout.width, layout.height);
  const walls = [...layout.walls, ...drawn];
  maze = new Maze({ ...layout, walls }, { ...constants, lidar_range: range });
}

function choose() {
  drawn = [];
  build();
  start = [...maze.start];
  elite = null;
  const before = element.policy.value, names = Object.keys(policies[element.maze.value] ?? {});
  if (archives[element.maze.value]) names.push(ARCHIVE);
  option(element.policy, [...names, YOU]);
  if ([...names, YOU].includes(before)) element.policy.value = before;
  begin();
}

function isYou() {
  return element.policy.value === YOU;
}

// The archive that a policy is chosen from, if one is.
function archive() {
  return element.policy.value === ARCHIVE ? archives[element.maze.value] : null;
}

// The policy that acts, or null.
function policy() {
  if (!archive()) return policies[element.maze.value]?.[element.policy.value] ?? null;
  if (elite === null) return null;
  const { sizes, weights } = archive(), n = weights.length / archive().squares.length;
  return { sizes, weights: weights.subarray(elite * n, (elite + 1) * n) };
}

// The policy whose episode ends in the square of the least cost.
function pick(cost) {
  const costs = archive().squares.map(cost), least = Math.min(...costs);
  if (least === Infinity) return;
  elite = costs.indexOf(least);
  start = [...maze.start];
  begin();
}

// The square next to a place.
function pickAt([x, y]) {
  const { side } = archive();
  pick(([i, j]) => Math.hypot((i + 0.5) * side - x, (j + 0.5) * side - y));
}

// The next square in a direction, rather far than aside; at first from that of the start.
function pickNext([dx, dy]) {
  const { squares, side } = archive();
  const [fromX, fromY] = squares[elite] ?? maze.start.map((part) => Math.floor(part / side));
  pick(([i, j]) => {
    const x = i - fromX, y = j - fromY, along = x * dx + y * dy;
    return along > 0 ? along + 2 * Math.abs(x * dy - y * dx) : Infinity;
  });
}

function newEpisode(place, seed) {
  const state = [...place, 0, 0], chance = generator(seed);
  return { chance, state, seen: maze.observe(state), trail: [[...place]], t: 0, arrived: false };
}

function begin() {
  episode = newEpisode(start, 0);
  others = null;
  element.hundred.disabled = !policy();
  if (paused) toggle();
  say();
}

function actionOf(seen) {
  const network = policy();
  if (network) return act(network, seen);
  if (held) return [0, 1].map((i) => (held[i] - episode.state[i]) / STEERED);
  return [...pressed].reduce(([x, y], key) => [x + steering[key][0], y + steering[key][1]], [0, 0]);
}

// As benchmarks/hold.py perturbs a maze: noise in what is seen, and actions that are turned.
function noisy(seen, chance) {
  const normal = () => Math.sqrt(-2 * Math.log(1 - chance())) * Math.cos(2 * Math.PI * chance());
  return seen.map((value) => value + NOISE * normal());
}

function turned([x, y], chance) {
  const angle = TURN * (2 * chance() - 1), [cosine, sine] = [Math.cos(angle), Math.sin(angle)];
  return [cosine * x - sine * y, sine * x + cosine * y];
}

function play(one) {
  const isDisturbed = element.disturb.checked && !isYou();
  const action = actionOf(isDisturbed ? noisy(one.seen, one.chance) : one.seen);
  maze.step(one.state, isDisturbed ? turned(action, one.chance) : action);
  one.seen = maze.observe(one.state);
  one.t++;
  if (one.t % 4 === 0) one.trail.push(one.state.slice(0, 2));
  one.arrived = maze.isAtGoal(one.state);
  one.ended = one.arrived || one.t >= horizon;
  if (one.ended) one.trail.push(one.state.slice(0, 2));
}

function say() {
  const { t, arrived, ended } = episode;
  let text = `Step ${t} of ${horizon}.`;
  if (archive() && elite === null) text = "Click a square, or use the arrow keys: a policy plays whose episode ended there.";
  if (isYou() && !t) text = "Steer with the arrow keys, or hold the pointer where the robot shall go.";
  if (arrived) text = `Arrived after ${t} steps: a return of ${(1 - t / horizon).toFixed(3)}.`;
  else if (ended) text = `Not arrived in ${horizon} steps: a return of 0.`;
  if (others) {
    const done = others.episodes.filter((each) => each.ended);
    const n = done.filter((each) => each.arrived).length;
    text += ` Of ${done.length} starts nearby ${n} arrived.`;
  }
  if (performance.now() < told) return;
  if (element.said.textContent !== text) element.said.textContent = text;
  element.said.ariaLive = ended ? "polite" : "off";
}

// Starts within a unit, where a robot may stand.
function hundred() {
  const random = generator(0), places = [];
  while (places.length < N_STARTS) {
    const x = start[0] + NEARBY * (2 * random() - 1), y = start[1] + NEARBY * (2 * random() - 1);
    if (Math.hypot(x - start[0], y - start[1]) <= NEARBY && maze.isFree(x, y)) places.push([x, y]);
  }
  others = { episodes: places.map(newEpisode), next: 0 };
}

function frame() {
  // Who steers needs time: a step a frame, and the first one with the first key.
  const isWaiting = !policy() && !episode.t && !pressed.size && !held;
  const n = paused || isWaiting ? 0 : isYou() ? 1 : element.speed.valueAsNumber;
  for (let i = 0; i < n && !episode.ended; i++) play(episode);
  for (const begun = performance.now(); others && performance.now() - begun < 12;) {
    const one = others.episodes[others.next];
    if (!one) break;
    while (!one.ended) play(one);
    others.next++;
  }
  say();
  show();
  requestAnimationFrame(frame);
}

function show() {
  const side = canvas.clientWidth, ratio = window.devicePixelRatio || 1;
  if (canvas.width !== Math.round(side * ratio)) canvas.width = canvas.height = Math.round(side * ratio);
  const scale = canvas.width / maze.width, style = getComputedStyle(document.body);
  const color = (name) => style.getPropertyValue(name).trim();
  context.setTransform(scale, 0, 0, -scale, 0, canvas.height);  // y up, as in the maze
  context.clearRect(0, 0, maze.width, maze.height);
  archive()?.squares.forEach(([i, j], k) => {
    const width = archive().side;
    context.fillStyle = color("--accent") + (k === elite ? "aa" : "33");
    context.fillRect(i * width + 0.5, j * width + 0.5, width - 1, width - 1);
  });
  context.fillStyle = color("--wall");
  for (const [x, y, w, h] of maze.walls) context.fillRect(x, y, w, h);
  if (dragged?.wall) context.fillRect(...dragged.wall);
  disc(maze.goal, 3 * maze.goal_radius, "#16a34a55");
  disc(maze.goal, maze.goal_radius, "#16a34a");
  for (const one of others?.episodes ?? []) {
    if (one.ended) line(one.trail, one.arrived ? "#16a34a" : "#dc2626", 0.4);
  }
  line([...episode.trail, episode.state], color("--accent"), 0.9);
  const [x, y] = episode.state;
  context.strokeStyle = "#f59e0b99";
  context.lineWidth = 0.3;
  context.beginPath();
  episode.seen.subarray(4).forEach((share, i) => {
    const angle = (2 * Math.PI * i) / maze.n_beams, reach = share * maze.lidar_range;
    context.moveTo(x, y);
    context.lineTo(x + reach * Math.cos(angle), y + reach * Math.sin(angle));
  });
  context.stroke();
  disc(start, 1, color("--quiet"));
  disc([x, y], 2, color("--accent"));
}

function disc([x, y], radius, fill) {
  context.fillStyle = fill;
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fill();
}

function line(points, stroke, width) {
  context.strokeStyle = stroke;
  context.lineWidth = width;
  context.beginPath();
  for (const [x, y] of points) context.lineTo(x, y);
  context.stroke();
}

function toggle() {
  paused = !paused;
  element.pause.setAttribute("aria-pressed", paused);
}

function place(event) {
  const box = canvas.getBoundingClientRect();
  const within = (share) => Math.min(Math.max(share, 0), 1);
  return [within((event.clientX - box.left) / box.width) * maze.width,
    (1 - within((event.clientY - box.top) / box.height)) * maze.height];
}

function isDrawing() {
  return element.draw.getAttribute("aria-pressed") === "true";
}

canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId);
  dragged = { from: place(event) };
  if (!isDrawing()) moveStart(event);
});
canvas.addEventListener("pointermove", (event) => {
  if (!dragged) return;
  if (!isDrawing()) return moveStart(event);
  const [x, y] = place(event), [left, bottom] = [Math.min(x, dragged.from[0]), Math.min(y, dragged.from[1])];
  dragged.wall = [left, bottom, Math.max(Math.abs(x - dragged.from[0]), THINNEST),
    Math.max(Math.abs(y - dragged.from[1]), THINNEST)];
});
for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => {
  if (dragged?.wall) {
    drawn.push(dragged.wall);
    build();
    if (maze.isFree(...start) && maze.isFree(...maze.start)) begin();
    else {
      drawn.pop();
      build();
      told = performance.now() + 3000;
      element.said.textContent = "A wall must leave the start free, and that of the maze.";
    }
  }
  dragged = held = null;
});

function moveStart(event) {
  const [x, y] = place(event);
  if (archive()) { if (event.type === "pointerdown") pickAt([x, y]); }
  else if (isYou()) held = [x, y];
  else if (maze.isFree(x, y)) { start = [x, y]; begin(); }
}

canvas.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey) return;
  if (event.key in steering && archive()) pickNext(steering[event.key]);
  else if (event.key in steering) {
    pressed.add(event.key);
    if (!isYou()) { element.policy.value = YOU; begin(); }
  } else if (event.key === " ") toggle();
  else if (event.key === "r") begin();
  else return;
  event.preventDefault();
});
canvas.addEventListener("keyup", (event) => pressed.delete(event.key));
for (const target of [canvas, window]) target.addEventListener("blur", () => pressed.clear());
element.maze.addEventListener("change", choose);
element.policy.addEventListener("change", () => {
  elite = null;
  if (archive()) start = [...maze.start];
  begin();
  if (isYou()) canvas.focus();
});
for (const again of [element.again, element.disturb]) again.addEventListener("click", begin);
element.pause.addEventListener("click", toggle);
element.hundred.addEventListener("click", hundred);
element.clear.addEventListener("click", choose);
element.draw.addEventListener("click", () => element.draw.setAttribute("aria-pressed", !isDrawing()));

option(element.maze, Object.keys(mazes));
choose();
frame();
