// Each environment's section: its controls, and the pictures that they change.
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

// Figures of labels, one of each, whose run a select names by its seed.
function runOf(environment, figure, seed) {
  const label = Number(figure.dataset.label);
  return environment.runs.find((run) => run.label === label && run.seed === seed);
}

function showFigures(environment, figures, seed, state, text) {
  for (const figure of figures) {
    const run = runOf(environment, figure, seed);
    figure.hidden = state.hidden.has(Number(figure.dataset.label));
    figure.querySelector(".plot").hidden = run === undefined;
    figure.querySelector(".muted").textContent = run === undefined ? `No run with seed ${seed}.` : text(run);
  }
}

function mapSection(environment, all, state) {
  const [picture] = all("select.picture");
  const [seed] = all("select.map-seed");
  const figures = all(".states");
  const [player] = all(".maps .player");
  const slider = player.querySelector("input");
  const longest = environment.timesteps;
  const timesteps = () => (longest * Number(slider.value)) / Number(slider.max);
  const shownRuns = () => figures.map((figure) => runOf(environment, figure, seed.value)).filter(Boolean);
  let most = 10;
  function figureOf(run) {
    const stop = stopAt(run, timesteps());
    const trace = picture.value === "states"
      ? statesTrace(environment, run, stop, most)
      : visitedTrace(environment, run, stop, longest);
    return mapFigure(environment.plane, trace);
  }
  function caption(run) {
    const stop = stopAt(run, timesteps());
    if (stop < 0) return "Before the first generation";
    return `${run.unit} ${whole(decode(run.generations)[stop])} · ${summary(environment, run, stop, picture.value)}`;
  }
  function update() {
    showFigures(environment, figures, seed.value, state, caption);
    figures.forEach((figure) => refresh(figure.querySelector(".plot")));
  }
  function changedRuns() {
    most = mostStates(environment, shownRuns());
    const [low, high] = picture.value === "states" ? ["1 state", `${short(most)} states`] : ["0", short(longest)];
    const [title] = all(".maps .key-title");
    title.textContent = picture.value === "states" ? "Final states in a place:" : "Timesteps of the first visit:";
    all(".maps .key-low")[0].textContent = low;
    all(".maps .key-high")[0].textContent = high;
    update();
  }
  figures.forEach((figure) => {
    const plot = figure.querySelector(".plot");
    prepareMap(plot, environment.plane);
    addPanel(plot, () => figureOf(runOf(environment, figure, seed.value)));
  });
  [picture, seed].forEach((select) => select.addEventListener("change", changedRuns));
  changedRuns();
  makePlayer(player, update, () => `${short(timesteps())} of ${short(longest)} timesteps`, 12);
  return update;
}

function summary(environment, run, stop, picture) {
  if (picture === "states") return `${whole(decode(run.shown)[stop])} final states`;
  const visited = decode(run.visited).reduce((n, first) => n + (first <= stop && first !== NO_VALUE), 0);
  return `${whole(visited)} cells visited`;
}

function bonusSection(environment, all, state) {
  const figures = all(".bonus-map");
  const [seed] = all("select.bonus-seed");
  if (!figures.length) return () => {};
  const text = ({ bonus }) => `${bonus.low.toPrecision(3)} to ${(bonus.low + bonus.width).toPrecision(3)}`;
  const update = () => {
    showFigures(environment, figures, seed.value, state, text);
    figures.forEach((figure) => refresh(figure.querySelector(".plot")));
  };
  figures.forEach((figure) => {
    const plot = figure.querySelector(".plot");
    prepareMap(plot, environment.plane);
    addPanel(plot, () => bonusFigure(environment, runOf(environment, figure, seed.value)));
  });
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
