# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The page in a real browser: it shows a running vehicle, what becomes of messages and why, and recordings."""

import re
import shutil
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from pymavlink import mavutil
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.remote.webdriver import WebDriver
from selenium.webdriver.remote.webelement import WebElement
from selenium.webdriver.support.wait import WebDriverWait

from mav_handlers.verdicts import ODOMETRY_FRAMES
from tests.interop import programs
from tests.interop.programs import LIMIT_S, SESSION_S, Autopilot, Companion, autopilot, running
from tests.places import RECORDED

pytestmark = pytest.mark.interop

BROWSER, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
SWITCHES = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--window-size=1600,1000",
)
PARAM_SET_TYPE = mavutil.mavlink.MAV_PARAM_TYPE_REAL32


@dataclass(frozen=True)
class Page:
    """The page in a browser."""

    driver: WebDriver
    url: str

    def find(self, selector: str) -> WebElement:
        """Return the first element that a CSS selector finds."""
        return self.driver.find_element(By.CSS_SELECTOR, selector)

    def wait_text(self, selector: str, pattern: str) -> str:
        """Wait until the text of an element has a match for a pattern, and return it."""
        script = "return document.querySelector(arguments[0])?.textContent ?? ''"
        seen = ""

        def matches(driver: WebDriver) -> bool:
            nonlocal seen
            seen = driver.execute_script(script, selector)
            return re.search(pattern, seen) is not None

        WebDriverWait(self.driver, LIMIT_S, 0.05).until(matches, f"{selector} never said {pattern!r}")
        return seen

    def wait(self, script: str, *args: Any) -> Any:
        """Wait until an expression is true, and return it."""
        return WebDriverWait(self.driver, LIMIT_S, 0.05).until(
            lambda driver: driver.execute_script(f"return {script}", *args), f"never true: {script}"
        )

    def press(self, *keys: str) -> None:
        """Press keys, one after the other, wherever the focus is."""
        for key in keys:
            self.driver.switch_to.active_element.send_keys(key)

    def leave(self) -> None:
        """Have nothing focused."""
        self.driver.execute_script("document.activeElement.blur()")

    def media(self, scheme: str, width: int = 1600) -> None:
        """Let the system prefer a colour scheme, and make the window so wide."""
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
        metrics = {"width": width, "height": 1000, "deviceScaleFactor": 1, "mobile": False}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)


@dataclass(frozen=True)
class LivePage(Page):
    """The page of a running vehicle."""

    vehicle: Autopilot


@pytest.fixture(scope="module")
def driver(tmp_path_factory: pytest.TempPathFactory) -> Iterator[WebDriver]:
    """Return a headless browser with nothing in its profile."""
    if BROWSER is None or DRIVER is None:
        pytest.skip("chromium and chromedriver are not installed")
    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    for switch in (*SWITCHES, f"--user-data-dir={tmp_path_factory.mktemp('profile')}"):
        options.add_argument(switch)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    made = webdriver.Chrome(options=options, service=Service(executable_path=DRIVER))
    try:
        yield made
    finally:
        made.quit()


@pytest.fixture(scope="module")
def vehicle(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Autopilot]:
    """Return a vehicle that serves its page."""
    options = ("--web=127.0.0.1:0", "--preset=voxl")
    with autopilot(tmp_path_factory.mktemp("vehicle"), *options, links=("tcpin", "tcpin")) as made:
        yield made


@pytest.fixture(scope="module")
def url(vehicle: Autopilot) -> str:
    """Return where the page is, as the program has printed it."""
    (line,) = [line for line in vehicle.program.lines if line.startswith("live view at ")]
    return line.removeprefix("live view at ")


@pytest.fixture
def page(driver: WebDriver, vehicle: Autopilot, url: str) -> LivePage:
    """Return the page, opened again."""
    driver.get(url)
    made = LivePage(driver, url, vehicle)
    made.media("light")
    made.wait_text("#connection", "^connected$")
    made.wait_text("#tiles", "disarmed")
    return made


def test_page_loads_all_of_itself_from_the_vehicle(page: LivePage) -> None:
    assert "ArduCopter" in page.wait_text("#banner", "tcpin")
    script = "return performance.getEntriesByType('resource').map((entry) => entry.name)"
    loaded = page.driver.execute_script(script)
    assert {"app.js", "style.css"} <= {name.removeprefix(page.url) for name in loaded}
    assert [name for name in loaded if not name.startswith(page.url)] == []
    assert page.driver.get_log("browser") == []  # type: ignore[attr-defined]


