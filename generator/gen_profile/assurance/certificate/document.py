"""A certificate as a file: JSON, its large arrays compressed."""

import json
import zlib
from collections.abc import Iterator, Mapping
from math import inf, nan
from operator import index
from pathlib import Path
from typing import Any

import attrs

from gen_profile.assurance.certificate.arithmetic.balls import Array
from gen_profile.assurance.certificate.axes.axis_motion import AxisMotion
from gen_profile.assurance.certificate.axes.setpoint_limits import Asked
from gen_profile.assurance.certificate.boxes import DyadicBox
from gen_profile.assurance.certificate.packing import Motions, numbers, pack, unpack
from gen_profile.assurance.certificate.sway_limits import ProvedClearance, ProvedSway, SwayLimit
from gen_profile.spec.stacks import ROOM_TOLERANCE
from gen_profile.support.errors import CertificateError
from gen_profile.support.strict_json import parse_json
from gen_profile.support.summary import Summarised

SUFFIX = ".certificate.json"
FORMAT = "gen-profile certificate 1"
MOST_HALVINGS = 50  # of a range, up to which shares of it are exact
CLAIMS = ("bounds_m", "limits_m", "on_the_way", "setpoints", "ranges", "from_s", "until_s")
MATERIAL = ("axes", "parts", "terms", "motions", "scales")  # of the proof
KEYS = {"format", "spec_sha256", "artefact_sha256", *CLAIMS, *MATERIAL}


