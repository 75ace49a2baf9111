// The mazes' dynamics and the networks of policies that were found, as curiosity_gym/maze/dynamics.py and
// curiosity_algos/evaluation/mlp.py have them: the same arithmetic in the same order.
"use strict";

const DT = 0.1, RADIUS = 1.0, MARGIN = 1e-3, CONTACTS = 4, LARGEST_INVERSE = 1e9;
const f = Math.fround, clip = (value, bound) => Math.min(Math.max(value, -bound), bound);

class Maze {
  // layout: {width, height, start, goal, walls: [[x, y, width, height], ...]}
  // constants: {max_speed, max_acceleration, restitution, goal_radius, lidar_range, n_beams}
  constructor(layout, constants) {
    Object.assign(this, constants, layout);
    const grow = RADIUS + MARGIN;
    this.edges = layout.walls.map(([x, y, w, h]) => [x, y, x + w, y + h]);
    this.boxes = this.edges.map(([l, b, r, t]) => [l - grow, b - grow, r + grow, t + grow]);
    const inverse = (part) => {
      const tiny = (part < 0 ? -1 : 1) / LARGEST_INVERSE;
      return f(1 / (Math.abs(part) * LARGEST_INVERSE < 1 ? tiny : part));
    };
    const angles = Array.from({ length: this.n_beams }, (_, i) => (2 * Math.PI * i) / this.n_beams);
    this.inverseX = angles.map((angle) => inverse(this.lidar_range * Math.cos(angle)));
    this.inverseY = angles.map((angle) => inverse(this.lidar_range * Math.sin(angle)));
  }

  // Whether a robot may stand there: it is in no wall and in the world.
  isFree(x, y) {
    const inside = ([l, b, r, t]) => l < x && x < r && b < y && y < t;
    const isIn = RADIUS <= Math.min(x, y) && x <= this.width - RADIUS && y <= this.height - RADIUS;
    return isIn && !this.boxes.some(inside);
  }

  isAtGoal([x, y]) {
    const dx = x - this.goal[0], dy = y - this.goal[1];
    return dx * dx + dy * dy < this.goal_radius * this.goal_radius;
  }

  // One step of state [x, y, vx, vy], which is overwritten; the action is clipped to [-1, 1].
  step(state, action) {
    const limit = this.max_speed, gain = DT * this.max_acceleration;
    let [x, y, vx, vy] = state;
    vx = clip(vx + gain * clip(action[0], 1), limit);
    vy = clip(vy + gain * clip(action[1], 1), limit);
    let remaining = DT;
    for (let i = 0; i < CONTACTS; i++) {
      const [time, axis, stop] = this.firstContact(x, y, vx, vy, remaining);
      x = advance(x, vx, time, stop, axis === 0);
      y = advance(y, vy, time, stop, axis === 1);
      if (axis === -1) break;
      if (axis === 0) vx *= -this.restitution;
      else vy *= -this.restitution;
      remaining -= time;
    }
    state[0] = x; state[1] = y; state[2] = vx; state[3] = vy;
  }

  // Time, axis (0: x, 1: y, -1: none) and stopping coordinate of the next contact.
  firstContact(x, y, vx, vy, remaining) {
    let time = remaining, axis = -1, stop = 0;
    const toX = x + vx * remaining, toY = y + vy * remaining, border = RADIUS + MARGIN;
    const highX = this.width - border, highY = this.height - border;
    if ((toX > highX && vx > 0) || (toX < border && vx < 0)) {
      stop = vx > 0 ? highX : border;
      time = Math.max(0, (stop - x) / vx); axis = 0;
    }
    if ((toY > highY && vy > 0) || (toY < border && vy < 0)) {
      const wall = vy > 0 ? highY : border, t = Math.max(0, (wall - y) / vy);
      if (t < time) { time = t; axis = 1; stop = wall; }
    }
    const minX = Math.min(x, toX), maxX = Math.max(x, toX);
    const minY = Math.min(y, toY), maxY = Math.max(y, toY);
    for (const [l, b, r, t] of this.boxes) {
      if (maxX <= l || minX >= r || maxY <= b || minY >= t) continue;
      const [enterX, leaveX] = entry(x, vx, l, r), [enterY, leaveY] = entry(y, vy, b, t);
      const enter = Math.max(enterX, enterY);
      if (0 <= enter && enter < Math.min(leaveX, leaveY) && enter < time) {
        time = enter;
        if (enterX >= enterY) { axis = 0; stop = vx > 0 ? l : r; }
        else { axis = 1; stop = vy > 0 ? b : t; }
      }
    }
    return [time, axis, stop];
  }

