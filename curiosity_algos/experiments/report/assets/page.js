// Pictures are drawn once they are seen, or before they are printed.
(() => {
  "use strict";
  const figures = JSON.parse(document.getElementById("figures").textContent);
  const plots = [...document.querySelectorAll(".plot")];
  const draw = (plot) => {
    observer.unobserve(plot);
    const { data, layout } = figures[plot.id];
    Plotly.newPlot(plot, data, layout, { displayModeBar: false, responsive: true });
  };
  const observer = new IntersectionObserver(
    (entries) => entries.forEach((entry) => entry.isIntersecting && draw(entry.target)),
    { rootMargin: "200px" },
  );
  plots.forEach((plot) => observer.observe(plot));
  // Paper is narrower than a window, and nobody scrolls it.
  const fit = (isPaper) => {
    document.body.classList.toggle("paper", isPaper);
    plots.forEach((plot) => (plot.data ? Plotly.relayout(plot, { autosize: true }) : draw(plot)));
  };
  addEventListener("beforeprint", () => fit(true));
  addEventListener("afterprint", () => fit(false));
})();
