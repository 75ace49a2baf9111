// Heat maps over a maze or a plane of the behavior: final states, their cells, the bonus.
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

// A maze is drawn to scale, another plane as a square.
function prepareMap(element, { maze, x, y }) {
  element.style.aspectRatio = maze === null ? "1" : `${x[1] - x[0]} / ${y[1] - y[0]}`;
}

// Rows of values from a function of the flat index.
function rows(nx, ny, value) {
  return Array.from({ length: ny }, (_, j) => Array.from({ length: nx }, (_, i) => value(j * nx + i)));
}

// `hover` says what a cell's value is, as a template of plotly's.
function heatmap(plane, [nx, ny], value, hover, range) {
  const width = (plane.x[1] - plane.x[0]) / nx;
  const height = (plane.y[1] - plane.y[0]) / ny;
  return {
    type: "heatmap",
    x0: plane.x[0] + width / 2, dx: width, y0: plane.y[0] + height / 2, dy: height,
    z: rows(nx, ny, value),
    zmin: range[0], zmax: range[1],
    colorscale: colorscale(), showscale: false, hoverongaps: false,
    hovertemplate: `${hover}<br>at %{x:.3~g}, %{y:.3~g}<extra></extra>`,
  };
}

function mapFigure(plane, trace) {
  const data = plane.maze === null ? [trace] : [trace, startMarker(plane)];
  return { data, layout: planeLayout(plane) };
}

// -- final states and their cells ------------------------------------------------------------------

// The last stop of a run that is not after so many timesteps, or -1.
function stopAt(run, timesteps) {
  const stops = decode(run.timesteps);
  let stop = -1;
  while (stop + 1 < stops.length && stops[stop + 1] <= timesteps * 1.000001) stop += 1;
  return stop;
}

// How many final states of runs lie in each pixel after so many timesteps.
function countStates(environment, runs, timesteps) {
  const counts = new Uint32Array(environment.plane.pixels[0] * environment.plane.pixels[1]);
  for (const run of runs) {
    const stop = stopAt(run, timesteps);
    const shown = stop < 0 ? 0 : decode(run.shown)[stop];
    decode(run.states).subarray(0, shown).forEach((pixel) => (counts[pixel] += 1));
  }
  return counts;
}

function statesTrace(environment, runs, timesteps, most) {
  const counts = countStates(environment, runs, timesteps);
  const value = (i) => (counts[i] ? Math.log10(counts[i]) : null);
  const [nx, ny] = environment.plane.pixels;
  const trace = heatmap(environment.plane, [nx, ny], value, "final states: %{customdata:,}", [0, Math.log10(most)]);
  return { ...trace, customdata: rows(nx, ny, (i) => counts[i]) };
}

// When an episode of any of the runs first ended in each cell, null where none did.
function firstEnds(environment, runs, timesteps) {
  const ends = new Array(environment.plane.cells ** 2).fill(null);
  for (const run of runs) {
    const stop = stopAt(run, timesteps);
    const stops = decode(run.timesteps);
    decode(run.ended_in).forEach((first, i) => {
      if (first !== NO_VALUE && first <= stop) ends[i] = Math.min(ends[i] ?? Infinity, stops[first]);
    });
  }
  return ends;
}

function cellsTrace(environment, runs, timesteps) {
  const n = environment.plane.cells;
  const ends = firstEnds(environment, runs, timesteps);
  const longest = Math.max(...runs.map((run) => decode(run.timesteps).at(-1)));
  const hover = "first episode that ended here: %{z:.3s} timesteps";
  return heatmap(environment.plane, [n, n], (i) => ends[i], hover, [0, longest]);
}

// -- the bonus -------------------------------------------------------------------------------------

function bonusFigure(environment, run) {
  const n = environment.plane.cells;
  const values = dequantize(run.bonus);
  const trace = heatmap(environment.plane, [n, n], (i) => values[i], "bonus: %{z:.3g}", run.bonus.shown);
  return mapFigure(environment.plane, trace);
}