@attrs.frozen(kw_only=True, eq=False, repr=False)
class Certificate(Summarised):
    """What is proved, of what, and what the proof needs.

    Attributes
    ----------
    spec_sha256, artefact_sha256 : str
        Of what it is proved.
    ranges : mapping of str to (float, float)
        Of the machine's parameters.
    arrival, until : float
        Time in s in which the sway is bounded.
    sways : tuple of ProvedSway
        Of every load after the move, and of the end load on the way where that is limited.
    asked : mapping
        Of the axes, see `gen_profile.assurance.certificate.axes.setpoint_limits.asked_of_axes`.
    fraction : float
        Of the ranges' box, of which the bounds are proved.
    axes : AxisMotion
    boxes : tuple of DyadicBox
    terms : tuple of int
        Of series in each parameter.
    motions : tuple of Motions
        Of every box, for `gen_profile.assurance.certificate.enclosure.Approximation`.
    scales : (boxes, pieces or 1, 2 n_u, 2 n_u, parameter terms or 1) array
        Likewise.
    clearance : ProvedClearance or None
        Of what stands in the way, where the spec states it.
    reached : bool
        Whether a bound was found of any machine, be it by itself.
    rounded : bool
        Whether setpoints are rounded to counts, for the reasons where nothing is proved.
    not_rechecked : tuple of str
        What of it `gen_profile_recheck` does not cover, and so cannot prove again.
    unproved : tuple of str
        Places of the spec's limits of which nothing is proved.
    """

    spec_sha256: str
    artefact_sha256: str
    ranges: Mapping[str, tuple[float, float]]
    arrival: float
    until: float
    sways: tuple[ProvedSway, ...]
    asked: Asked
    fraction: float
    axes: AxisMotion
    boxes: tuple[DyadicBox, ...]
    terms: tuple[int, ...]
    motions: tuple[Motions, ...]
    scales: Array
    clearance: ProvedClearance | None = None
    reached: bool = True
    rounded: bool = False
    not_rechecked: tuple[str, ...] = ()
    unproved: tuple[str, ...] = ()

    def summary(self) -> dict[str, object]:
        """Tell what a reader looks for first."""
        return {
            "proved": self.proved,
            "ranges": ", ".join(
                f"{name} {low:.4g} to {high:.4g}" for name, (low, high) in self.ranges.items()
            ),
            "at most": ", ".join(f"{load} {1e3 * bound:.4g} mm" for load, bound in self.bounds.items())
            or "unknown",
        }

    @property
    def proved(self) -> bool:
        """Whether every machine of the ranges keeps the limits."""
        return self.fraction == 1.0 and not self.reasons()

    def reasons(self) -> tuple[str, ...]:
        """Say what is not proved, a sentence each."""
        if self.fraction < 1.0:
            coarse, cause = "", ""
            if self.rounded:
                cause = ", or positions are rounded to counts that are too coarse for a bound"
                coarse = (
                    "count positions more finely (axis.counts_per_metre), or issue them in a longer cycle "
                    "(export.cycle_time)"
                )
            if not self.reached:
                return (
                    "No bound was found, not even of one machine in the middle of the ranges by itself: what "
                    "a proof adds up grows too much over this motion, as with a hook block on a rope that is "
                    f"hoisted{cause}. Narrower ranges are no help{coarse and f'; {coarse}'}.",
                )
            return (
                f"Bounds are proved for {100.0 * self.fraction:.3g} % of the machines; others swing too far, "
                f"or differ too much{cause}: narrow the ranges (check.uncertain), or take more time"
                f"{coarse and f', or {coarse}'}.",
            )
        reasons = [sway.reason for sway in self.sways]
        if self.clearance is not None:
            reasons.append(self.clearance.reason)
        return tuple(reason for reason in reasons if reason is not None)

    def warnings(self) -> tuple[str, ...]:
        """Say which limits it does not speak of, and that it, if it is one, cannot be proved again."""
        silent = tuple(
            f"{place}: nothing is proved of it; the check judges it on the machines that it tries."
            for place in self.unproved
        )
        if not (self.proved and self.not_rechecked):
            return silent
        what = ", ".join(self.not_rechecked)
        return (
            *silent,
            f"The re-checker (gen_profile_recheck) does not cover {what}: it will refuse this certificate, "
            "and only gen-profile check --certificate proves it again.",
        )

    @property
    def demand(self) -> float:
        """Share of its limit that the worst sway is proved to take up at most; infinite without a bound."""
        whole = self.fraction == 1.0
        return max(
            sway.bound / sway.limit.allowed if whole and sway.bound is not None else inf
            for sway in self.sways
        )

    @property
    def after(self) -> tuple[ProvedSway, ...]:
        """What is proved of every load after the move."""
        return tuple(sway for sway in self.sways if not sway.limit.on_the_way)

    @property
    def on_the_way(self) -> ProvedSway | None:
        """What is proved of the end load on the way."""
        return next((sway for sway in self.sways if sway.limit.on_the_way), None)

    @property
    def limits(self) -> dict[str, float]:
        """Allowed residual sway in m of every load."""
        return {sway.limit.load: sway.limit.allowed for sway in self.after}

    @property
    def largest_met(self) -> dict[str, float]:
        """Greatest residual sway in m of every load that was met; of it nothing is proved."""
        return {sway.limit.load: sway.largest_met for sway in self.after}

    @property
    def bounds(self) -> dict[str, float]:
        """Proved residual sway in m of every load, of all machines that there are any of."""
        return {sway.limit.load: sway.bound for sway in self.after if sway.bound is not None}

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON, without what only the proof needs."""
        way = self.on_the_way
        return {
            "proved": self.proved,
            "bounds_m": self.bounds,
            "limits_m": self.limits,
            "largest_met_m": self.largest_met,
            "on_the_way": None
            if way is None
            else {
                "load": way.limit.load,
                "bound_m": way.bound,
                "limit_m": way.limit.allowed,
                "largest_met_m": way.largest_met,
            },
            "clearance": None if self.clearance is None else self.clearance.to_dict(),
            "setpoints": self.asked,
            "ranges": {name: list(ends) for name, ends in self.ranges.items()},
            "share_proved": self.fraction,
            "boxes": len(self.boxes),
            "from_s": self.arrival,
            "until_s": self.until,
            "reasons": list(self.reasons()),
            "not_rechecked": list(self.not_rechecked),
        }


def certificate_path(path: Path) -> Path:
    """Where a file's certificate lies."""
    return path.with_name(path.name + SUFFIX)


