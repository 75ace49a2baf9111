// Heat maps over a maze or a plane of the behavior: final states, visited cells, the bonus.
function planeLayout(plane, goalLayer = "above") {
  const isMaze = plane.maze !== null;
  const side = (range, title) => ({
    ...axis(isMaze ? "" : title, { range, showgrid: !isMaze, zeroline: false, fixedrange: true }),
    ...(isMaze ? { visible: false, automargin: false } : { ticks: "outside", tickcolor: css("line") }),
  });
  const layout = {
    xaxis: side(plane.x, "first entry of the behavior"),
    yaxis: side(plane.y, "second entry of the behavior"),
    plot_bgcolor: css("floor"),
  };
  return isMaze ? { ...layout, margin: { l: 1, r: 1, t: 1, b: 1 }, shapes: mazeShapes(plane, goalLayer) } : layout;
}

function mazeShapes({ maze, x, y }, goalLayer) {
  const [gx, gy] = maze.goal;
  const r = maze.goal_radius;
  const place = { xref: "x", yref: "y" };
  return [
    {
      ...place, type: "circle", x0: gx - r, x1: gx + r, y0: gy - r, y1: gy + r,
      fillcolor: css("goal-area"), line: { color: css("goal"), width: 2 }, layer: goalLayer,
    },
    {
      ...place, type: "path", path: maze.walls, fillcolor: css("wall"), fillrule: "nonzero",
      line: { width: 0 }, layer: "above",
    },
    { ...place, type: "rect", x0: x[0], x1: x[1], y0: y[0], y1: y[1], line: { color: css("wall"), width: 2 } },
  ];
}

function startMarker(plane) {
  const [x, y] = plane.maze.start;
  const marker = { color: css("start"), size: 9, line: { color: css("card"), width: 1 } };
  return { x: [x], y: [y], mode: "markers", marker, hovertemplate: "start<extra></extra>" };
}

function prepareMap(element, plane) {
  if (plane.maze === null) return;
  element.style.aspectRatio = `${plane.x[1] - plane.x[0]} / ${plane.y[1] - plane.y[0]}`;
}

// Rows of values from a function of the flat index.
function rows(nx, ny, value) {
  return Array.from({ length: ny }, (_, j) => Array.from({ length: nx }, (_, i) => value(j * nx + i)));
}

function heatmap(plane, [nx, ny], value, text, range) {
  const width = (plane.x[1] - plane.x[0]) / nx;
  const height = (plane.y[1] - plane.y[0]) / ny;
  return {
    type: "heatmap",
    x0: plane.x[0] + width / 2, dx: width, y0: plane.y[0] + height / 2, dy: height,
    z: rows(nx, ny, value),
    customdata: rows(nx, ny, text),
    zmin: range[0], zmax: range[1],
    colorscale: colorscale(), showscale: false, hoverongaps: false,
    hovertemplate: "%{customdata}<br>at %{x:.3~g}, %{y:.3~g}<extra></extra>",
  };
}

function mapFigure(plane, trace) {
  const data = plane.maze === null ? [trace] : [trace, startMarker(plane)];
  return { data, layout: planeLayout(plane) };
}

// -- final states and visited cells ----------------------------------------------------------------

// The last stop of a run that is not after so many timesteps, or -1.
function stopAt(run, timesteps) {
  const stops = decode(run.timesteps);
  let stop = -1;
  while (stop + 1 < stops.length && stops[stop + 1] <= timesteps * 1.000001) stop += 1;
  return stop;
}

function countStates(run, stop, n) {
  const counts = new Uint32Array(n);
  const shown = stop < 0 ? 0 : decode(run.shown)[stop];
  decode(run.states).subarray(0, shown).forEach((pixel) => (counts[pixel] += 1));
  return counts;
}

function mostStates(environment, runs) {
  const n = environment.plane.pixels[0] * environment.plane.pixels[1];
  const most = runs.map((run) => countStates(run, decode(run.shown).length - 1, n).reduce((a, b) => Math.max(a, b), 1));
  return Math.max(10, ...most);
}

function statesTrace(environment, run, stop, most) {
  const [nx, ny] = environment.plane.pixels;
  const counts = countStates(run, stop, nx * ny);
  const value = (i) => (counts[i] ? Math.log10(counts[i]) : null);
  const text = (i) => `${whole(counts[i])} final ${counts[i] === 1 ? "state" : "states"}`;
  return heatmap(environment.plane, [nx, ny], value, text, [0, Math.log10(most)]);
}

function visitedTrace(environment, run, stop, timesteps) {
  const n = environment.plane.cells;
  const first = decode(run.visited);
  const stops = decode(run.timesteps);
  const generations = decode(run.generations);
  const value = (i) => (first[i] <= stop && first[i] !== NO_VALUE ? stops[first[i]] : null);
  const text = (i) => `first visited by generation ${whole(generations[first[i]] ?? 0)}`;
  return heatmap(environment.plane, [n, n], value, text, [0, timesteps]);
}

// -- the bonus -------------------------------------------------------------------------------------

function bonusFigure(environment, run) {
  const n = environment.plane.cells;
  const values = dequantize(run.bonus);
  const trace = heatmap(
    environment.plane, [n, n], (i) => values[i], (i) => `bonus ${(values[i] ?? 0).toPrecision(3)}`, run.bonus.shown,
  );
  return mapFigure(environment.plane, trace);
}
