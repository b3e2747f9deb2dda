"""Whether a machine from outside is what the project expects of one."""

import re
from collections import Counter
from collections.abc import Iterator

import numpy as np

from gen_profile.plants.plant import Plant
from gen_profile.plants.virtual_work import equation_inconsistencies

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
TYPE = re.compile(r"[A-Za-z0-9][A-Za-z0-9 _-]*")
IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
RESERVED = ("type", "file", "file_sha256")  # keys of a spec's [plant] that are no parameters
RESIDUAL_FORCE = 1e-9  # of the terms' size: what may push the machine at rest


def faults_of(plant: Plant) -> tuple[str, ...]:
    """Say what is wrong with a machine, a clause each; nothing where it is sound."""
    return tuple(_form(plant)) or tuple(_values(plant))


def _form(plant: Plant) -> Iterator[str]:
    if not TYPE.fullmatch(plant.type):
        yield f"its type {plant.type!r} must be letters, digits, spaces, _ and -"
    texts = {kind: names for kind in ("loads", "bodies") if isinstance(names := getattr(plant, kind), str)}
    yield from (f"its {kind} must be several: write ({name!r},)" for kind, name in texts.items())
    if texts:
        return
    coordinates = [q.name for q in (*plant.actuated, *plant.unactuated)]
    for kind, names, pattern in (
        ("parameter", [q.name for q in plant.parameters], IDENTIFIER),
        ("coordinate", coordinates, NAME),
        ("load", list(plant.loads), NAME),
        ("moving part", list(plant.bodies), NAME),
    ):
        for name, count in Counter(names).items():
            if not pattern.fullmatch(name) or name in RESERVED:
                yield f"{name!r} cannot name a {kind}: use letters, digits and _, and a letter first"
            if count > 1:
                yield f"{count} {kind}s are named {name!r}"
    for parameter in plant.parameters:
        if not parameter.lower <= parameter.nominal <= parameter.upper:
            yield f"the nominal value of {parameter.name} is not within its bounds"
    for coordinate in (*plant.actuated, *plant.unactuated):
        if coordinate.unit not in {"m", "rad"}:
            yield f"the unit of {coordinate.name} must be 'm' or 'rad', found {coordinate.unit!r}"
    if not (plant.actuated and plant.unactuated and plant.loads):
        yield "it needs at least one actuated coordinate, one unactuated one, and one load"
    elif not 1 <= plant.directions <= len(plant.loads):
        yield f"directions must be from 1 to the number of loads, found {plant.directions}"


def _values(plant: Plant) -> Iterator[str]:
    """Evaluate the equations at rest, with the nominal parameters."""
    n_u, m, loads = len(plant.unactuated), len(plant.actuated), len(plant.loads)
    probe, p = plant.probe()
    try:
        with np.errstate(all="ignore"):
            terms = plant.equations([0.0] * n_u, [0.0] * n_u, probe, [0.0] * m, p)
            outputs = plant.outputs([0.0] * n_u, probe, p)
            mechanics = plant.mechanics([0.0] * n_u, probe, p)
        values = {
            "M_uu": (terms.M_uu, (n_u, n_u)),
            "M_au": (terms.M_au, (m, n_u)),
            "K_u": (terms.K_u, (n_u,)),
            "G_u": (terms.G_u, (n_u,)),
            "sway": (outputs.sway, (loads,)),
            "height": (outputs.height, (loads,)),
            "angle": (outputs.angle, (loads,)),
            "mass": (mechanics.mass, (len(plant.bodies),)),
            "place": (mechanics.place, (len(plant.bodies), 3) if plant.bodies else (0,)),
            "gravity": (mechanics.gravity, ()),
            "springs": (mechanics.springs, ()),
        }
        arrays = {name: (np.array(value, dtype=np.float64), shape) for name, (value, shape) in values.items()}
    except Exception as error:
        yield f"its equations fail with its nominal parameters: {type(error).__name__}: {error}"
        return
    faulty = [
        f"{name} must be {' × '.join(map(str, shape))} finite numbers, found the shape "
        f"{' × '.join(map(str, array.shape)) or 'of one number'}"
        for name, (array, shape) in arrays.items()
        if array.shape != shape or not np.isfinite(array).all()
    ]
    yield from faulty
    if faulty:
        return
    mass, pushing = arrays["M_uu"][0], np.abs(arrays["K_u"][0] + arrays["G_u"][0]).max()
    if np.linalg.matrix_rank(mass) < n_u:
        yield "M_uu is singular at rest: an unactuated coordinate has no inertia"
    elif pushing > RESIDUAL_FORCE * max(1.0, np.abs(mass).max()):
        yield "it does not rest at q_u = 0: count the unactuated coordinates from the place at rest"
    elif np.abs(arrays["sway"][0]).max() > RESIDUAL_FORCE:
        yield "its sway at rest is not zero: count it from the loads' places at rest"
    elif plant.bodies:
        try:
            with np.errstate(all="ignore"):
                yield from equation_inconsistencies(plant)
        except Exception as error:
            yield f"its equations fail where it swings: {type(error).__name__}: {error}"
