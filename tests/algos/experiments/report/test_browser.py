"""The report in a real browser: what it draws, and what can be done with it."""

import json
import re
import shutil
from itertools import pairwise

import pytest

from curiosity_algos.experiments.report import write_report

BROWSER, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
pytestmark = [
    pytest.mark.extra("report"),
    pytest.mark.skipif(BROWSER is None or DRIVER is None, reason="chromium is not installed"),
]

VISIBLE_TEXTS = """
const found = [];
const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
while (walker.nextNode()) {
  const node = walker.currentNode, element = node.parentElement;
  if (!node.data.trim() || element.closest("script, style, noscript, .skip")) continue;
  const box = element.getBoundingClientRect(), style = getComputedStyle(element);
  if (!box.width || !box.height || style.visibility === "hidden") continue;
  let behind = element, background = "rgba(0, 0, 0, 0)";
  while (behind && /, 0\\)$/.test(background)) {
    background = getComputedStyle(behind).backgroundColor;
    behind = behind.parentElement;
  }
  const isDrawn = element instanceof SVGElement;
  const color = isDrawn ? style.fill : style.color;
  found.push([node.data, parseFloat(style.fontSize), color, background]);
}
return found;
"""
CUT = """
return [...document.querySelectorAll(".scroll")]
  .filter((box) => box.scrollWidth > box.clientWidth).map((box) => box.textContent);
"""
PAPER = """
dispatchEvent(new Event("beforeprint"));
return [...document.querySelectorAll("table, .main-svg")]
  .map((drawn) => drawn.getBoundingClientRect().right);
"""
PAPER_WIDTH = 210 / 25.4 * 96 - 2 * 38  # A4 in pixels, without the margins that browsers leave


@pytest.fixture(scope="module")
def page(runs_folder, tmp_path_factory):
    path = tmp_path_factory.mktemp("browser") / "report.html"
    write_report([runs_folder], path)
    return path.as_uri()


@pytest.fixture(scope="module")
def driver():
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    for argument in ("--no-sandbox", "--headless=new", "--disable-gpu", "--disable-dev-shm-usage"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    yield driver
    driver.quit()


@pytest.fixture
def show(driver, page):
    """Opens the page in a size and a color scheme."""

    def show(width=1600, scheme="light", height=9000):
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        media = {"media": "", "features": features}
        driver.execute_cdp_cmd("Emulation.setEmulatedMedia", media)
        open_page(driver, page, width, height)
        return driver

    yield show
    assert driver.get_log("browser") == []


def open_page(driver, page, width, height=9000):
    """High enough, it shows all plots; less high, those of its top."""
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    driver.get("about:blank")
    driver.get(page)
    if height == 9000:
        wait(driver, is_drawn)


def wait(driver, condition):
    from selenium.webdriver.support.ui import WebDriverWait

    return WebDriverWait(driver, 20, poll_frequency=0.1).until(condition)


def is_drawn(driver):
    """Whether every plot that can be seen is there."""
    return driver.execute_script(
        "return [...document.querySelectorAll('.plot')].every("
        "(plot) => !plot.checkVisibility() || plot.querySelector('.main-svg'))"
    )


def find(driver, selector):
    return driver.find_element("css selector", selector)


def contrast(text, background):
    """Of two colors, 1 to 21, as the Web Content Accessibility Guidelines define it."""
    high, low = sorted((luminance(text), luminance(background)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def luminance(color):
    red, green, blue = (int(part) / 255 for part in re.findall(r"\d+", color)[:3])
    linear = (
        c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in (red, green, blue)
    )
    return sum(weight * c for weight, c in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


@pytest.mark.parametrize(("width", "scheme"), [(400, "dark"), (1300, "light")])
def test_a_page_is_readable_and_fits(show, width, scheme):
    driver = show(width, scheme)
    background = driver.execute_script("return getComputedStyle(document.body).backgroundColor")
    assert (luminance(background) < 0.05) == (scheme == "dark")
    texts = driver.execute_script(VISIBLE_TEXTS)
    assert len(texts) > 150
    assert not [text for text, size, *_ in texts if size < 12.0]
    faint = [(text, color) for text, _, color, behind in texts if contrast(color, behind) < 4.5]
    assert not faint
    assert driver.execute_script("return document.documentElement.scrollWidth") <= width
    wide = driver.execute_script(
        "return [...document.querySelectorAll('.plot')].filter((plot) => plot.checkVisibility() &&"
        " plot.querySelector('.main-svg').getBoundingClientRect().right > innerWidth).length"
    )
    assert wide == 0
    if width == 1300:
        assert not driver.execute_script(CUT)
    size = find(driver, ".map .nsewdrag").size  # of a square maze
    assert size["width"] > 180
    assert size["width"] == pytest.approx(size["height"], abs=1)


def test_paper_has_all_figures_and_columns(show):
    driver = show(1300, "dark", height=600)
    assert not is_drawn(driver)
    driver.execute_cdp_cmd("Page.printToPDF", {})
    assert is_drawn(driver)
    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    edges = driver.execute_script(PAPER)
    assert len(edges) > 5
    assert max(edges) <= PAPER_WIDTH


TITLES = """
return [...document.querySelectorAll("#figure-0 .infolayer g")]
  .filter((title) => /ytitle|y\\d+title/.test(title.getAttribute("class")))
  .map((title) => title.getBoundingClientRect()).map((box) => [box.top, box.bottom]);
"""


def test_titles_of_axes_have_room_below_a_long_legend(driver, runs_folder, tmp_path):
    for i in range(12):
        run = tmp_path / "runs" / f"{i}"
        shutil.copytree(runs_folder / "NSES" / "CuriosityMaze-Hard-v0" / "0", run)
        described = json.loads((run / "run.json").read_text())
        name = {"algorithm": f"An algorithm with a long name, number {i}"}
        (run / "run.json").write_text(json.dumps(described | name))
    write_report([tmp_path / "runs"], tmp_path / "report.html")
    open_page(driver, (tmp_path / "report.html").as_uri(), 400)
    titles = driver.execute_script(TITLES)
    assert len(titles) == 3
    assert all(above[1] <= below[0] for above, below in pairwise(titles))


def test_a_label_is_hidden_in_all_curves(show):
    driver = show()
    lines = "return document.querySelectorAll('#figure-1 .scatterlayer path.js-line').length"
    before = driver.execute_script(lines)
    find(driver, "#figure-1 .legendtoggle").click()
    wait(driver, lambda driver: driver.execute_script(lines) < before)
    shown = "return document.querySelector('#figure-1')._fullData.filter((t) => t.visible === true)"
    names = driver.execute_script(f"{shown}.map((trace) => trace.name)")
    assert set(names) == {"NSES"}
