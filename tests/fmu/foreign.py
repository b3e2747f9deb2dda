"""FMUs of a customer's, which are ours in disguise, and jobs for them."""

import io
import zipfile
from functools import cache

import attrs
import numpy as np
from fmu.kinds import machine_of

from gen_profile.plants.registry import find_plant
from gen_profile.spec.reading import preset_spec, spec_from_dict
from gen_profile_fmu.building.build import build_fmu
from gen_profile_fmu.building.platforms import host_platform
from gen_profile_fmu.description.fmu_files import Version
from gen_profile_fmu.model.contents import plant_model
from gen_profile_fmu.model.plant_variables import InputKind
from gen_profile_fmu.running.external_fmu import ForeignRun

CRANE = find_plant("double-pendulum-crane")
NAMES = {
    "acceleration": "cart.setpoint_acceleration",
    "velocity": "cart.setpoint_velocity",
    "setpoint": "cart.setpoint",
}


def write_fmu(path, *variant, **replacements):
    """A customer's FMU; `replacements` change the text of plant_model.c."""
    path.write_bytes(built_fmu(*variant, **replacements))
    return path


@cache
def built_fmu(kind="acceleration", version=Version.FMI2, **replacements):
    model = plant_model(machine_of(CRANE), InputKind(kind), "customer")
    code = dict(model.code)
    for old, new in replacements.items():
        text = code["plant_model.c"]
        assert old in text
        code["plant_model.c"] = "#include <stdlib.h>\n" + text.replace(old, new)
    return build_fmu(attrs.evolve(model, code=code), version, (host_platform(),))


def spec_with(folder, kind="acceleration", **check):
    document = preset_spec("paper", ("export.cycle_time=0.01",)).to_dict()
    document["check"] |= {
        "fmu": "customer.fmu",
        "input": {kind: NAMES[kind]},
        "output": {"sway": {"hook": "sway.hook", "payload": "sway.payload"}},
        "parameters": {"L1": "L1"},
        **check,
    }
    return spec_from_dict(document, folder)


def run_of(path, **changes):
    given = {
        "archive": path,
        "times": np.linspace(0.0, 0.1, 11),
        "inputs": np.full((10, 1), 0.1),
        "input_names": ["cart.setpoint_acceleration"],
        "output_names": ["sway.payload"],
        "machines": [{"L1": 0.5}],
        "si_units": {"cart.setpoint_acceleration": "m/s^2", "sway.payload": "m", "L1": "m"},
        "stated_units": {},
        "parameters": {},
        "step": None,
        "time_limit": 60.0,
    }
    return ForeignRun(**{**given, **changes})


def with_description(path, change):
    """Rewrite an FMU's model description."""
    packed = io.BytesIO()
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(packed, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            new.writestr(name, change(content) if name == "modelDescription.xml" else content)
    path.write_bytes(packed.getvalue())
