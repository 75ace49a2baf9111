"""The report in a real browser: what it draws, and what can be done with it."""

import re
import shutil

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
DRAWN_CELLS = """
const [{z}] = document.querySelector("figure .plot")._fullData;
return z.map((row) => Array.from(row)).flat().filter(Number.isFinite).length;
"""
PATH = "return document.querySelector('.beside .plot')._fullData[1].x.length"


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
    """Opens the page, as wide and in the colors that one asks for."""

    def show(width=1600, scheme="light"):
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
        size = {"width": width, "height": 9000, "deviceScaleFactor": 1, "mobile": False}
        driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        driver.get("about:blank")
        driver.get(page)
        wait(driver, is_drawn)
        return driver

    yield show
    assert driver.get_log("browser") == []


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


def press(driver, *keys):
    from selenium.webdriver.common.action_chains import ActionChains

    for key in keys:
        ActionChains(driver).send_keys(key).perform()


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


def test_contrast():
    assert contrast("rgb(0, 0, 0)", "rgb(255, 255, 255)") == pytest.approx(21.0)
    assert contrast("rgb(119, 119, 119)", "rgb(255, 255, 255)") == pytest.approx(4.48, abs=0.01)


@pytest.mark.parametrize(("width", "scheme"), [(400, "dark"), (1600, "light")])
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
    size = find(driver, "figure .nsewdrag").size  # of a square maze
    assert size["width"] > 180
    assert size["width"] == pytest.approx(size["height"], abs=1)


def test_the_slider_moves_the_picture(show):
    driver = show()
    figure, slider = find(driver, "figure .plot"), find(driver, ".player input")
    before, n_before = figure.screenshot_as_png, driver.execute_script(DRAWN_CELLS)
    move(driver, slider, 60)
    wait(driver, lambda driver: 0 < driver.execute_script(DRAWN_CELLS) < n_before)
    assert figure.screenshot_as_png != before
    assert find(driver, ".player output").text == "300 of 1,500 timesteps"
    move(driver, slider, 300)
    wait(driver, lambda driver: driver.execute_script(DRAWN_CELLS) == n_before)
    assert figure.screenshot_as_png == before


def move(driver, slider, value):
    driver.execute_script(
        "arguments[0].value = arguments[1];"
        "arguments[0].dispatchEvent(new Event('input', {bubbles: true}))",
        slider,
        value,
    )


def test_a_path_plays_and_pauses(show):
    driver = show()
    player = driver.find_elements("css selector", ".player")[1]
    button, output = (player.find_element("css selector", tag) for tag in ("button", "output"))
    assert driver.execute_script(PATH) == 51
    button.click()
    assert button.text == "Pause"
    wait(driver, lambda driver: 1 < driver.execute_script(PATH) < 51)
    button.click()
    assert button.text == "Play"
    step = int(output.text.split()[0])
    wait(driver, lambda driver: driver.execute_script(PATH) in (step, step + 1))


def test_a_label_is_hidden_in_all_curves(show):
    driver = show()
    lines = "return document.querySelectorAll('#figure-2 .scatterlayer path.js-line').length"
    before = driver.execute_script(lines)
    find(driver, "#figure-2 .legendtoggle").click()
    wait(driver, lambda driver: driver.execute_script(lines) < before)
    shown = "return document.querySelector('#figure-2')._fullData.filter((t) => t.visible === true)"
    names = driver.execute_script(f"{shown}.map((trace) => trace.name)")
    assert set(names) == {"NSES"}


def test_seconds_are_drawn_once_they_are_asked_for(show):
    driver = show()
    folded = find(driver, "#figure-3")
    assert not folded.is_displayed()
    find(driver, "section:nth-of-type(2) summary").click()
    wait(driver, is_drawn)
    assert find(driver, "#figure-3 .xtitle").text == "seconds of training"


def test_all_can_be_done_with_the_keyboard(show):
    from selenium.webdriver.common.keys import Keys

    driver = show()
    slider = find(driver, ".player input")
    press(driver, Keys.TAB)
    assert driver.switch_to.active_element.text == "Skip to the results"
    for _ in range(30):
        if driver.switch_to.active_element == slider:
            break
        press(driver, Keys.TAB)
        style = "return getComputedStyle(document.activeElement).outlineStyle"
        assert driver.execute_script(style) != "none"
    press(driver, Keys.ARROW_LEFT, Keys.ARROW_LEFT)
    assert slider.get_property("value") == "298"
    assert slider.get_attribute("aria-valuetext") == "1,490 of 1,500 timesteps"
