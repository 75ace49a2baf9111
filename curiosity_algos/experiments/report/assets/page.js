// Pictures are drawn once they are seen; those below a slider show what there was until its moment.
(() => {
  "use strict";
  const figures = JSON.parse(document.getElementById("figures").textContent);
  const whole = (value) => Math.round(value).toLocaleString("en-US");
  const drawn = new Map();

  async function draw(plot) {
    const { data, layout } = figures[plot.id];
    await Plotly.newPlot(plot, data, layout, { displayModeBar: false, responsive: true });
    drawn.set(plot, plot._fullData.map(({ type, mode, meta, x, y, z }) => ({ type, mode, meta, x, y, z })));
    const player = plot.closest(".played");
    if (player !== null) show(plot, moment(player));
  }

  const observer = new IntersectionObserver(
    (entries) => {
      for (const { target } of entries.filter((entry) => entry.isIntersecting)) {
        observer.unobserve(target);
        draw(target);
      }
    },
    { rootMargin: "200px" },
  );
  document.querySelectorAll(".plot").forEach((plot) => observer.observe(plot));

  // -- sliders -------------------------------------------------------------------------------------

  function moment(player) {
    const slider = player.querySelector("input");
    return (Number(player.dataset.end) * Number(slider.value)) / Number(slider.max);
  }

  function show(plot, time) {
    (drawn.get(plot) ?? []).forEach((trace, i) => {
      const change = trace.type === "heatmap" ? cellsUntil(trace, time) : pathUntil(trace, time);
      if (change !== null) Plotly.restyle(plot, change, [i]);
    });
  }

  function cellsUntil({ z }, time) {
    return { z: [Array.from(z, (row) => Array.from(row, (first) => (first <= time ? first : null)))] };
  }

  // A path up to a step, or the place that it has come to.
  function pathUntil({ meta, mode, x, y }, step) {
    if (meta === undefined) return null;
    const n = 1 + Math.round((Math.min(step, meta.steps) / meta.steps) * (x.length - 1));
    const first = mode === "markers" ? n - 1 : 0;
    return { x: [x.slice(first, n)], y: [y.slice(first, n)] };
  }

  function makePlayer(player) {
    const [button, slider, output] = ["button", "input", "output"].map((tag) => player.querySelector(tag));
    const { end, unit } = player.dataset;
    let timer = null;
    function changed() {
      output.textContent = `${whole(moment(player))} of ${whole(end)} ${unit}`;
      slider.setAttribute("aria-valuetext", output.textContent);
      player.querySelectorAll(".plot").forEach((plot) => show(plot, moment(player)));
    }
    function stop() {
      clearInterval(timer);
      timer = null;
      button.textContent = "Play";
    }
    function step() {
      slider.value = Number(slider.value) + 2;
      changed();
      if (slider.value === slider.max) stop();
    }
    button.addEventListener("click", () => {
      if (timer !== null) return stop();
      if (slider.value === slider.max) slider.value = 0;
      button.textContent = "Pause";
      timer = setInterval(step, 80);
    });
    slider.addEventListener("input", () => {
      stop();
      changed();
    });
    changed();
  }
  document.querySelectorAll(".played").forEach(makePlayer);
})();
