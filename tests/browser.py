"""A real browser without a screen, driven through WebDriver; tests that need it skip where it is missing."""

import json
import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

DESKTOP, PHONE = (1280, 900), (390, 844)


def _program(*names: str) -> str:
    for name in names:
        found = shutil.which(name)
        if found:
            return found
    pytest.skip(f"{names[0]} is not installed (Debian: apt-get install chromium chromium-driver)")


@contextmanager
def opened() -> Iterator[Any]:
    """Start a headless Chromium; skips the test where it, its driver or selenium is missing."""
    selenium = pytest.importorskip("selenium.webdriver", reason="selenium is not installed: pip install 'assoc[test]'")
    from selenium.webdriver.chrome.options import Options
    from selenium.webdriver.chrome.service import Service

    options = Options()
    options.binary_location = _program("chromium", "chromium-browser", "google-chrome")
    driver = _program("chromedriver", "chromium.chromedriver")
    words = ["--headless=new", "--disable-dev-shm-usage", "--hide-scrollbars", "--enable-unsafe-swiftshader"]
    words += ["--use-angle=swiftshader", "--disable-background-networking", "--no-first-run"]
    # root, as in most containers, cannot use the sandbox
    for word in [*words, *(["--no-sandbox"] if os.geteuid() == 0 else [])]:
        options.add_argument(word)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    browser = selenium.Chrome(options=options, service=Service(driver, log_output=os.devnull))
    try:
        browser.set_page_load_timeout(240)  # machines can be busy
        yield browser
    finally:
        browser.quit()


def show(browser: Any, page: Path, size: tuple[int, int] = DESKTOP, *, fragment: str = "", scale: int = 1) -> None:
    """Open a page at a size, with so many pixels a unit; a phone's is emulated, for windows cannot be that narrow."""
    phone = size[0] < 500
    metrics = {"width": size[0], "height": size[1], "deviceScaleFactor": scale, "mobile": phone}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    browser.get_log("browser")  # what an earlier page said
    browser.get("about:blank")
    browser.get(page.resolve().as_uri() + fragment)
    # a busy browser may answer for the blank page, or for one whose script has not yet ended
    drawn = "return location.href !== 'about:blank' && document.readyState === 'complete'"
    assert in_time(lambda: browser.execute_script(drawn)), f"the browser did not open {page.name}"


def in_time(condition: Callable[[], Any]) -> Any:
    """Return what a condition becomes within a minute: machines can be busy."""
    last = time.monotonic() + 60.0
    while not (found := condition()) and time.monotonic() < last:
        time.sleep(0.02)
    return found


def complaints(browser: Any) -> list[str]:
    """Return errors and warnings of the console since the page was opened."""
    return [f"{line['level']}: {line['message']}" for line in browser.get_log("browser") if line["level"] != "INFO"]


def requests(browser: Any) -> list[str]:
    """Return the addresses that were asked for since the last call, also those that were blocked."""
    found = []
    for entry in browser.get_log("performance"):
        event = json.loads(entry["message"])["message"]
        if event["method"] in ("Network.requestWillBeSent", "Network.webSocketCreated"):
            found.append(event["params"].get("request", event["params"])["url"])
    return found


def screenshot(browser: Any, path: Path) -> bytes:
    """Keep a picture of the whole page, and return it."""
    import base64

    page = "const page = document.documentElement; return [page.clientWidth, page.scrollHeight]"
    size = browser.execute_script(page)
    clip = {"x": 0, "y": 0, "width": size[0], "height": min(size[1], 6000), "scale": 1}
    shot = browser.execute_cdp_cmd("Page.captureScreenshot", {"captureBeyondViewport": True, "clip": clip})
    content = base64.b64decode(shot["data"])
    path.write_bytes(content)
    return content
