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

WIDTHS = [400, 1600]
SCHEMES = ["light", "dark"]
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
const figure = [...document.querySelectorAll(arguments[0])].find((each) => !each.hidden);
const plot = figure.querySelector(".plot");
return plot.data[0].z.flat().filter((value) => value !== null && value !== undefined).length;
"""


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

    return WebDriverWait(driver, 60, poll_frequency=0.1).until(condition)


def is_drawn(driver):
    """Whether every plot that can be seen is there."""
    return driver.execute_script(
        "return [...document.querySelectorAll('.plot')].every("
        "(plot) => plot.offsetParent === null || plot.querySelector('.main-svg'))"
    )


def find(driver, selector):
    return driver.find_element("css selector", selector)


def choose(driver, selector, value):
    from selenium.webdriver.support.ui import Select

    Select(find(driver, selector)).select_by_value(value)


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


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("width", WIDTHS)
def test_text_is_readable(show, width, scheme):
    driver = show(width, scheme)
    texts = driver.execute_script(VISIBLE_TEXTS)
    assert len(texts) > 200
    assert not [text for text, size, *_ in texts if size < 12.0]
    faint = [(text, color) for text, _, color, behind in texts if contrast(color, behind) < 4.5]
    assert not faint


@pytest.mark.parametrize("width", WIDTHS)
def test_nothing_is_wider_than_the_page(show, width):
    driver = show(width)
    assert driver.execute_script("return document.documentElement.scrollWidth") <= width
    wide = driver.execute_script(
        "return [...document.querySelectorAll('.plot')].filter((plot) => plot.offsetParent &&"
        " plot.querySelector('.main-svg').getBoundingClientRect().right > innerWidth).length"
    )
    assert wide == 0


def test_mazes_are_drawn_to_scale(show):
    driver = show(400)
    size = find(driver, ".states .nsewdrag").size
    assert size["width"] > 250
    assert size["width"] == pytest.approx(size["height"], abs=1)


def test_the_slider_moves_the_picture(show):
    driver = show()
    choose(driver, "select.map-seed", "0")
    figure, slider = find(driver, ".states .plot"), find(driver, ".maps input")
    wait(driver, lambda driver: drawn_states(driver) == 30)
    before, n_before = figure.screenshot_as_png, driver.execute_script(DRAWN_CELLS, ".states")
    move(driver, slider, 1)
    wait(driver, lambda driver: driver.execute_script(DRAWN_CELLS, ".states") < n_before)
    assert figure.screenshot_as_png != before
    assert find(driver, ".states .muted").text.startswith("Generation 1 ")
    move(driver, slider, 5)
    wait(driver, lambda driver: driver.execute_script(DRAWN_CELLS, ".states") == n_before)
    assert figure.screenshot_as_png == before


def drawn_states(driver):
    """Final states of the first map, by the text that is shown over each place."""
    return driver.execute_script(
        "const {z} = document.querySelector('.states .plot').data[0];"
        "return Math.round(z.flat().reduce((sum, v) => sum + (v === null ? 0 : 10 ** v), 0))"
    )


def test_a_map_is_of_one_seed_or_of_all(show):
    driver = show()
    assert find(driver, ".states .muted").text == "2 runs \N{MIDDLE DOT} 60 final states"
    assert drawn_states(driver) == 60
    choose(driver, "select.map-seed", "1")
    wait(driver, lambda driver: drawn_states(driver) == 30)
    captions = [each.text for each in driver.find_elements("css selector", ".states .muted")]
    assert captions[0] == "Generation 5 \N{MIDDLE DOT} 30 final states"
    assert captions[2] == "No run with seed 1."


def move(driver, slider, value):
    driver.execute_script(
        "arguments[0].value = arguments[1];"
        "arguments[0].dispatchEvent(new Event('input', {bubbles: true}))",
        slider,
        value,
    )


def test_cells_of_final_states_are_another_picture(show):
    driver = show()
    n_states = driver.execute_script(DRAWN_CELLS, ".states")
    choose(driver, "select.picture", "cells")
    assert find(driver, ".maps .key-high").text == "at the end of a run"
    wait(driver, lambda driver: "cells of final states" in find(driver, ".states .muted").text)
    n_cells = int(find(driver, ".states .muted").text.split()[-5])
    wait(driver, lambda driver: driver.execute_script(DRAWN_CELLS, ".states") == n_cells)
    assert n_cells < n_states


def test_curves_are_drawn_over_timesteps_or_seconds(show):
    driver = show()
    last = "return Math.max(...document.querySelector('.curve .plot').data.at(-1).x)"
    timesteps = driver.execute_script(last)
    choose(driver, "select.over", "seconds")
    wait(driver, lambda driver: driver.execute_script(last) != timesteps)
    assert find(driver, ".curve .xtitle").text == "seconds of training"


def test_a_label_can_be_hidden(show):
    driver = show()
    names = "return [...document.querySelectorAll('.curve .plot')].map((p) => p.data.length)"
    before = driver.execute_script(names)
    find(driver, ".legend button").click()
    wait(driver, lambda driver: driver.execute_script(names)[0] < before[0])
    assert find(driver, ".legend button").get_attribute("aria-pressed") == "false"
    assert not find(driver, ".states").is_displayed()


def test_a_replay_plays_and_pauses(show):
    driver = show()
    button, slider = find(driver, ".replays button"), find(driver, ".replays input")
    points = "return document.querySelector('.replay .plot').data[1].x.length"
    assert driver.execute_script(points) == 51
    button.click()
    assert button.text == "Pause"
    wait(driver, lambda driver: 1 < driver.execute_script(points) < 51)
    button.click()
    assert button.text == "Play"
    stopped = int(slider.get_property("value"))
    wait(driver, lambda driver: driver.execute_script(points) == stopped + 1)


def test_all_can_be_done_with_the_keyboard(show):
    from selenium.webdriver.common.keys import Keys

    driver = show()
    slider = find(driver, ".maps input")
    press(driver, Keys.TAB)
    assert driver.switch_to.active_element.text == "Skip to the results"
    for _ in range(30):
        if driver.switch_to.active_element == slider:
            break
        press(driver, Keys.TAB)
        style = "return getComputedStyle(document.activeElement).outlineStyle"
        assert driver.execute_script(style) != "none"
    press(driver, Keys.ARROW_LEFT, Keys.ARROW_LEFT)
    assert slider.get_property("value") == "3"
    assert slider.get_attribute("aria-valuetext") == "900 of 1.5k timesteps"
    assert find(driver, ".states .muted").text.endswith(" 36 final states")


def test_colors_are_those_of_the_system_until_one_asks_for_others(show):
    driver = show(scheme="dark")
    background = "return getComputedStyle(document.body).backgroundColor"
    dark = driver.execute_script(background)
    assert luminance(dark) < 0.05
    find(driver, "#theme").click()
    assert luminance(driver.execute_script(background)) > 0.8
    assert find(driver, "#theme").text == "Dark colors"
