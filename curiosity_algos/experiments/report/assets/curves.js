// Coverage, best return and survival over timesteps or seconds.
const CURVES = {
  coverage: { title: "reachable cells with a final state", format: ".1%", ticks: "~%" },
  best_return: { title: "best return so far", format: ".3f", ticks: "~g" },
  survival: { title: "runs without reward", format: ".0%", ticks: "~%" },
};
const AXIS_TITLES = { timesteps: "timesteps", seconds: "seconds of training" };

function seedLines(curves, kind, over, color) {
  const x = [];
  const y = [];
  for (const seed of curves.seeds) {
    x.push(...decode(seed[over]), null);
    y.push(...decode(seed[kind]), null);
  }
  const line = { color: visible(color, 0.4), width: 1, shape: "hv" };
  return { x, y, line, mode: "lines", hoverinfo: "skip", connectgaps: false };
}

function band(curve, color, shape) {
  const x = Array.from(decode(curve.x));
  const edge = (name) => ({
    x, y: Array.from(decode(curve[name])), mode: "lines", hoverinfo: "skip", line: { width: 0, shape },
  });
  return [edge("low"), { ...edge("high"), fill: "tonexty", fillcolor: visible(color, 0.18) }];
}

function middle(curve, label, shape, format) {
  return {
    x: Array.from(decode(curve.x)),
    y: Array.from(decode(curve.y)),
    name: label.name,
    mode: "lines",
    line: { color: visible(label.color), width: 2.5, shape },
    hovertemplate: `%{y:${format}}`,
  };
}

function curveFigure(environment, kind, state) {
  const { title, format, ticks } = CURVES[kind];
  const shape = kind === "survival" ? "hv" : "linear";
  const data = [];
  environment.curves.forEach((curves, i) => {
    const label = environment.labels[i];
    const curve = curves[kind][state.over];
    if (state.hidden.has(i) || curve === null) return;
    if (kind !== "survival") data.push(seedLines(curves, kind, state.over, label.color));
    const hasBand = decode(curve.low).some((bound) => !Number.isNaN(bound));
    if (hasBand) data.push(...band(curve, label.color, shape));
    data.push(middle(curve, label, shape, format));
  });
  const xaxis = axis(AXIS_TITLES[state.over], { tickformat: "~s", hoverformat: ",.0f", rangemode: "tozero" });
  const yaxis = axis(title, { tickformat: ticks, rangemode: "tozero", fixedrange: true });
  if (kind === "survival") yaxis.range = [0, 1.03];
  const dragmode = matchMedia("(pointer: fine)").matches ? "zoom" : false;
  return { data, layout: { xaxis, yaxis, hovermode: "x unified", dragmode } };
}
