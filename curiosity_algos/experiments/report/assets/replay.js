// The paths of the best policies, drawn up to a step.
function replayFigure(environment, step, state) {
  const data = [];
  environment.replays.forEach((replay, i) => {
    if (replay === null || state.hidden.has(i)) return;
    const color = visible(environment.labels[i].color);
    const x = dequantize(replay.x);
    const y = dequantize(replay.y);
    const last = Math.round((Math.min(step, replay.steps) / Math.max(1, replay.steps)) * (x.length - 1));
    const name = environment.labels[i].name;
    const hovertemplate = `${name}<br>%{x:.3~g}, %{y:.3~g}<extra></extra>`;
    data.push({
      x: x.slice(0, last + 1), y: y.slice(0, last + 1), mode: "lines", line: { color, width: 2.5 }, hovertemplate,
    });
    const marker = { color, size: 12, line: { color: css("card"), width: 2 } };
    data.push({ x: [x[last]], y: [y[last]], mode: "markers", marker, hovertemplate });
  });
  if (environment.plane.maze !== null) data.unshift(startMarker(environment.plane));
  return { data, layout: planeLayout(environment.plane, "below") };
}
