// Pictures are drawn once they are seen.
(() => {
  "use strict";
  const figures = JSON.parse(document.getElementById("figures").textContent);
  const observer = new IntersectionObserver(
    (entries) => {
      for (const { target } of entries.filter((entry) => entry.isIntersecting)) {
        observer.unobserve(target);
        const { data, layout } = figures[target.id];
        Plotly.newPlot(target, data, layout, { displayModeBar: false, responsive: true });
      }
    },
    { rootMargin: "200px" },
  );
  document.querySelectorAll(".plot").forEach((plot) => observer.observe(plot));
})();
