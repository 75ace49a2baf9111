// Each environment's section: its controls, and the pictures that they change.
const ALL = "all";

function makeSection(section) {
  const environment = report.environments[Number(section.dataset.index)];
  const state = { hidden: new Set(), over: "timesteps" };
  const all = (selector) => [...section.querySelectorAll(selector)];
  const updates = [curveSection(environment, all, state)];
  if (environment.plane !== null) {
    updates.push(mapSection(environment, all, state), bonusSection(environment, all, state));
    updates.push(replaySection(environment, all, state));
  }
  makeLegend(all, state, () => updates.forEach((update) => update()));
}

function makeLegend(all, state, update) {
  for (const button of all(".legend button")) {
    const label = Number(button.dataset.label);
    button.addEventListener("click", () => {
      if (!state.hidden.delete(label)) state.hidden.add(label);
      button.setAttribute("aria-pressed", String(!state.hidden.has(label)));
      update();
    });
  }
}

function curveSection(environment, all, state) {
  const plots = all(".curve .plot");
  plots.forEach((plot) => addPanel(plot, () => curveFigure(environment, plot.closest("figure").dataset.kind, state)));
  const update = () => plots.forEach(refresh);
  all("select.over").forEach((select) => {
    select.addEventListener("change", () => {
      state.over = select.value;
      update();
    });
  });
  return update;
}

// The runs of a figure's label that a select names by their seed, or all of them.
function runsOf(environment, figure, seed) {
  const label = Number(figure.dataset.label);
  return environment.runs.filter((run) => run.label === label && (seed === ALL || run.seed === seed));
}

function showFigures(environment, figures, seed, state, text) {
  for (const figure of figures) {
    const runs = runsOf(environment, figure, seed);
    const plot = figure.querySelector(".plot");
    figure.hidden = state.hidden.has(Number(figure.dataset.label));
    plot.hidden = runs.length === 0;
    figure.querySelector(".muted").textContent = runs.length ? text(runs) : `No run with seed ${seed}.`;
    refresh(plot);
  }
}

function addMaps(environment, figures, figureOf) {
  for (const figure of figures) {
    const plot = figure.querySelector(".plot");
    prepareMap(plot, environment.plane);
    addPanel(plot, () => figureOf(figure));
  }
}

function mapSection(environment, all, state) {
  const [picture, seed, player, key] = ["select.picture", "select.map-seed", ".maps .player", ".maps .key"].map(
    (selector) => all(selector)[0],
  );
  const figures = all(".states");
  const slider = player.querySelector("input");
  const longest = environment.timesteps;
  const timesteps = () => (longest * Number(slider.value)) / Number(slider.max);
  let most = 10;
  addMaps(environment, figures, (figure) => {
    const runs = runsOf(environment, figure, seed.value);
    const trace = picture.value === "states"
      ? statesTrace(environment, runs, timesteps(), most)
      : cellsTrace(environment, runs, timesteps());
    return mapFigure(environment.plane, trace);
  });
  const caption = (runs) => `${moment(runs, timesteps())} · ${summary(environment, runs, timesteps(), picture.value)}`;
  const update = () => showFigures(environment, figures, seed.value, state, caption);
  function changed() {
    const largest = figures.map((figure) =>
      countStates(environment, runsOf(environment, figure, seed.value), longest).reduce((a, b) => Math.max(a, b)),
    );
    most = Math.max(10, ...largest);
    showKey(key, picture.value, most);
    update();
  }
  [picture, seed].forEach((select) => select.addEventListener("change", changed));
  changed();
  makePlayer(player, update, () => `${short(timesteps())} of ${short(longest)} timesteps`, 12);
  return update;
}

function showKey(key, picture, most) {
  const [title, low, high] = picture === "states"
    ? ["Final states in a place:", "1", short(most)]
    : ["First episode that ended in a cell:", "at the start", "at the end of a run"];
  key.querySelector(".key-title").textContent = title;
  key.querySelector(".key-low").textContent = low;
  key.querySelector(".key-high").textContent = high;
}

function moment(runs, timesteps) {
  if (runs.length > 1) return `${runs.length} runs`;
  const [run] = runs;
  return `${run.unit} ${whole(decode(run.generations)[stopAt(run, timesteps)] ?? 0)}`;
}

function summary(environment, runs, timesteps, picture) {
  const counts = picture === "states"
    ? countStates(environment, runs, timesteps)
    : firstEnds(environment, runs, timesteps).map((end) => (end === null ? 0 : 1));
  return `${whole(counts.reduce((a, b) => a + b))} ${picture === "states" ? "final states" : "cells of final states"}`;
}

function bonusSection(environment, all, state) {
  const figures = all(".bonus-map");
  const [seed] = all("select.bonus-seed");
  if (!figures.length) return () => {};
  const text = ([{ bonus }]) => `${bonus.low.toPrecision(3)} to ${(bonus.low + bonus.width).toPrecision(3)}`;
  const update = () => showFigures(environment, figures, seed.value, state, text);
  addMaps(environment, figures, (figure) => bonusFigure(environment, runsOf(environment, figure, seed.value)[0]));
  seed.addEventListener("change", update);
  update();
  return update;
}

function replaySection(environment, all, state) {
  const [plot] = all(".replay .plot");
  if (plot === undefined) return () => {};
  const [player] = all(".replays .player");
  const slider = player.querySelector("input");
  const update = () => refresh(plot);
  prepareMap(plot, environment.plane);
  addPanel(plot, () => replayFigure(environment, Number(slider.value), state));
  makePlayer(player, update, (step) => `Step ${whole(step)} of ${whole(slider.max)}`, 15);
  return update;
}

document.querySelectorAll(".environment").forEach(makeSection);
document.getElementById("theme").addEventListener("click", () => showTheme(isDark() ? "light" : "dark"));
systemIsDark.addEventListener("change", () => showTheme(systemIsDark.matches ? "dark" : "light"));
showTheme(systemIsDark.matches ? "dark" : "light");
