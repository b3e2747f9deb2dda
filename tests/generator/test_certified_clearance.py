"""Proved clearances, against places that are finely divided and a pendulum written down independently."""

import json
from pathlib import Path

import attrs
import numpy as np
import pytest
from generator.quay import ROPE, STACKS, followed, quay, shortage
from numpy.polynomial import chebyshev as series_of

import gen_profile as gp
from gen_profile.assurance.certificate.clearance import CLOSE, least_room
from gen_profile.spec.plan_view import Area
from gen_profile.spec.stacks import ROOM_TOLERANCE, StackZone
from gen_profile.support.errors import CertificateError
from gen_profile_recheck.check import check
from gen_profile_recheck.reading import NotProvedError

FINE = np.linspace(-1.0, 1.0, 1201)
COARSE = 0.01  # by which the least may be elsewhere than at one of the grid's places
LINE = Area((-0.6, 0.9))
BOX = Area((-0.6, 0.9), (-0.4, 0.5))
HERE = Area((0.1, 0.5), (-0.1, 0.3))


@pytest.mark.parametrize(
    "zone",
    [
        StackZone(obstacle=0, body=0, area=LINE, top=0.3),
        StackZone(obstacle=0, body=0, area=LINE, top=0.3, overhead=True),
        StackZone(obstacle=0, body=0, area=BOX, top=0.3),
        StackZone(obstacle=0, body=0, area=BOX, top=0.3, own=(HERE,)),
    ],
    ids=["band", "overhead", "box", "stood upon"],
)
def test_the_least_room_is_that_of_finely_divided_times_and_parameters(zone):
    random, off = np.random.default_rng(8), 1e-3
    decays = 0.5 ** np.add.outer(np.arange(7), 2.0 * np.arange(3))
    close = 0
    for _ in range(25):
        places = random.uniform(-1.0, 1.0, (3, 7, 3)) * decays
        grid = FINE[:, None], np.linspace(-1.0, 1.0, 201)[None]
        x, y, z = (series_of.chebval2d(*np.broadcast_arrays(*grid), one) for one in places)
        least = float(np.maximum(zone.beside(x, y), zone.clear(z)).min())
        moved = attrs.evolve(zone, top=zone.top + random.uniform(0.0, 2.0) * (-1.0) ** zone.overhead * least)
        least = float(np.maximum(moved.beside(x, y), moved.clear(z)).min())
        bound, met = least_room(places[None], np.full((1, 3), off), moved)
        assert bound <= min(least, met)
        assert bound >= min(0.0, least - 4.0 * off - COARSE)  # places are off, twice where it is at a corner
        close += -0.2 < least < 0.2
    assert close > 5


def test_what_is_not_finite_proves_nothing():
    zone = StackZone(obstacle=0, body=0, area=LINE, top=0.3)
    assert np.isnan(least_room(np.full((1, 3, 4), np.nan), np.zeros((1, 3)), zone)[0])
    assert np.isnan(least_room(np.zeros((1, 3, 4)), np.full((1, 3), np.inf), zone)[0])


@pytest.fixture(scope="module")
def plan():
    return gp.plan(quay())


def certified(plan, folder, height, **tables):
    """A file of the plan's motion, and what is proved of it where the highest stack is another."""
    stacks = [*STACKS[:2], [25.0, 27.5, height], *STACKS[3:]]
    spec = quay(stacks, move={"duration": plan.motion.duration}, **tables)
    gp.design(plan.spec, ["csv"], folder)
    path = folder / "quay.csv"
    return spec, path, gp.certify_artefact(path, spec)


@pytest.mark.slow
@pytest.mark.parametrize("higher", [0.0, 0.0138, 0.016])
def test_the_bound_is_just_above_what_the_worst_rope_lacks(plan, tmp_path, higher):
    spec, _, certificate = certified(plan, tmp_path, 18.2 + higher)
    times = np.linspace(13.2, 13.7, 50001)  # about when it passes the highest stack's edge
    lacking = [
        shortage(*followed(plan.motion, rope * ROPE, times)[:2], spec.path, 0.0, 36.0)
        for rope in np.linspace(0.9, 1.1, 5)
    ]
    worst = max(0.0, *lacking)
    assert (worst > 0.0) == (higher > 0.0)
    assert certificate.fraction == 1.0
    nearer = certificate.clearance.nearer
    assert worst <= nearer + 2e-5 and nearer <= worst + 3.0 * CLOSE  # of setpoints, not of the motion
    assert certificate.proved == (nearer <= ROOM_TOLERANCE)
    if not certificate.proved:
        assert any("nearer than path.clearance" in reason for reason in certificate.reasons())


@pytest.mark.slow
def test_a_certificate_holds_again_and_no_greater_claim_does(plan, tmp_path):
    spec, path, certificate = certified(plan, tmp_path, 18.2138)
    assert certificate.proved and 0.0 < certificate.clearance.nearer < ROOM_TOLERANCE
    assert certificate.not_rechecked == ("the clearance of a path",)
    beside = Path(f"{path}.certificate.json")
    again = gp.check_certificate(path, beside, spec)
    assert again.clearance == attrs.evolve(certificate.clearance)
    document = json.loads(beside.read_text("utf-8"))
    assert document["clearance"] == {"nearer_m": certificate.clearance.nearer, "allowed_m": ROOM_TOLERANCE}
    claims = [{"nearer_m": 1e-5, "allowed_m": ROOM_TOLERANCE}, None, {"nearer_m": 1e-5, "allowed_m": 1.0}]
    for claim in claims:
        beside.write_text(json.dumps({**document, "clearance": claim}), "utf-8")
        with pytest.raises(CertificateError):
            gp.check_certificate(path, beside, spec)


@pytest.mark.slow
def test_the_rechecker_refuses_it(plan, tmp_path):
    _, path, _ = certified(plan, tmp_path, 18.2)
    beside, manifest = Path(f"{path}.certificate.json"), path.with_name("manifest.json")
    with pytest.raises(NotProvedError, match="not covered: the clearance"):
        check(path.read_bytes(), manifest.read_bytes(), beside.read_bytes())
