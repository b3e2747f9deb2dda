"""Axes and frequency converters on which wrappers of the planner block run, the block itself compiled."""

import attrs
import numpy as np
from exporters.counted_block import CountedBlock, compile_counting
from exporters.driven_block import CYCLE
from exporters.st_interpreter import FunctionBlock
from exporters.vendor_axes import Bench

from gen_profile_exporters import motion_libraries
from gen_profile_exporters.planner.axis_wrapper import INTERFACE, planner_wrapper

ON = {"bPower": True, "bEnable": True}
START = 4.0  # m
UNITS = -1000.0  # the axis counts mm the other way


def interface_of(source):
    """A planner block without what it does."""
    declared = tuple(one for one in source.variables if one.section in INTERFACE)
    return attrs.evolve(source, variables=declared, body="", within=())


class Compiled:
    """The planner block in place of its interpreted instance."""

    def __init__(self, source):
        self.block = CountedBlock(compile_counting(source.text()), bEnable=0.0)
        self.names = {name.lower(): name for name in self.block.inputs}
        self.outputs = dict.fromkeys((name.lower() for name in self.block.outputs), 0)

    def call(self, **inputs):
        self.block.inputs |= {self.names[name]: float(value) for name, value in inputs.items()}
        kinds = {"b": bool, "n": int}
        issued = self.block.step()
        self.outputs = {name.lower(): kinds.get(name[0], float)(value) for name, value in issued.items()}

    def __getitem__(self, name):
        return self.outputs[name.lower()]


class PlannerBench(Bench):
    """A wrapper of a planner block on a vendor's axes."""

    def __init__(self, vendor, source, units, starts):
        wrapper = planner_wrapper(source, units, vendor.library)
        super().__init__(vendor, wrapper, interface_of(source), [f"Axis{n}" for n in units], starts)
        self.wrapper.alter("fbPlanner", None, Compiled(source))
        self.homed = [f"bHomed{n}" for n in units if vendor.library is motion_libraries.CODESYS]
        self.given |= dict.fromkeys(self.homed, True)
        for axis in self.axes:
            self.put(axis, vendor.off)
        self.bring([at * unit for at, unit in zip(starts, units.values(), strict=True)])
        self.commanded = self.commanded[-1:]

    def guided(self, **inputs):
        """Take the axes over."""
        return self.until(lambda row: row["benabled"], most=40, **ON, **inputs)

    def positions(self):
        """What the axes were commanded, in m."""
        return np.array(self.commanded) / UNITS


class Converter:
    """A frequency converter and its axis: it runs some cycles after it is switched on, lags, and slips."""

    def __init__(self, source, lag=0.05, slip=0.02):
        self.wrapper = FunctionBlock(
            planner_wrapper(source, {"": 1.0}, motion_libraries.VELOCITY).text(),
            (interface_of(source).text(),),
        )
        self.wrapper.alter("fbPlanner", None, Compiled(source))
        self.lag, self.slip = lag, slip
        self.position, self.velocity, self.cycles = START, 0.0, 0
        self.failed = False
        self.measured = lambda: self.position
        self.given = {"bHomed": True, "fGain": 1.5, "fCorrection": 0.1, "fFollowingLimit": 0.1}
        self.rows = []

    def cycle(self, **inputs):
        outputs = self.wrapper.call(
            **self.given
            | {"bRunning": self.cycles > 4, "bDriveError": self.failed, "fActPosition": self.measured()}
            | inputs
        )
        self.failed = self.failed and not outputs["bresetdrive"]
        self.cycles = self.cycles + 1 if outputs["brun"] and not self.failed else 0
        wanted = (1.0 - self.slip) * outputs["fspeed"] if self.cycles > 4 else 0.0
        self.velocity += (wanted - self.velocity) * CYCLE / self.lag
        self.position += CYCLE * self.velocity
        self.rows.append((outputs["fspeed"], self.position))
        return outputs

    until = Bench.until
