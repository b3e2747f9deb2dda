"""A page on paper: printed to PDF by whatever Chromium, Chrome or Edge is installed."""

import os
import re
import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

from gen_profile.support.errors import OutputError

BROWSERS = (
    *("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome"),
    *("microsoft-edge", "msedge"),
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Microsoft Edge.app/Contents/MacOS/Microsoft Edge",
    r"C:\Program Files\Google\Chrome\Application\chrome.exe",
    os.path.expandvars(r"%LOCALAPPDATA%\Google\Chrome\Application\chrome.exe"),  # installed for one user
    r"C:\Program Files (x86)\Microsoft\Edge\Application\msedge.exe",
)
FLAGS = (
    *("--headless", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--no-pdf-header-footer"),
    *("--virtual-time-budget=120000", "--host-resolver-rules=MAP * ~NOTFOUND"),
)
PATIENCE = 300.0  # s
CLOCK = re.compile(rb"/(CreationDate|ModDate) \(D:[0-9]{14}")  # would make every copy another one


def require_browser() -> str:
    """Find a browser that prints.

    Raises
    ------
    OutputError
        There is none.
    """
    browser = next((place for name in BROWSERS if (place := shutil.which(name))), None)
    if browser is None:
        raise OutputError(
            "out: printing to PDF needs Chromium, Chrome or Edge, and none was found; install one, or "
            "write a .html and print it from a browser."
        )
    return browser


def printed(page: bytes) -> bytes:
    """Print an HTML page to PDF.

    Raises
    ------
    OutputError
        There is no browser, or it does not print.
    """
    browser = require_browser()
    root = ("--no-sandbox",) if hasattr(os, "geteuid") and os.geteuid() == 0 else ()  # which has none
    with TemporaryDirectory(prefix="gen-profile-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        (folder / "page.html").write_bytes(page)
        paper = folder / "page.pdf"
        places = (f"--user-data-dir={folder / 'profile'}", f"--print-to-pdf={paper}")
        try:
            done = subprocess.run(
                [browser, *FLAGS, *root, *places, (folder / "page.html").as_uri()],
                check=False,
                capture_output=True,
                timeout=PATIENCE,
                env={**os.environ, "HOME": name},
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise OutputError(f"out: {browser} does not print the page ({error}); write a .html.") from error
        if not paper.exists():
            said = done.stderr.decode("utf-8", errors="replace").strip().splitlines()[-1:]
            raise OutputError(f"out: {browser} printed nothing ({' '.join(said)}); write a .html.")
        return CLOCK.sub(rb"/\1 (D:20000101000000", paper.read_bytes())
