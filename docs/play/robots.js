// The page of robots: recorded episodes, drawn in perspective.
"use strict";

const UNIT = 1e-3, HEIGHT = 1, FOCUS = 1.4, PACE = 60;  // meters, meters, canvas sides, steps a second
const TORSO = 0;
const element = Object.fromEntries(["world", "said", "policy", "start", "time", "pause"]
  .map((id) => [id, document.getElementById(id)]));
const canvas = element.world, context = canvas.getContext("2d");
const view = { yaw: -1.1, pitch: 0.7, distance: 0 };
let film, episode, shown = 0, target = null, from = null, paused = false, isHeld = false;

for (const one of Object.values(ROBOTS)) {
  const bytes = Uint8Array.from(atob(one.pictures), (letter) => letter.charCodeAt(0));
  one.numbers = new Int16Array(bytes.buffer);
  let first = 0;
  one.firsts = one.counts.map((count) => (first += count) - count);
}

// Both ends of the axis of each part, at a time between two pictures of an episode.
function partsAt(number, time) {
  const n = film.radii.length * 6, last = film.counts[number] - 1;
  const before = Math.min(Math.floor(time), last), after = Math.min(before + 1, last);
  const begin = (film.firsts[number] + before) * n, next = (film.firsts[number] + after) * n;
  const at = (i) => {
    const [one, other] = [film.numbers[begin + i], film.numbers[next + i]];
    return UNIT * (one + (time - before) * (other - one));
  };
  return film.radii.map((_, part) => [0, 3].map((end) => [0, 1, 2].map((i) => at(6 * part + end + i))));
}

function torsoAt(number, time) {
  const [one, other] = partsAt(number, time)[TORSO];
  return one.map((value, i) => (value + other[i]) / 2);
}

// What the picture is centered on: half of the way that is left, so that the goal is in it.
function centerAt(number, time) {
  return torsoAt(number, time).map((value, i) => (value + (film.world.goal[i] ?? value)) / 2);
}

function choose() {
  film = ROBOTS[element.policy.value];
  film.ways ??= film.counts.map((count, number) =>
    Array.from({ length: count }, (_, time) => [...torsoAt(number, time).slice(0, 2), 0]));
  view.distance = 0.72 * (film.world.high[0] - film.world.low[0]);
  element.start.max = film.counts.length;
  element.start.value = 1;
  begin();
}

function begin() {
  episode = element.start.valueAsNumber - 1;
  element.time.max = film.counts[episode] - 1;
  element.time.value = 0;
  target = centerAt(episode, 0);
  const arrived = film.success[episode], n = film.success.filter(Boolean).length;
  const ending = arrived ? `at the goal after ${film.lengths[episode]} steps`
    : `not at the goal in ${film.lengths[episode]} steps`;
  element.said.textContent =
    `Start ${episode + 1} of ${film.counts.length}: ${ending}. ${n} of ${film.counts.length} arrive.`;
}

// Where a point is on the canvas, and how far away; null behind the eye.
function project([x, y, z]) {
  const [dx, dy, dz] = [x - target[0], y - target[1], z - target[2]];
  const right = dx * Math.cos(view.yaw) + dy * Math.sin(view.yaw);
  const ahead = dy * Math.cos(view.yaw) - dx * Math.sin(view.yaw);
  const depth = view.distance + ahead * Math.cos(view.pitch) - dz * Math.sin(view.pitch);
  const up = ahead * Math.sin(view.pitch) + dz * Math.cos(view.pitch);
  const scale = (FOCUS * canvas.width) / depth;
  return depth < 0.5 ? null : { x: canvas.width / 2 + right * scale, y: canvas.height / 2 - up * scale, depth, scale };
}

function path(points, isClosed = false) {
  context.beginPath();
  let pen = false;
  for (const point of points.map(project)) {
    if (point && pen) context.lineTo(point.x, point.y);
    else if (point) context.moveTo(point.x, point.y);
    pen = Boolean(point);
  }
  if (isClosed) context.closePath();
}

function stroke(points, style, width) {
  context.strokeStyle = style;
  context.lineWidth = width * (window.devicePixelRatio || 1);
  path(points);
  context.stroke();
}

function faces([left, low, width, depth]) {
  const [right, high] = [left + width, low + depth];
  const side = (a, b) => [[...a, 0], [...b, 0], [...b, HEIGHT], [...a, HEIGHT]];
  const corners = [[left, low], [right, low], [right, high], [left, high]];
  return [...corners.map((corner, i) => side(corner, corners[(i + 1) % 4])), corners.map((c) => [...c, HEIGHT])];
}