def test_accepted_messages_are_counted_while_they_come(page: LivePage) -> None:
    with Companion(page.vehicle.ports[0]):
        row = "#verdict-list li[data-outcome=accepted]"
        page.wait_text(row, "ODOMETRY.*consumed")
        count = "Number(document.querySelector(arguments[0])?.dataset.count ?? 0)"
        before = page.driver.execute_script(f"return {count}", row)
        page.wait(f"{count} > arguments[1]", row, before + 20)
        page.wait_text("#rates tbody tr", r"^ODOMETRY\d")
        page.wait("[...document.querySelectorAll('#rates tbody tr td')].some((cell) => Number(cell.textContent) > 10)")
        page.wait_text("#tiles", "camerahealthy")
        page.wait("document.querySelector('#plan').getAttribute('aria-label').includes('vision at 0.00 m north')")


def test_dropped_odometry_has_its_reason_and_its_place_in_the_firmware(page: LivePage) -> None:
    with Companion(page.vehicle.ports[0]):
        page.find("#fault-frames").click()
        row = f"#verdict-list li[data-rule={ODOMETRY_FRAMES.rule.code}]"
        text = page.wait_text(row, "ODOMETRY")
        assert "dropped" in text
        assert ODOMETRY_FRAMES.rule.text in text
        assert ODOMETRY_FRAMES.rule.source in text
        page.wait("document.querySelector('#fault-frames').getAttribute('aria-pressed') === 'true'")
        page.wait_text("#tiles", "1 on")
        page.find("#verdict-search").send_keys("local_frd")
        others = f"#verdict-list li:not([hidden]):not([data-rule={ODOMETRY_FRAMES.rule.code}])"
        page.wait("document.querySelector(arguments[0]) === null", others)
        page.find("#fault-frames").click()
        page.wait("document.querySelector('#fault-frames').getAttribute('aria-pressed') === 'false'")


def test_handled_messages_are_hidden_until_asked_for(page: LivePage) -> None:
    with closing(mavutil.mavlink_connection(f"tcp:127.0.0.1:{page.vehicle.ports[1]}", source_system=255)) as client:
        client.mav.heartbeat_send(6, 8, 0, 0, 4)
        page.wait("document.querySelector('#verdict-list li[data-outcome=handled]')?.hidden")
        page.find("#outcomes button[data-outcome=handled]").click()
        page.wait("!document.querySelector('#verdict-list li[data-outcome=handled]').hidden")
        page.find("#outcomes button[data-outcome=handled]").click()


def test_parameters_of_external_navigation_come_first(page: LivePage) -> None:
    script = "return [...document.querySelectorAll('#params label')].map((label) => label.textContent)"
    names = page.driver.execute_script(script)
    ranks = [0 if name.startswith("VISO_") else 1 if name.startswith("EK3_SRC") else 2 for name in names]
    assert ranks == sorted(ranks)
    assert set(ranks) == {0, 1, 2}


