"""The names that Python users import: paths, names and texts become values, and one function is called."""

from base64 import b64encode
from typing import Any

from gen_profile.support.summary import drawers


def _image(result: Any) -> str:
    """Draw a result for a notebook as an image, since ids of inline SVGs may meet in one page."""
    from gen_profile.presentation.charts.plot import picture  # noqa: PLC0415  # loaded when one is shown

    return f"data:image/svg+xml;base64,{b64encode(picture(result).svg.encode()).decode()}"


drawers.append(_image)
