// What all pictures share: numbers from text, colors, drawing when visible, sliders.
const report = JSON.parse(document.getElementById("data").textContent);
const root = document.documentElement;
const KINDS = { u2: Uint16Array, u4: Uint32Array, f4: Float32Array };
const NO_VALUE = 65535;
const decoded = new WeakMap();

function decode(packed) {
  if (!decoded.has(packed)) {
    const bytes = Uint8Array.from(atob(packed.data), (letter) => letter.charCodeAt(0));
    decoded.set(packed, new KINDS[packed.kind](bytes.buffer));
  }
  return decoded.get(packed);
}

function dequantize(packed) {
  const scale = packed.width / (NO_VALUE - 1);
  return Array.from(decode(packed), (step) => (step === NO_VALUE ? null : packed.low + step * scale));
}

// -- colors ----------------------------------------------------------------------------------------

const systemIsDark = matchMedia("(prefers-color-scheme: dark)");
const isDark = () => root.dataset.theme === "dark";
const css = (name) => getComputedStyle(root).getPropertyValue(`--${name}`).trim();

function channels(color) {
  return [1, 3, 5].map((i) => parseInt(color.slice(i, i + 2), 16));
}

// On a dark page colors of lines are mixed with white, or the deep ones would not be seen.
function visible(color, alpha = 1) {
  const mixed = channels(color).map((c) => (isDark() ? Math.round(c * 0.65 + 255 * 0.35) : c));
  return `rgba(${mixed.join(",")},${alpha})`;
}

function colorscale() {
  const colors = css("scale").split(",").map((color) => color.trim());
  return colors.map((color, i) => [i / (colors.length - 1), color]);
}

function showTheme(theme) {
  root.dataset.theme = theme;
  document.getElementById("theme").textContent = isDark() ? "Light colors" : "Dark colors";
  document.querySelectorAll(".swatch").forEach((swatch) => {
    swatch.style.background = visible(swatch.dataset.color);
  });
  panels.forEach((panel, element) => refresh(element));
}

// -- pictures are drawn once they are seen ---------------------------------------------------------

const CONFIG = { displayModeBar: false, responsive: true };
const panels = new Map();
const observer = new IntersectionObserver(
  (entries) => {
    for (const entry of entries) {
      const panel = panels.get(entry.target);
      panel.isSeen = entry.isIntersecting;
      draw(panel);
    }
  },
  { rootMargin: "200px" },
);

function addPanel(element, figure) {
  panels.set(element, { element, figure, isStale: true, isSeen: false });
  observer.observe(element);
}

function refresh(element) {
  const panel = panels.get(element);
  panel.isStale = true;
  draw(panel);
}

function draw(panel) {
  if (!panel.isStale || !panel.isSeen || panel.element.offsetParent === null) return;
  panel.isStale = false;
  const { data, layout } = panel.figure();
  Plotly.react(panel.element, data, { ...baseLayout(), ...layout }, CONFIG);
}

function axis(title, further = {}) {
  const colors = { gridcolor: css("line"), linecolor: css("line"), zerolinecolor: css("line") };
  return { title: { text: title, standoff: 8 }, automargin: true, ...colors, ...further };
}

function baseLayout() {
  const font = { family: getComputedStyle(document.body).fontFamily, size: 13, color: css("text") };
  return {
    font,
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    showlegend: false,
    dragmode: false,
    hoverlabel: { font: { size: 13, color: css("text") }, bgcolor: css("card"), bordercolor: css("line") },
    margin: { l: 8, r: 12, t: 8, b: 8 },
  };
}

// -- text ------------------------------------------------------------------------------------------

function short(value) {
  for (const [unit, size] of [["G", 1e9], ["M", 1e6], ["k", 1e3]]) {
    if (Math.abs(value) >= 0.9995 * size) return `${+(value / size).toPrecision(3)}${unit}`;
  }
  return `${+value.toPrecision(3)}`;
}

const { format: whole } = new Intl.NumberFormat("en-US", { maximumFractionDigits: 0 });

// -- sliders that play -----------------------------------------------------------------------------

// Calls `show(value)` once a frame at most; playing takes about `seconds` from one end to the other.
function makePlayer(element, show, text, seconds) {
  const [button, slider, output] = ["button", "input", "output"].map((tag) => element.querySelector(tag));
  const most = Number(slider.max);
  let timer = null;
  let isAsked = false;
  function changed() {
    const shown = text(Number(slider.value));
    output.textContent = shown;
    slider.setAttribute("aria-valuetext", shown);
    if (isAsked) return;
    isAsked = true;
    requestAnimationFrame(() => {
      isAsked = false;
      show(Number(slider.value));
    });
  }
  function stop() {
    clearInterval(timer);
    timer = null;
    button.textContent = "Play";
  }
  function step() {
    const stride = Math.max(1, Math.round(most / (seconds * 20)));
    slider.value = Math.min(most, Number(slider.value) + stride);
    changed();
    if (Number(slider.value) === most) stop();
  }
  button.addEventListener("click", () => {
    if (timer !== null) return stop();
    if (Number(slider.value) === most) slider.value = slider.min;
    button.textContent = "Pause";
    timer = setInterval(step, Math.max(50, (1000 * seconds) / most));
  });
  slider.addEventListener("input", () => {
    stop();
    changed();
  });
  changed();
}
