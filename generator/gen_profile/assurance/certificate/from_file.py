"""Certificates of artefacts that lie on disk: made, and checked again."""

import math
import zlib
from collections.abc import Sequence
from functools import partial
from math import isclose
from pathlib import Path

import attrs
import numpy as np

from gen_profile.assurance.certificate.arithmetic.balls import Array
from gen_profile.assurance.certificate.axes.setpoint_limits import Asked, asked_of_axes
from gen_profile.assurance.certificate.boxes import covers
from gen_profile.assurance.certificate.certify import SLACK, Attempt, Progress, attempt
from gen_profile.assurance.certificate.document import Certificate, certificate_path, damaged, encode, parse
from gen_profile.assurance.certificate.in_order import in_order
from gen_profile.assurance.certificate.rechecking import not_covered
from gen_profile.assurance.certificate.sway_limits import (
    ProvedClearance,
    ProvedSway,
    SwayBounds,
    limits_of,
    unproved,
)
from gen_profile.assurance.certificate.theorem import SAME_TIME, Theorem, ranges_of
from gen_profile.assurance.verification.origin import spec_and_manifest
from gen_profile.assurance.verification.plausibility import another_move
from gen_profile.motion.profile import SampledProfile
from gen_profile.spec.model import Spec
from gen_profile.support.artefacts.manifest import sha256
from gen_profile.support.artefacts.reading import read_artefact, read_motion, require_companions
from gen_profile.support.artefacts.writing import deliver, require_place
from gen_profile.support.errors import CertificateError
from gen_profile_exporters.exporter import target_of
from gen_profile_exporters.registry import find_exporter, format_of


@attrs.frozen(kw_only=True, eq=False)
class _Artefact:
    """What a certificate is about."""

    path: Path
    sha256: str
    spec: Spec
    spec_sha256: str
    setpoints: SampledProfile


def certify_artefact(
    path: Path, spec: Spec | None = None, *, progress: Progress = lambda _, __: None
) -> Certificate:
    """Prove that no machine of a spec's ranges sways more than a bound after a file's motion.

    Raises
    ------
    CertificateError
        No proof is written for this machine, or what the spec asks; or setpoints break limits of the axes.
    OutputError, ExportError, SpecError, CosimulationError
    """
    artefact = _read(path, spec)
    require_place(certificate_path(artefact.path))  # before there is a proof to lose
    asked = asked_of_axes(artefact.spec, artefact.setpoints)
    certificate = _certificate(artefact, asked, attempt(artefact.spec, artefact.setpoints, progress))
    if certificate.proved:
        deliver(certificate_path(artefact.path), encode(certificate))
    return certificate


def check_certificate(
    path: Path,
    certificate: Path,
    spec: Spec | None = None,
    *,
    progress: Progress = lambda _, __: None,
) -> Certificate:
    """Prove again what a certificate says of a file, with nothing solved and nothing believed of it.

    Raises
    ------
    CertificateError
        It is damaged, is about something else, or proves less than it says.
    OutputError, ExportError, SpecError
    """
    artefact = _read(path, spec)
    claimed = parse(read_artefact(certificate))
    theorem = _require_about(claimed, artefact)
    nearer = [] if claimed.clearance is None else [claimed.clearance.nearer]
    stated = np.array([*(sway.bound for sway in claimed.sways), *nearer], dtype=np.float64)
    bounds, largest_met, done = np.zeros(len(stated)), np.zeros(len(stated)), 0
    for count, again in in_order(
        partial(_bound_again, theorem, claimed, stated), theorem.batches(range(len(claimed.boxes)))
    ):
        bounds = np.maximum(bounds, again.sway.max(axis=0))  # which keeps nan
        largest_met = np.fmax(largest_met, again.largest_met.max(axis=0))
        done += count
        progress(done, len(claimed.boxes))
    names = [*(sway.limit.load for sway in claimed.sways), "missing clearance"]
    for name, said, bound in zip(names, stated.tolist(), bounds.tolist(), strict=False):
        if math.isnan(bound):
            raise CertificateError(
                f"The certificate does not prove what it says: no bound of the {name} follows "
                f"from its boxes, and it states {1e3 * said:.4g} mm."
            )
        if not bound <= said:
            raise CertificateError(
                f"The certificate does not prove what it says: the {name} is bounded by "
                f"{1e3 * bound:.4g} mm, and it states {1e3 * said:.4g} mm."
            )
    met = zip(claimed.sways, largest_met.tolist(), strict=False)
    sways = tuple(attrs.evolve(sway, largest_met=most) for sway, most in met)
    clearance = claimed.clearance and attrs.evolve(claimed.clearance, largest_met=float(largest_met[-1]))
    return attrs.evolve(
        claimed,
        sways=sways,
        clearance=clearance,
        not_rechecked=not_covered(artefact.path, artefact.spec),
        unproved=unproved(artefact.spec),
    )