def test_page_keeps_up_with_200_messages_a_second(page: LivePage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(programs, "RATE_HZ", 200)
    with Companion(page.vehicle.ports[0]):
        page.wait("Number(document.querySelector('#rates tbody td')?.textContent) > 100")
        page.find("#verdict-search").send_keys("no such verdict")
        page.wait("document.querySelector('#verdict-list li:not([hidden])') === null")
        page.press(Keys.ESCAPE)
        page.wait("document.querySelector('#verdict-list li.live:not([hidden])') !== null")
    assert "not shown" not in page.find("#tiles").text


SLIDE = """
const slider = document.querySelector('#scrubber');
slider.value = Number(slider.max) - 1;
slider.dispatchEvent(new Event('input'));
return Number(slider.value);
"""


def test_cursor_goes_through_all_plots_and_back_to_the_newest(page: LivePage) -> None:
    with Companion(page.vehicle.ports[0]):
        page.wait_text("#quality-now", "median 90")
        page.wait("Number(document.querySelector('#scrubber').max) > 2")
        chosen_s = page.driver.execute_script(SLIDE)
        page.wait_text("#shown-time", rf"^\d+:{chosen_s % 60:04.1f} of")
        page.find("#newest").click()
        page.wait("document.querySelector('#scrubber').getAttribute('aria-valuetext') === 'the newest'")


def test_held_plots_stay_while_data_goes_on(page: LivePage) -> None:
    with Companion(page.vehicle.ports[0]):
        page.find("#hold-plots").click()
        held = page.wait_text("#shown-time", " of ")
        row = "#verdict-list li[data-outcome=accepted]"
        count = "Number(document.querySelector(arguments[0])?.dataset.count ?? 0)"
        page.wait(f"{count} > arguments[1]", row, page.driver.execute_script(f"return {count}", row) + 10)
        assert page.find("#shown-time").text == held
        page.find("#hold-plots").click()
        page.wait("document.querySelector('#shown-time').textContent !== arguments[0]", held)


def test_doctor_examines_the_last_minute_and_offers_its_findings(page: LivePage) -> None:
    with Companion(page.vehicle.ports[0]):
        page.find("#diagnose").click()
        page.wait_text("#findings li", "Fix: ")
        assert page.find("#save-text").is_displayed()
        assert page.find("#save-json").is_displayed()


def test_path_is_turned_by_keys_and_pointer(page: LivePage) -> None:
    page.find("#view-space").click()
    page.wait("document.querySelector('#plan').getAttribute('aria-label').startsWith('Path in space')")
    page.find("#view-above").click()
    page.wait("document.querySelector('#plan').getAttribute('aria-label').startsWith('Path from above')")
    page.find("#plan").send_keys(Keys.ARROW_LEFT)
    page.wait("document.querySelector('#view-above').getAttribute('aria-pressed') === 'false'")


def test_changed_parameter_reaches_the_vehicle_and_every_link(page: LivePage) -> None:
    client = mavutil.mavlink_connection(f"tcp:127.0.0.1:{page.vehicle.ports[1]}", source_system=255)
    try:
        client.mav.heartbeat_send(6, 8, 0, 0, 4)
        assert client.wait_heartbeat(timeout=LIMIT_S) is not None
        field = page.find("#param-VISO_DELAY_MS")
        page.find("#param-search").send_keys("viso delay")
        page.wait_text("#param-note", "^1 of")
        field.send_keys(Keys.CONTROL, "a")
        field.send_keys("80", Keys.ENTER)
        page.wait_text("#answer", "VISO_DELAY_MS is 80")
        echo = client.recv_match(
            type="PARAM_VALUE", condition="PARAM_VALUE.param_id=='VISO_DELAY_MS'", blocking=True, timeout=LIMIT_S
        )
        assert echo is not None
        assert echo.param_value == 80
        client.param_set_send("VISO_DELAY_MS", 30, PARAM_SET_TYPE)
        page.leave()
        page.wait("document.querySelector('#param-VISO_DELAY_MS').value === '30'")
    finally:
        client.close()


def test_number_that_is_none_is_marked_and_not_sent(page: LivePage) -> None:
    field = page.find("#param-VISO_QUAL_MIN")
    before = field.get_attribute("value")
    field.send_keys(Keys.CONTROL, "a")
    field.send_keys("ten", Keys.ENTER)
    page.wait("document.querySelector('#param-VISO_QUAL_MIN').getAttribute('aria-invalid') === 'true'")
    field.send_keys(Keys.ESCAPE)
    assert field.get_attribute("value") == before


def test_keys_command_the_vehicle_but_not_while_typing(page: LivePage) -> None:
    page.leave()
    page.press("2")
    page.wait("document.querySelector('#action-source2').getAttribute('aria-pressed') === 'true'")
    page.press("/")
    page.press("1", "a")
    assert page.find("#verdict-search").get_attribute("value") == "1a"
    page.press(Keys.ESCAPE)
    assert page.find("#verdict-search").get_attribute("value") == ""
    page.press("1")
    page.wait("document.querySelector('#action-source1').getAttribute('aria-pressed') === 'true'")
    page.press("?")
    page.wait("document.querySelector('#keys').open")
    page.press(Keys.ESCAPE)
    page.wait("!document.querySelector('#keys').open")


def test_refused_arming_is_told_with_its_reasons(page: LivePage) -> None:
    page.find("#action-arm").click()
    page.wait_text("#answer", "^✕ Arm: refused")
    page.wait_text("#prearm", "VisOdom: not healthy")
    page.wait_text("#texts li", "Arm: ")


def test_focus_goes_through_the_page_in_order_and_is_seen(page: LivePage) -> None:
    page.driver.execute_script("document.body.tabIndex = -1; document.body.focus()")
    seen = []
    for _ in range(4):
        page.press(Keys.TAB)
        focused = page.driver.switch_to.active_element
        seen.append(focused.get_attribute("id") or focused.get_attribute("class"))
        assert focused.value_of_css_property("outline-style") == "solid"
    assert seen == ["skip", "theme", "help", "hold-plots"]


def test_dark_and_light_follow_the_system_until_chosen(page: LivePage) -> None:
    background = "return getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)[0]"
    page.media("dark")
    assert page.driver.execute_script(background) < 60
    page.media("light")
    assert page.driver.execute_script(background) > 200
    for name in ("light", "dark", "auto"):
        page.find("#theme").click()
        page.wait_text("#theme", name)
        assert (page.driver.execute_script(background) < 60) == (name == "dark")


@pytest.mark.parametrize("width", [1100, 1600])
def test_nothing_moves_when_the_vehicle_has_more_to_say(page: LivePage, width: int) -> None:
    page.media("light", width)
    height = "return document.querySelector('header').offsetHeight"
    before = page.driver.execute_script(height)
    page.driver.execute_script("document.querySelector('#tiles dd').textContent = 'roll/pitch diff 36.3 deg (>10)'")
    assert page.driver.execute_script(height) == before


@pytest.mark.parametrize("width", [360, 1100, 1800])
def test_nothing_needs_scrolling_sideways(page: LivePage, width: int) -> None:
    page.media("light", width)
    page.wait("document.documentElement.clientWidth <= arguments[0]", width)
    assert page.driver.execute_script("return document.documentElement.scrollWidth") <= width


def test_restart_is_shown_and_the_page_goes_on(page: LivePage) -> None:
    page.find("#action-restart").click()
    page.wait_text("#answer", "Restart: done")
    page.wait("[...document.querySelectorAll('#texts li')].some((li) => li.textContent.includes('— restart —'))")
    page.wait_text("#texts li", "AHRS: EKF3 active|EKF3 IMU|ArduPilot Ready|DCM active")
    page.find("#action-source3").click()
    page.wait("document.querySelector('#action-source3').getAttribute('aria-pressed') === 'true'")


def test_page_says_so_when_the_vehicle_ends_and_keeps_nothing_from_ending(driver: WebDriver, tmp_path: Path) -> None:
    with autopilot(tmp_path, "--web=127.0.0.1:0") as vehicle:
        (line,) = [line for line in vehicle.program.lines if line.startswith("live view at ")]
        driver.get(line.removeprefix("live view at "))
        page = Page(driver, line)
        page.wait_text("#connection", "^connected$")
        assert vehicle.program.interrupt() == 0
        page.wait_text("#connection", "^not connected")


LOG = RECORDED / "logs" / "flight_t265.BIN.xz"
CAPTURE = RECORDED / "captures" / "dropout.jsonl.gz"
WITHOUT_VISION = RECORDED / "logs" / "flow_take_off.BIN.xz"
PAINTED = """
const { width, height } = document.querySelector(arguments[0]);
const data = document.querySelector(arguments[0]).getContext('2d').getImageData(0, 0, width, height).data;
return data.filter((value, index) => index % 4 === 3 && value > 0).length;
"""
CANVASES = ("#plan", "#height", "#lag", "#quality", ".innovation canvas")


@contextmanager
def recorded(driver: WebDriver, *command: str) -> Iterator[Page]:
    """Yield the page of a recording, which Ctrl-C then ends."""
    program = [sys.executable, "-c", "from viso.cli import main; main()", *command, "--web=127.0.0.1:0"]
    with running(program) as serving:
        url = serving.until("^recording at ", SESSION_S).split()[2].removesuffix(";")
        driver.get_log("browser")  # type: ignore[attr-defined]
        driver.get(url)
        page = Page(driver, url)
        page.media("light")
        page.wait_text("#connection", "^recording$")
        yield page
        assert driver.get_log("browser") == []  # type: ignore[attr-defined]
        assert serving.interrupt() == 0, serving.screen()


@pytest.mark.parametrize("command", [("replay", str(CAPTURE), "--ekf"), ("report", str(LOG))], ids=lambda one: one[0])
def test_recording_is_gone_through_with_the_slider(driver: WebDriver, command: tuple[str, ...]) -> None:
    with recorded(driver, *command) as page:
        page.wait(
            "[...document.querySelectorAll('#verdict-list li')].some((row) => row.dataset.outcome === 'accepted')"
        )
        for canvas in CANVASES:
            page.wait(f"(() => {{ {PAINTED} }})() > 400".replace("arguments[0]", repr(canvas)))
        at_s = page.driver.execute_script(SLIDE.replace("Number(slider.max) - 1", "15"))
        page.wait_text("#shown-time", rf"^0:{at_s:04.1f} of")
        page.wait_text("#lag-now", r"^median \d")
        page.wait_text("#tiles", "aidingabsolute")
        page.wait("document.querySelector('#plan').getAttribute('aria-label').includes('vision at')")
        page.wait("document.querySelector('#texts li.later') !== null")
        page.find("#newest").click()
        page.wait("document.querySelector('#texts li.later') === null")
        assert not page.find("#commands").is_displayed()
        assert page.find("#param-VISO_TYPE").get_attribute("readonly")
        for width in (360, 1600):
            page.media("dark", width)
            page.wait("document.documentElement.clientWidth <= arguments[0]", width)
            assert page.driver.execute_script("return document.documentElement.scrollWidth") <= width


def test_log_without_vision_says_what_is_missing(driver: WebDriver) -> None:
    with recorded(driver, "report", str(WITHOUT_VISION)) as page:
        page.wait_text("#flight-sentence", "no external navigation")
        page.wait_text("#absent", "No VISP")
        page.wait_text("#tiles", "pre-armnot logged")
        page.wait_text("#lag-now", "^not recorded$")
        page.wait_text("#rates-empty", "^None is recorded")
        page.wait_text("#verdict-note", "no external navigation")
