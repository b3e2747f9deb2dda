"""The planner's FMU issues what the planner block does, bit for bit, in both interfaces of FMI."""

import numpy as np
import pytest
from fmu.drivers import Instance
from fmu.drivers import advance as integrate
from fmu.kinds import PLANNED, model_of, planner_text
from generator.planned_machines import GANTRY

from gen_profile.planner.design import planner_block
from gen_profile.planner.execution import BlockInstance
from gen_profile.plants.registry import find_plant
from gen_profile.spec.reading import parse_spec
from gen_profile_fmu.building.plant_fmu import cached_fmu
from gen_profile_fmu.description.fmu_files import Version
from gen_profile_fmu.model.planner import planned_system_model
from gen_profile_fmu.model.plant_variables import PlantInstance

pytestmark = pytest.mark.slow  # planners are compiled

CYCLE = PLANNED.export.cycle_time
START = 2.0
ORDERS = [  # cycles, the block's inputs that change from there on
    (20, {"bEnable": 1.0}),
    (200, {"bExecute": 1.0, "fTarget": 0.3, "fL1": 0.45}),
    (90, {"bExecute": 0.0, "bVelocity": 1.0, "fVelocityCommand": -0.2}),
    (120, {"bVelocity": 0.0, "bStop": 1.0, "rOverride": 2.0}),
]
NAMES = {"bEnable": "enable", "bExecute": "execute", "bVelocity": "velocity", "bStop": "stop"}
NAMES |= {"fTarget": "target", "fVelocityCommand": "velocity_command", "fL1": "live.L1"}
NAMES |= {"rOverride": "override"}
OUTPUTS = {
    "cart.setpoint": "fPosition",
    "cart.setpoint_velocity": "fVelocity",
    "cart.setpoint_acceleration": "fAcceleration",
    "stop_distance": "fStopDistance",
}
SEEN = ("sway.hook", "sway.payload", "cart.position")
NUMBERS = {"error_id": "nErrorId", "promise_number": "nPromise"}


@pytest.fixture(params=Version)
def version(request):
    return request.param


@pytest.fixture
def instance(version, request):
    fmu = cached_fmu(model_of("planner", find_plant("double-pendulum-crane")), version)
    made = Instance(fmu, version, exchange=getattr(request, "param", False))
    made.begin({"act_position": -0.1}, START)
    yield made
    made.close()


def expected():
    block = BlockInstance(planner_text())
    inputs, rows = block.inputs | {"fActPosition": -0.1}, []
    for cycles, changes in ORDERS:
        inputs |= changes
        rows.append(block.call(np.tile(list(inputs.values()), (cycles, 1))))
    return np.vstack(rows)[:, [block.outputs.index(name) for name in (OUTPUTS | NUMBERS).values()]]


def shown(instance):
    return [*instance.read(*OUTPUTS), *instance.read_integers(*NUMBERS)]


def order(instance, changes):
    for name, value in changes.items():
        if name[0] == "b":
            instance.set_boolean(NAMES[name], bool(value))
        else:
            instance.write({NAMES[name]: value})


def issued(instance, advance):
    rows, number = [], 0
    for cycles, changes in ORDERS:
        order(instance, changes)
        for _ in range(cycles):
            advance(number)
            rows.append(shown(instance))
            number += 1
    return np.array(rows)


def test_each_step_of_a_cycle_issues_the_blocks_setpoint(instance):
    due = expected()
    assert shown(instance) == [-0.1, 0.0, 0.0, 0.0, 0, 0]  # where the axis stands
    time = START

    def advance(_):
        nonlocal time
        instance.fmu.doStep(time, CYCLE)
        time += CYCLE  # as masters do, who add up their steps

    assert issued(instance, advance).tolist() == due.tolist()
    assert due[-1, -2] == 5.0
    assert np.ptp(due[:, 0]) > 0.1


@pytest.mark.parametrize("instance", [True], indirect=True)
def test_each_cycle_is_an_event_of_model_exchange(instance):
    following = [START]

    def advance(number):
        if number > 0:
            assert following[-1] == pytest.approx(START + number * CYCLE, abs=1e-12)
            instance.fmu.setTime(following[-1])
        following.append(instance.events())

    assert issued(instance, advance).tolist() == expected().tolist()


def test_steps_need_not_be_cycles_and_a_saved_state_goes_on(instance):
    """In a step of several cycles all have its inputs; a state holds all that the block remembers."""
    due = expected()
    order(instance, ORDERS[0][1])
    instance.fmu.doStep(START, 20 * CYCLE)
    assert shown(instance) == due[19].tolist()
    order(instance, ORDERS[1][1])
    instance.fmu.doStep(START + 20 * CYCLE, 80 * CYCLE)
    state = instance.fmu.getFMUState()
    for cycles in (100.0, 99.5):  # a cycle that has begun is called, however long the step goes on
        time, ends = START + 100 * CYCLE, START + (100 + cycles) * CYCLE
        while time < ends - 1e-9:
            step = min(2.5 * CYCLE, ends - time)
            instance.fmu.doStep(time, step)
            time += step
        assert shown(instance) == due[199].tolist()
        instance.fmu.setFMUState(state)
    instance.fmu.freeFMUState(state)


