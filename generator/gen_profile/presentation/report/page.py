"""A page as one file that a browser shows without any other: texts escaped, scripts named by their hashes."""

import base64
import hashlib
import json
from importlib.resources import files

from gen_profile.presentation.charts.figure import Figure
from gen_profile.presentation.charts.plotly_json import figure_json
from gen_profile.presentation.report.animation import Animation
from gen_profile.presentation.report.content import Page
from gen_profile.support.plugins import require_installed
from gen_profile_exporters.templates import filled

ASSETS = files("gen_profile.presentation.report") / "assets"
SCRIPTS = ("figures.js", "animation.js")
# characters with which a JSON text could leave its script element, or its line
HARMLESS = {ord(letter): f"\\u{ord(letter):04x}" for letter in "<>&\u2028\u2029"}


def require_pages() -> None:
    """Find out whether a page can be made, before time goes into what stands on it.

    Raises
    ------
    OutputError
        A library is not installed.
    """
    require_installed("gen-profile report needs Plotly", "report", "plotly")


def render(page: Page) -> bytes:
    """Write a page as HTML, UTF-8; the same page gives the same bytes.

    Whatever a text holds, it cannot run: the template escapes it, and a content security policy lets only the
    page's own scripts run, which it names by their SHA-256 (W3C, Content Security Policy Level 3, 8.3).
    """
    from plotly.offline import get_plotlyjs  # noqa: PLC0415

    scripts = [get_plotlyjs(), *((ASSETS / name).read_text("utf-8") for name in SCRIPTS)]
    text = filled(
        str(ASSETS / "page.html"),
        page=page,
        data=_data(page),
        style=(ASSETS / "page.css").read_text("utf-8"),
        scripts=scripts,
        policy=_policy(scripts),
    )
    return f"{text.rstrip()}\n".encode()


def _data(page: Page) -> str:
    """Write JSON that may stand in a script element of any page."""
    document = {
        "figures": [figure_json(block) for block in page.blocks(Figure)],
        "animations": [block.to_json() for block in page.blocks(Animation)],
    }
    text = json.dumps(document, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return text.translate(HARMLESS)


def _policy(scripts: list[str]) -> str:
    digests = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
    allowed = " ".join(f"'sha256-{digest}'" for digest in digests)
    return (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data: blob:; "
        "base-uri 'none'; form-action 'none'"
    )