  // Position, velocity and beams, each in [-1, 1].
  observe([x, y, vx, vy]) {
    const seen = new Float32Array(4 + this.n_beams);
    seen[0] = (2 * x) / this.width - 1;
    seen[1] = (2 * y) / this.height - 1;
    seen[2] = vx / this.max_speed;
    seen[3] = vy / this.max_speed;
    let [l, r, b, t] = [-x, this.width - x, -y, this.height - y].map(f);
    for (let i = 0; i < this.n_beams; i++) {
      const ix = this.inverseX[i], iy = this.inverseY[i];
      seen[4 + i] = Math.min(1, Math.max(f(l * ix), f(r * ix)), Math.max(f(b * iy), f(t * iy)));
    }
    for (const edge of this.edges) {
      l = f(edge[0] - x); b = f(edge[1] - y); r = f(edge[2] - x); t = f(edge[3] - y);
      for (let i = 0; i < this.n_beams; i++) {
        const alongX = f(l * this.inverseX[i]), acrossX = f(r * this.inverseX[i]);
        const alongY = f(b * this.inverseY[i]), acrossY = f(t * this.inverseY[i]);
        const enter = Math.max(Math.min(alongX, acrossX), Math.min(alongY, acrossY));
        const leave = Math.min(Math.max(alongX, acrossX), Math.max(alongY, acrossY));
        if (enter >= 0 && enter <= leave && enter < seen[4 + i]) seen[4 + i] = enter;
      }
    }
    return seen;
  }
}

// Times at which a point enters and leaves the slab ]low, high[.
function entry(position, velocity, low, high) {
  let gap, far;
  if (velocity > 0) { gap = low - position; far = high - position; }
  else if (velocity < 0) { gap = position - high; far = position - low; }
  else if (low - position < -2 * MARGIN && position - high < -2 * MARGIN) return [-Infinity, Infinity];
  else return [Infinity, -Infinity];
  if (-2 * MARGIN <= gap && gap < 0) gap = 0;
  const speed = Math.abs(velocity);
  return [gap / speed, far / speed];
}

function advance(start, velocity, time, stop, isContact) {
  if (!isContact) return start + velocity * time;
  return velocity > 0 ? Math.max(start, stop) : Math.min(start, stop);
}

// The actions of a network: layers of weights (inputs, outputs) and biases in one vector. One that was
// found has ReLU between layers and tanh at its end; one that was trained from many starts standardizes
// what it sees, has tanh between layers, and clips its actions.
function act({ sizes, weights, mean, scale, farthest }, observation) {
  const isRobust = mean !== undefined, last = sizes.length - 2;
  const between = isRobust ? Math.tanh : (value) => Math.max(value, 0);
  let source = isRobust
    ? observation.map((value, i) => clip((value - mean[i]) / scale[i], farthest)) : observation;
  for (let layer = 0, offset = 0; layer <= last; layer++) {
    const nIn = sizes[layer], nOut = sizes[layer + 1], biases = offset + nIn * nOut;
    const target = weights.slice(biases, biases + nOut);
    const product = (i, j) => f(source[i] * weights[offset + i * nOut + j]);
    for (let j = 0; j < nOut; j++) {
      let i = 0, sum = target[j];
      for (; i + 4 <= nIn; i += 4) {
        const first = f(product(i, j) + product(i + 1, j));
        sum = f(sum + f(first + f(product(i + 2, j) + product(i + 3, j))));
      }
      for (; i < nIn; i++) sum = f(sum + product(i, j));
      target[j] = layer < last ? between(sum) : sum;
    }
    source = target;
    offset = biases + nOut;
  }
  return source.map((z) => isRobust ? clip(z, 1) : f(1 - f(2 / f(f(Math.exp(f(2 * z))) + 1))));
}

if (typeof module !== "undefined") module.exports = { Maze, act };
