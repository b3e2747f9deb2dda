"""Proved clearances, against places that are finely divided and a pendulum written down independently."""

import json
from pathlib import Path

import attrs
import numpy as np
import pytest
from generator.quay import ROPE, STACKS, followed, quay, shortage
from numpy.polynomial import chebyshev as series_of
from scipy.optimize import brentq

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


@pytest.mark.slow
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


def higher(plan, height):
    stacks = [*STACKS[:2], [25.0, 27.5, height], *STACKS[3:]]
    return quay(stacks, move={"duration": plan.motion.duration})


@pytest.fixture(scope="module")
def lacking(plan):
    """By how much the worst rope's load is too near, as the highest stack's height says."""
    near = plan.passage.nearest.time
    times = np.linspace(near - 0.3, near + 0.3, 60001)
    ways = [followed(plan.motion, rope * ROPE, times)[:2] for rope in np.linspace(0.9, 1.1, 5)]
    return lambda height: max(shortage(*way, higher(plan, height).path, 0.0, 36.0) for way in ways)


def height_of(lacking, missing):
    return brentq(lambda height: lacking(height) - missing, 18.2, 18.3, xtol=1e-6)


def certified(plan, folder, height):
    """A file of the plan's motion, and what is proved of it where the highest stack is another."""
    spec = higher(plan, height)
    gp.design(quay(), ["csv"], folder)  # plan.spec has a duration, in which another motion is smoother
    path = folder / "quay.csv"
    return spec, path, gp.certify_artefact(path, spec)


@pytest.mark.slow
@pytest.mark.parametrize("missing", [None, 2.5e-4, 2e-3])
def test_the_bound_is_just_above_what_the_worst_rope_lacks(plan, lacking, tmp_path, missing):
    height = 18.2 if missing is None else height_of(lacking, missing)
    *_, certificate = certified(plan, tmp_path, height)
    worst = max(0.0, lacking(height))
    assert (worst > 0.0) == (missing is not None)
    assert certificate.fraction == 1.0
    nearer = certificate.clearance.nearer
    assert worst <= nearer + 2e-5 and nearer <= worst + 3.0 * CLOSE  # of setpoints, not of the motion
    assert certificate.proved == (nearer <= ROOM_TOLERANCE)
    if not certificate.proved:
        assert any("nearer than path.clearance" in reason for reason in certificate.reasons())


@pytest.mark.slow
def test_a_certificate_holds_again_and_no_greater_claim_does(plan, lacking, tmp_path):
    spec, path, certificate = certified(plan, tmp_path, height_of(lacking, 2.5e-4))
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