def _bound_again(
    theorem: Theorem, claimed: Certificate, targets: Array, rows: Sequence[int]
) -> tuple[int, SwayBounds]:
    """Carry the proof out again for some boxes: how many, and their bounds.

    Raises
    ------
    CertificateError
    """
    boxes, scales = ([part[row] for row in rows] for part in (claimed.boxes, claimed.scales))
    try:
        coefficients = np.stack([claimed.motions[row].coefficients() for row in rows])
    except (ValueError, TypeError, KeyError, zlib.error) as error:
        raise damaged(error) from error
    theorem.require_shapes(boxes, coefficients, np.array(scales))
    return len(boxes), theorem.enclosure(boxes, coefficients, np.array(scales)).bounds(targets)


def _read(path: Path, spec: Spec | None) -> _Artefact:
    content = read_motion(path)
    spec, manifest, digest = spec_and_manifest(path, content, spec)
    require_companions(manifest, path, content)
    setpoints = find_exporter(format_of(path)).replay(content, target_of(spec))
    for sentence in another_move(spec, setpoints):
        raise CertificateError(sentence)
    return _Artefact(path=path, sha256=sha256(content), spec=spec, spec_sha256=digest, setpoints=setpoints)


def _certificate(artefact: _Artefact, asked: Asked, result: Attempt) -> Certificate:
    """State what came out."""
    theorem = result.theorem
    bounds, met = [None] * len(theorem.allowed), result.largest_met.tolist()
    if result.boxes:
        bounds = (result.bounds.max(axis=0) * (1.0 + SLACK)).tolist()
    sways = zip(theorem.limits, bounds, met, strict=False)
    clearance = None
    if artefact.spec.path is not None:
        clearance = ProvedClearance(nearer=bounds[-1], largest_met=met[-1])
    return Certificate(
        spec_sha256=artefact.spec_sha256,
        artefact_sha256=artefact.sha256,
        ranges=theorem.ranges.ends,
        arrival=theorem.arrival,
        until=theorem.until,
        asked=asked,
        sways=tuple(
            ProvedSway(limit=limit, bound=bound, largest_met=largest_met)
            for limit, bound, largest_met in sways
        ),
        clearance=clearance,
        fraction=result.fraction,
        axes=theorem.axes,
        boxes=result.boxes,
        terms=theorem.terms,
        motions=result.motions,
        scales=result.scales,
        reached=result.reached,
        rounded=bool(artefact.setpoints.resolution.any()),
        not_rechecked=not_covered(artefact.path, artefact.spec),
        unproved=unproved(artefact.spec),
    )


def _require_about(claimed: Certificate, artefact: _Artefact) -> Theorem:
    """Refuse a certificate of anything else, or of a part of it.

    Raises
    ------
    CertificateError
    """
    if claimed.artefact_sha256 != artefact.sha256:
        raise CertificateError(
            f"The certificate is about another file than {artefact.path}, or that was altered."
        )
    if claimed.spec_sha256 != artefact.spec_sha256:
        raise CertificateError("The certificate is about another spec: other machines or limits.")
    theorem = Theorem(
        spec=artefact.spec,
        setpoints=artefact.setpoints,
        ranges=ranges_of(artefact.spec),
        limits=tuple(sway.limit for sway in claimed.sways),
        axes=claimed.axes,
        terms=claimed.terms,
    )
    if claimed.asked != asked_of_axes(artefact.spec, artefact.setpoints):
        raise CertificateError("The certificate does not prove what it says of the setpoints.")
    if not len(claimed.boxes) == len(claimed.motions) == len(claimed.scales):
        raise CertificateError("The certificate is damaged: its arrays do not fit together.")
    whole = dict(claimed.ranges) == theorem.ranges.ends and covers(claimed.boxes)
    same = theorem.limits == limits_of(artefact.spec)
    same = same and (claimed.clearance is None) == (artefact.spec.path is None)
    if not (whole and same and claimed.proved):
        raise CertificateError("The certificate does not cover all machines and limits of the spec.")
    watched = (
        isclose(claimed.until, theorem.until, rel_tol=SAME_TIME) and claimed.until <= claimed.axes.knots[-1]
    )
    if not watched or claimed.arrival != theorem.arrival:
        raise CertificateError("The certificate is about another time.")
    return theorem