@pytest.fixture
def joined(version, request):
    """The planner and the plant that it drives, in one FMU."""
    plant = find_plant("double-pendulum-crane")
    made = Instance(cached_fmu(model_of("planned-system", plant), version), version, exchange=request.param)
    made.begin({"cart.start": -0.1, "max_step": 5e-3}, START)
    yield made
    made.close()


def swings(version):
    """How the loads sway where the plant's FMU alone is led from setpoint to setpoint of the block."""
    fmu = cached_fmu(model_of("plant-setpoint", find_plant("double-pendulum-crane")), version)
    plant = Instance(fmu, version, exchange=False)
    plant.begin({"cart.start": -0.1, "max_step": 5e-3}, START)
    rows = []
    for number, setpoint in enumerate(expected()[:, 0]):
        plant.write({"cart.setpoint": setpoint})
        plant.fmu.doStep(START + number * CYCLE, CYCLE)
        rows.append(plant.read(*SEEN))
    plant.close()
    return np.array(rows)


@pytest.mark.parametrize("joined", [False], indirect=True)
def test_the_plant_follows_the_planner_in_one_fmu(joined, version):
    """Setpoints are the block's, bit for bit; the loads sway as those of a plant that is led by them."""
    sways, time = [], START

    def advance(_):
        nonlocal time
        joined.fmu.doStep(time, CYCLE)
        time += CYCLE
        sways.append(joined.read(*SEEN))

    assert issued(joined, advance).tolist() == expected().tolist()
    np.testing.assert_allclose(sways, swings(version), atol=1e-12)
    assert np.abs(np.array(sways)[:, 1]).max() > 1e-3
    joined.fmu.reset()
    joined.begin({"cart.start": -0.1, "max_step": 5e-3}, START)  # steps need not be cycles
    order(joined, ORDERS[0][1])
    joined.fmu.doStep(START, 20 * CYCLE)
    order(joined, ORDERS[1][1])
    for number in range(80):
        joined.fmu.doStep(START + (20 + 2.5 * number) * CYCLE, 2.5 * CYCLE)
    assert shown(joined) == expected()[219].tolist()
    np.testing.assert_allclose(joined.read(*SEEN), sways[219], atol=1e-9)


@pytest.mark.parametrize("joined", [True], indirect=True)
def test_the_plant_follows_the_planner_in_model_exchange(joined, version):
    sways = []

    def advance(number):
        if number > 0:
            joined.fmu.enterContinuousTimeMode()
            integrate(joined, START + (number - 1) * CYCLE, CYCLE, lambda _: None)
            joined.fmu.enterEventMode()
            sways.append(joined.read(*SEEN))
        assert joined.events() == pytest.approx(START + (number + 1) * CYCLE, abs=1e-12)

    assert issued(joined, advance).tolist() == expected().tolist()
    np.testing.assert_allclose(sways, swings(version)[:-1], atol=1e-6)


def test_two_axes_are_planned_and_drive_their_plant():
    spec = parse_spec(GANTRY)
    machine = PlantInstance(plant=spec.machine(), parameters=spec.plant.parameters)
    text, axes = planner_block(spec).text, {"_x": "x", "_y": "y"}
    fmu = cached_fmu(planned_system_model("gantry", text, machine, axes, ("L",)), Version.FMI2)
    system = Instance(fmu, Version.FMI2, exchange=False)
    system.begin({"x.start": 0.2, "max_step": 0.02}, 0.0)
    system.set_boolean("enable", value=True)
    system.fmu.doStep(0.0, 3.0)
    system.write({"x.target": 1.0, "y.target": 0.6})
    system.set_boolean("execute", value=True)
    steps = []
    for number in range(120):
        system.fmu.doStep(3.0 + 0.1 * number, 0.1)
        steps.append(system.read("x.setpoint", "y.setpoint"))
    moves = (np.array(steps) - [0.2, 0.0]) / [0.8, 0.6]
    np.testing.assert_allclose(moves[-1], 1.0, atol=1e-12)
    assert np.flatnonzero(moves[:, 0] < 1.0)[-1] == np.flatnonzero(moves[:, 1] < 1.0)[-1]
    assert system.read("x.position", "y.position") == pytest.approx([1.0, 0.6], abs=1e-9)
    assert np.abs(system.read("sway.payload_x", "sway.payload_y")).max() < 1e-3
    system.close()
