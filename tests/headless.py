"""A headless Chromium that opens pages, as a reader's browser would, and tells what happened in it."""

from __future__ import annotations

import base64
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By
from selenium.webdriver.remote.webelement import WebElement
from selenium.webdriver.support.wait import WebDriverWait
from system_parts import missing, program

ARGUMENTS = (
    "--headless=new",
    "--no-sandbox",  # root has none
    "--disable-dev-shm-usage",
    "--disable-gpu",
    "--hide-scrollbars",
    "--force-prefers-reduced-motion",
    "--force-device-scale-factor=1",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",  # offline, whatever a page asks for
)
COLOURS = ("color-contrast", "link-in-text-block")  # axe-core's rules that depend on the colours
PATIENCE = 300.0  # s until a page that does not answer counts as broken


class Browser:
    """One window."""

    def __init__(self, driver: webdriver.Chrome) -> None:
        self._driver = driver

    @property
    def driver(self) -> webdriver.Chrome:
        """For what else a hand does."""
        return self._driver

    def open(self, page: Path, *, width: int = 1280, mobile: bool = False) -> None:
        """Load a page in a window of a width, and wait until it has drawn everything."""
        self.size(width, 844, mobile=mobile)
        self.visit(page.as_uri())
        self.wait("return document.documentElement.dataset.drawn === 'true'")

    def size(self, width: int, height: int, *, mobile: bool = False) -> None:
        """Give the window a size in pixels."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": mobile}
        self._driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        self._driver.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": mobile})

    def visit(self, address: str) -> None:
        """Load whatever is at an address."""
        self._driver.get(address)

    def run(self, script: str, *arguments: object) -> Any:
        """Run a function's body in the page."""
        return self._driver.execute_script(script, *arguments)

    def run_async(self, script: str, *arguments: object) -> Any:
        """Run a function's body whose last argument takes the result."""
        return self._driver.execute_async_script(script, *arguments)

    def wait(self, script: str, *arguments: object) -> None:
        """Wait until a function's body gives something true."""
        WebDriverWait(self._driver, PATIENCE, poll_frequency=0.2).until(
            lambda _: self.run(script, *arguments)
        )

    def find(self, selector: str) -> WebElement:
        """Find the first element of a CSS selector."""
        return self._driver.find_element(By.CSS_SELECTOR, selector)

    def drag(self, start: tuple[float, float], end: tuple[float, float], steps: int = 10) -> None:
        """Press the mouse at a place of the window, move it to another in steps, and let go."""
        for step in (-1, *range(steps + 1), steps + 1):
            share = min(max(step, 0), steps) / steps
            x, y = (a + share * (b - a) for a, b in zip(start, end, strict=True))
            kind = {-1: "mousePressed", steps + 1: "mouseReleased"}.get(step, "mouseMoved")
            mouse = {"type": kind, "x": x, "y": y, "button": "left", "buttons": 1, "clickCount": 1}
            self._driver.execute_cdp_cmd("Input.dispatchMouseEvent", mouse)

    def complaints(self) -> list[str]:
        """What the console said since the last call: errors, warnings, what the page's policy refused."""
        return [entry["message"] for entry in self._driver.get_log("browser")]

    def violations(self, *rules: str, colours: bool = True) -> list[tuple[str, list[str]]]:
        """What axe-core finds wrong: rules, and elements that break them.

        By the rules named, or all of its usual ones (those of colours take most of the time) and the sizes of
        touch targets.
        """
        if self.run("return window.axe === undefined"):
            path = os.environ.get("AXE_CORE") or missing("AXE_CORE, the path of axe-core's axe.min.js")
            self.run(Path(path).read_text("utf-8"))
        self.run("for (const part of document.querySelectorAll('details')) part.open = true")
        usual = {"target-size": True, **dict.fromkeys(COLOURS, colours)}
        switched = {rule: {"enabled": enabled} for rule, enabled in usual.items()}
        how = {"runOnly": rules} if rules else {"rules": switched}
        found = self.run_async("axe.run(arguments[0]).then((found) => arguments[1](found.violations))", how)
        return [(one["id"], [node["html"][:200] for node in one["nodes"]][:3]) for one in found]

    @contextmanager
    def on_paper(self) -> Iterator[None]:
        """Lay the page out as for paper."""
        self._driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
        yield
        self._driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})

    @contextmanager
    def emulated(self, scheme: str) -> Iterator[None]:
        """Prefer dark or light colours."""
        preferred = [{"name": "prefers-color-scheme", "value": scheme}]
        self._driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": preferred})
        yield
        self._driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})

    def pdf(self) -> bytes:
        """Print the page."""
        return base64.b64decode(self._driver.print_page())


@contextmanager
def browser() -> Iterator[Browser]:
    """Start Chromium, and end it."""
    chromium, driver = program("chromium", "chromium"), program("chromedriver", "chromium-driver")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for argument in ARGUMENTS:
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = Service(driver, env={**os.environ, "HOME": os.environ.get("HOME", "/tmp")})
    started = webdriver.Chrome(options=options, service=service)
    started.set_script_timeout(PATIENCE)
    try:
        yield Browser(started)
    finally:
        started.quit()