function show() {
  const side = canvas.clientWidth, ratio = window.devicePixelRatio || 1;
  if (canvas.width !== Math.round(side * ratio)) canvas.width = canvas.height = Math.round(side * ratio);
  const style = getComputedStyle(document.body), color = (name) => style.getPropertyValue(name).trim();
  context.clearRect(0, 0, canvas.width, canvas.height);
  context.lineCap = context.lineJoin = "round";
  const { low, high, walls, goal, goal_radius } = film.world;
  for (let x = low[0]; x <= high[0]; x += 2) stroke([[x, low[1], 0], [x, high[1], 0]], color("--quiet") + "55", 1);
  for (let y = low[1]; y <= high[1]; y += 2) stroke([[low[0], y, 0], [high[0], y, 0]], color("--quiet") + "55", 1);
  const around = Array.from({ length: 40 }, (_, i) => [
    goal[0] + goal_radius * Math.cos((i * Math.PI) / 20), goal[1] + goal_radius * Math.sin((i * Math.PI) / 20), 0]);
  context.fillStyle = "#16a34a66";
  path(around, true);
  context.fill();
  film.ways.forEach((way, i) => stroke(way, film.success[i] ? "#16a34a99" : "#dc262699", 1.5));
  stroke(film.ways[episode], color("--accent"), 2.5);

  const parts = partsAt(episode, element.time.valueAsNumber);
  const shapes = parts.map((ends, i) => ({ ends: ends.map(project), radius: film.radii[i], isTorso: i === TORSO }));
  const drawn = shapes.filter(({ ends }) => ends.every(Boolean))
    .map((shape) => ({ ...shape, depth: (shape.ends[0].depth + shape.ends[1].depth) / 2 }));
  for (const points of walls.flatMap(faces)) {
    const seen = points.map(project).filter(Boolean);
    if (seen.length === points.length) drawn.push({ points, depth: seen.reduce((sum, { depth }) => sum + depth, 0) / 4 });
  }
  drawn.sort((one, other) => other.depth - one.depth);
  for (const { points, ends, radius, isTorso } of drawn) {
    if (points) {
      context.fillStyle = color("--wall") + "dd";
      context.strokeStyle = color("--paper");
      context.lineWidth = ratio;
      path(points, true);
      context.fill();
    } else {
      context.strokeStyle = isTorso ? color("--ink") : color("--accent");
      context.lineWidth = radius * (ends[0].scale + ends[1].scale);
      context.beginPath();
      context.moveTo(ends[0].x, ends[0].y);
      context.lineTo(ends[1].x, ends[1].y + 1e-3);
    }
    context.stroke();
  }
}

function frame(now = performance.now()) {
  const time = element.time.valueAsNumber, last = film.counts[episode] - 1;
  const passed = Math.min(now - shown, 100) / 1000;
  shown = now;
  if (!paused && !isHeld) element.time.value = Math.min(time + (passed * PACE) / film.stride, last);
  element.time.ariaValueText = `step ${Math.round(element.time.valueAsNumber * film.stride)}`;
  const center = centerAt(episode, element.time.valueAsNumber);
  target = target.map((value, i) => value + 0.1 * (center[i] - value));
  show();
  requestAnimationFrame(frame);
}

canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId);
  from = [event.clientX, event.clientY];
});
canvas.addEventListener("pointermove", (event) => {
  if (!from) return;
  view.yaw -= (event.clientX - from[0]) / 150;
  view.pitch = Math.min(Math.max(view.pitch + (event.clientY - from[1]) / 150, 0.1), 1.5);
  from = [event.clientX, event.clientY];
});
for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { from = null; });
canvas.addEventListener("wheel", (event) => {
  view.distance = Math.min(Math.max(view.distance * Math.exp(event.deltaY / 500), 3), 60);
  event.preventDefault();
}, { passive: false });
element.policy.addEventListener("change", choose);
element.start.addEventListener("input", begin);
element.time.addEventListener("pointerdown", () => { isHeld = true; });
for (const end of ["pointerup", "pointercancel"]) element.time.addEventListener(end, () => { isHeld = false; });
element.pause.addEventListener("click", () => {
  paused = !paused;
  element.pause.setAttribute("aria-pressed", paused);
});

element.policy.replaceChildren(...Object.keys(ROBOTS).map((name) => new Option(name, name)));
choose();
frame();
