"""A certificate as a file: JSON, its large arrays compressed."""

from __future__ import annotations

import binascii
import json
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from gen_profile.certificate.axis_motion import AxisMotion
from gen_profile.certificate.balls import Array
from gen_profile.certificate.boxes import DyadicBox
from gen_profile.certificate.packing import Motions, pack, unpack
from gen_profile.errors import CertificateError

SUFFIX = ".certificate.json"
FORMAT = "gen-profile certificate 1"
MOST_HALVINGS = 50  # of a range, up to which shares of it are exact
FIRST_TERMS = (1, 8, 6, 5, 4)  # in each of so many parameters, where it is not stated


@attrs.frozen(kw_only=True, eq=False)
class Certificate:
    """What is proved, of what, and what the proof needs.

    Attributes
    ----------
    spec_sha256, artefact_sha256 : str
        Of what it is proved.
    ranges : mapping of str to (float, float)
        Of the machine's parameters.
    arrival, until : float
        Time in s in which the sway is bounded.
    limits : mapping of str to float
        Allowed residual sway of every load in m.
    bounds : mapping of str to float
        Proved ones, of all machines that there are any of; none where there are not.
    seen : mapping of str to float
        Greatest sways that were met on the way, in m; of these nothing is proved.
    share : float
        Of the ranges' box, of which the bounds are proved.
    axes : AxisMotion
    boxes : tuple of DyadicBox
    terms : tuple of int
        Of series in each parameter.
    motions : tuple of Motions
        Of every box, for `gen_profile.certificate.enclosure.Approximation`.
    scales : (boxes, pieces or 1, 2 n_u, 2 n_u, parameter terms or 1) array
        Likewise.
    """

    spec_sha256: str
    artefact_sha256: str
    ranges: Mapping[str, tuple[float, float]]
    arrival: float
    until: float
    limits: Mapping[str, float]
    bounds: Mapping[str, float]
    seen: Mapping[str, float]
    share: float
    axes: AxisMotion
    boxes: tuple[DyadicBox, ...]
    terms: tuple[int, ...]
    motions: tuple[Motions, ...]
    scales: Array

    @property
    def proved(self) -> bool:
        """Whether every machine of the ranges keeps the limits."""
        return self.share == 1.0 and not self.reasons()

    def reasons(self) -> tuple[str, ...]:
        """Say what is not proved, a sentence each."""
        if self.share < 1.0:
            return (
                f"Bounds are proved for {100.0 * self.share:.3g} % of the machines; others swing too far, "
                "or differ too much: narrow the ranges (check.uncertain), or take more time.",
            )
        return tuple(
            f"The {load} is proved to sway by at most {1e3 * bound:.4g} mm after the move, and "
            f"{1e3 * self.limits[load]:.4g} mm are allowed (check.residual_sway); the greatest sway met is "
            f"{1e3 * self.seen[load]:.4g} mm."
            for load, bound in self.bounds.items()
            if not bound <= self.limits[load]
        )

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON, without what only the proof needs."""
        return {
            "proved": self.proved,
            "bounds_m": dict(self.bounds),
            "limits_m": dict(self.limits),
            "largest_met_m": dict(self.seen),
            "ranges": {name: list(ends) for name, ends in self.ranges.items()},
            "share_proved": self.share,
            "boxes": len(self.boxes),
            "from_s": self.arrival,
            "until_s": self.until,
            "reasons": list(self.reasons()),
        }


def certificate_path(path: Path) -> Path:
    """Where a file's certificate lies."""
    return path.with_name(path.name + SUFFIX)


def encode(certificate: Certificate) -> bytes:
    """Write a certificate.

    Raises
    ------
    CertificateError
        Nothing is proved of the whole, so there is none to write.
    """
    if not certificate.proved:
        raise CertificateError("Nothing is proved, so there is no certificate to write.")
    axes = certificate.axes
    document = {
        "format": FORMAT,
        "spec_sha256": certificate.spec_sha256,
        "artefact_sha256": certificate.artefact_sha256,
        **certificate.to_dict(),
        "axes": {
            name: getattr(axes, name).tolist() for name in ("knots", "position", "velocity", "acceleration")
        },
        "parts": [[list(part) for part in box] for box in certificate.boxes],
        "terms": list(certificate.terms),
        "motions": [{"quanta": list(one.quanta), **one.packed} for one in certificate.motions],
        "scales": pack(certificate.scales.astype("<f8"), 2),
    }
    return (json.dumps(document, allow_nan=False) + "\n").encode("ascii")


def parse(content: bytes) -> Certificate:
    """Read a certificate, without believing it.

    Raises
    ------
    CertificateError
        It is none, or damaged.
    """
    try:
        document = json.loads(content)
        if not isinstance(document, dict) or document.get("format") != FORMAT:
            raise CertificateError(f"This is no certificate that can be read here ({FORMAT!r}).")
        axes = {name: np.array(document["axes"][name], dtype=np.float64) for name in document["axes"]}
        scales = unpack(document["scales"], "<f8", 2)
        return Certificate(
            spec_sha256=str(document["spec_sha256"]),
            artefact_sha256=str(document["artefact_sha256"]),
            ranges={name: (float(low), float(high)) for name, (low, high) in document["ranges"].items()},
            arrival=float(document["from_s"]),
            until=float(document["until_s"]),
            limits=_numbers(document["limits_m"]),
            bounds=_numbers(document["bounds_m"]),
            seen=_numbers(document["largest_met_m"]),
            share=float(document["share_proved"]),
            axes=AxisMotion(**axes),
            boxes=tuple(tuple(_part(*part) for part in box) for box in document["parts"]),
            terms=_terms(document),
            motions=tuple(_motions(document)),
            scales=scales if scales.ndim == 5 else scales[..., None],
        )
    except (
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
        OverflowError,
        binascii.Error,
        zlib.error,
    ) as error:
        raise damaged(error) from error


def damaged(error: Exception) -> CertificateError:
    """Say that a certificate is damaged, and how."""
    return CertificateError(f"The certificate is damaged ({error}); certify the file again.")


def _terms(document: Mapping[str, Any]) -> tuple[int, ...]:
    """Tell how many terms series have in each parameter; the first certificates did not state it."""
    if "terms" in document:
        return tuple(int(count) for count in document["terms"])
    ranges = len(document["ranges"])
    return (FIRST_TERMS[min(ranges, len(FIRST_TERMS) - 1)],) * ranges


def _motions(document: Mapping[str, Any]) -> Iterator[Motions]:
    """List the motions of every box; the first certificates held them all in one array of 32 bits."""
    if "motions" in document:
        for one in document["motions"]:
            yield Motions(quanta=tuple(one["quanta"]), packed={key: one[key] for key in ("shape", "zlib")})
    else:
        quanta = np.array(document["quanta"], dtype=np.float64)[:, None, None]
        for whole in unpack(document["coefficients"], "<i4", 2):
            yield Motions.of(whole * quanta)


def _part(level: int, index: int) -> tuple[int, int]:
    if not (isinstance(level, int) and isinstance(index, int) and 0 <= level <= MOST_HALVINGS):
        raise ValueError("a box of no such kind")
    return level, index


def _numbers(named: Mapping[str, Any]) -> dict[str, float]:
    return {str(name): float(value) for name, value in named.items()}