def encode(certificate: Certificate) -> bytes:
    """Write a certificate: what it claims and the proof's material, and nothing that is not proved again.

    Raises
    ------
    CertificateError
        Nothing is proved of the whole, so there is none to write.
    """
    if not certificate.proved:
        raise CertificateError("Nothing is proved, so there is no certificate to write.")
    axes, said = certificate.axes, certificate.to_dict()
    if said["on_the_way"] is not None:
        del said["on_the_way"]["largest_met_m"]
    document = {
        "format": FORMAT,
        "spec_sha256": certificate.spec_sha256,
        "artefact_sha256": certificate.artefact_sha256,
        **{name: said[name] for name in CLAIMS},
        "axes": {
            name: getattr(axes, name).tolist() for name in ("knots", "position", "velocity", "acceleration")
        },
        "parts": [[list(part) for part in box] for box in certificate.boxes],
        "terms": list(certificate.terms),
        "motions": [{"quanta": list(one.quanta), **one.packed} for one in certificate.motions],
        "scales": pack(certificate.scales.astype("<f8"), 2),
    }
    if said["clearance"] is not None:
        del said["clearance"]["largest_met_m"]
        document["clearance"] = said["clearance"]
    return (json.dumps(document, allow_nan=False) + "\n").encode("ascii")


def parse(content: bytes) -> Certificate:
    """Read a certificate, without believing it: as one that proves all it claims, of all machines.

    Raises
    ------
    CertificateError
        It is none, or damaged, or claims what is not proved again.
    """
    try:
        document = parse_json(content)
        if not isinstance(document, dict) or document.get("format") != FORMAT:
            raise CertificateError(f"This is no certificate that can be read here ({FORMAT!r}).")
        if wrong := sorted(KEYS ^ (document.keys() - {"clearance"})):
            raise ValueError(f"{', '.join(wrong)} missing, or of no certificate")
        axes = {name: numbers(nested) for name, nested in document["axes"].items()}
        return Certificate(
            spec_sha256=str(document["spec_sha256"]),
            artefact_sha256=str(document["artefact_sha256"]),
            ranges={name: (_number(low), _number(high)) for name, (low, high) in document["ranges"].items()},
            arrival=_number(document["from_s"]),
            until=_number(document["until_s"]),
            sways=tuple(_sways(document)),
            clearance=_clearance(document.get("clearance")),
            asked=document["setpoints"],
            fraction=1.0,
            axes=AxisMotion(**axes),
            boxes=tuple(tuple(_part(*part) for part in box) for box in document["parts"]),
            terms=tuple(map(index, document["terms"])),
            motions=tuple(
                Motions(quanta=tuple(one.pop("quanta")), packed=one) for one in document["motions"]
            ),
            scales=unpack(document["scales"], "<f8", 2),
        )
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, zlib.error) as error:
        raise damaged(error) from error


def damaged(error: Exception) -> CertificateError:
    """Say that a certificate is damaged, and how."""
    words = "The certificate is damaged, or of another version of gen-profile"
    return CertificateError(f"{words} ({error}); certify the file again.")


def _number(value: Any) -> float:
    return float(value + 0.0)  # which raises of a text


def _part(level: int, number: int) -> tuple[int, int]:
    if not 0 <= index(level) <= MOST_HALVINGS:
        raise ValueError("a box of no such kind")
    return index(level), index(number)


def _clearance(claim: Any) -> ProvedClearance | None:
    if claim is None:
        return None
    if claim.keys() != {"nearer_m", "allowed_m"} or claim["allowed_m"] != ROOM_TOLERANCE:
        raise ValueError("a clearance of another kind")
    return ProvedClearance(nearer=_number(claim["nearer_m"]), largest_met=nan)


def _sways(document: Mapping[str, Any]) -> Iterator[ProvedSway]:
    """List the bounds that are claimed; what was met is for the proof to tell."""
    limits, bounds, way = (document[name] for name in ("limits_m", "bounds_m", "on_the_way"))
    if limits.keys() != bounds.keys() or (way is not None and way.keys() != {"load", "limit_m", "bound_m"}):
        raise ValueError("bounds of other loads than the limits'")
    for load, allowed in limits.items():
        limit = SwayLimit(load=load, allowed=_number(allowed))
        yield ProvedSway(limit=limit, bound=_number(bounds[load]), largest_met=nan)
    if way is not None:
        limit = SwayLimit(load=str(way["load"]), allowed=_number(way["limit_m"]), on_the_way=True)
        yield ProvedSway(limit=limit, bound=_number(way["bound_m"]), largest_met=nan)
