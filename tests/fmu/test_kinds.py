"""Every kind of FMU, by FMI 2 and 3, in both interfaces, against separately written equations."""

from itertools import pairwise
from xml.etree import ElementTree

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmu import absolute_angle_crane as oracle
from fmu.drivers import Instance, advance, cosimulate, exchange
from fmu.kinds import model_of, motion
from scipy.integrate import solve_ivp

from gen_profile.motion.profile import Profile
from gen_profile.plants.registry import find_plant
from gen_profile_fmu.building.plant_fmu import cached_fmu
from gen_profile_fmu.description.fmu_files import Version
from gen_profile_fmu.model.contents import profile_model, system_model
from gen_profile_fmu.model.plant_variables import PlantInstance

CRANE = find_plant("double-pendulum-crane")
OTHER = {"m1": 0.5, "m2": 0.1, "L1": 0.6, "L2": 0.25, "g": 9.7, "c1": 0.01, "c2": 0.02}
TIMES = np.arange(0.0, 2.0001, 0.01)
OUTPUTS = ("angle.hook", "angle.payload", "cart.position", "cart.velocity")
STEPS = np.arange(101) * 0.02
POSITIONS = 0.3 * np.sin(STEPS) ** 2  # setpoints in m, one a step


def assert_swung(rows, tau, angles, carts):
    """Hold angles and the cart's place after each setpoint to the oracle's."""
    states, places = oracle.swing_in_steps(POSITIONS, 0.02, tau, OTHER)
    np.testing.assert_allclose(rows[:, :2], states[:, :2], rtol=0.0, atol=angles)
    np.testing.assert_allclose(rows[:, 2], places, rtol=0.0, atol=carts)


def wave(time, order=0):
    """Something smooth that an input does, with its derivatives."""
    return (0.8 * np.sin(3.0 * time), 2.4 * np.cos(3.0 * time), -7.2 * np.sin(3.0 * time),
            -21.6 * np.cos(3.0 * time))[order]  # fmt: skip


def expected(acceleration, times=TIMES, start=(0.0,) * 4, cart=(0.0, 0.0)):
    """Absolute angles, and the cart's position and velocity, for an acceleration (time, velocity)."""

    def rates(time, x):
        push = acceleration(time, x[5])
        return np.concatenate((x[2:4], oracle.accelerations(x[:2], x[2:4], push, OTHER), [x[5], push]))

    initial = np.array([*start, *cart])
    result = solve_ivp(
        rates,
        (times[0], times[-1]),
        initial,
        method="DOP853",
        rtol=1e-11,
        atol=1e-13,
        t_eval=times,
        max_step=0.02,
    )
    return result.y[[0, 1, 4, 5]].T


@pytest.fixture(params=Version)
def version(request):
    return request.param


@pytest.fixture
def open_instance(version):
    opened = []

    def open_(kind, *, exchange):
        opened.append(Instance(cached_fmu(model_of(kind, CRANE), version), version, exchange=exchange))
        return opened[-1]

    yield open_
    for instance in opened:
        instance.close()


class TestModelExchange:
    @pytest.mark.slow
    @pytest.mark.parametrize("kind", ["plant-acceleration", "plant-velocity"])
    def test_of_a_plant(self, open_instance, kind):
        instance = open_instance(kind, exchange=True)
        lag = kind == "plant-velocity"
        instance.begin({**OTHER, **({"tau": 0.05} if lag else {})})
        name = "cart.setpoint_velocity" if lag else "cart.setpoint_acceleration"
        rows_out = exchange(instance, TIMES, lambda time: instance.write({name: wave(time)}), OUTPUTS, 2e-3)
        follow = (lambda t, v: (wave(t) - v) / 0.05) if lag else (lambda t, v: wave(t))
        np.testing.assert_allclose(rows_out, expected(follow), rtol=0.0, atol=2e-8)

    @pytest.mark.slow
    @pytest.mark.parametrize("tau", [0.0, 0.05])
    def test_of_setpoints_takes_one_each_period(self, open_instance, tau):
        instance = open_instance("plant-setpoint", exchange=True)
        instance.begin({**OTHER, "tau": tau, "interpolation_period": 0.02})

        def next_setpoint(time):
            k = int(time / 0.02 + 1e-9)
            instance.write({"cart.setpoint": POSITIONS[min(k + 1, 100)]})

        rows_out = exchange(instance, STEPS, next_setpoint, OUTPUTS, 1e-3)
        assert_swung(rows_out, tau, 1e-8, 1e-8)

    @pytest.mark.slow
    def test_of_velocities_holds_one_each_period_where_drives_are_ideal(self, open_instance):
        instance = open_instance("plant-velocity", exchange=True)
        instance.begin({**OTHER, "tau": 0.0, "interpolation_period": 0.02})
        velocities = [*np.diff(POSITIONS) / 0.02, 0.0]

        def next_velocity(time):
            instance.write({"cart.setpoint_velocity": velocities[int(time / 0.02 + 1e-9)]})

        rows_out = exchange(instance, STEPS, next_velocity, OUTPUTS, 1e-3)
        assert_swung(rows_out, 0.0, 1e-8, 1e-8)

    @pytest.mark.parametrize("tau", [0.0, 0.05])
    def test_of_a_system(self, open_instance, tau):
        instance = open_instance("system", exchange=True)
        instance.begin({**OTHER, "tau": tau, "start_time": 0.1})
        times = np.arange(0.0, 4.0001, 0.01)
        rows_out = exchange(instance, times, lambda time: None, OUTPUTS, 2e-3)
        np.testing.assert_allclose(rows_out, followed(times, tau), rtol=0.0, atol=2e-8)

    def test_of_a_profile(self, open_instance):
        instance = open_instance("profile", exchange=True)
        instance.begin({"start_time": 0.1})
        times = np.arange(0.0, 3.0, 0.013)
        names = [f"cart.setpoint{suffix}" for suffix in ("", "_velocity", "_acceleration", "_jerk")]
        rows_out = exchange(instance, times, lambda time: None, names, 1.0)
        for order in range(4):
            exact = motion(1).derivative(times - 0.1, order)[:, 0]
            np.testing.assert_allclose(rows_out[:, order], exact, rtol=0.0, atol=1e-13)


def followed(times, tau):
    """The system's outputs: the motion begins at 0.1 s; pieces are integrated one by one."""
    profile = motion(1)

    def acceleration(time, velocity):
        order = 2 if tau == 0.0 else 1
        asked = profile.derivative(np.array([time - 0.1]), order)[0, 0]
        return asked if tau == 0.0 else (asked - velocity) / tau

    edges = [0.0, 0.1, 0.1 + 0.75, 0.1 + 2.25, times[-1]]
    rows, state = (
        [expected(acceleration, np.array([0.0, 1e-9]), cart=(0.1, 0.0))[:1]],
        np.array([0, 0, 0, 0, 0.1, 0.0]),
    )
    for low, high in pairwise(edges):
        inside = times[(times > low) & (times <= high)]

        def rates(time, x, low=low, high=high):
            at = min(max(time, low + 1e-12), high - 1e-12)
            push = acceleration(at, x[5])
            return np.concatenate((x[2:4], oracle.accelerations(x[:2], x[2:4], push, OTHER), [x[5], push]))

        grid = np.unique(np.append(inside, high))
        result = solve_ivp(rates, (low, high), state, method="DOP853", rtol=1e-11, atol=1e-13, t_eval=grid)
        rows.append(result.y[[0, 1, 4, 5]].T[: len(inside)])
        state = result.y[:, -1]
    return np.concatenate(rows)


class TestCosimulation:
    @pytest.mark.parametrize(
        ("kind", "tau"), [("plant-acceleration", None), ("plant-velocity", 0.05), ("plant-velocity", 0.0)]
    )
    def test_interpolates_inputs(self, kind, tau):
        """With derivatives up to the third order, 10 ms steps are as good as continuous inputs (FMI 2)."""
        instance = Instance(cached_fmu(model_of(kind, CRANE), Version.FMI2), Version.FMI2, exchange=False)
        instance.begin({**OTHER, **({} if tau is None else {"tau": tau})})
        name = "cart.setpoint_acceleration" if tau is None else "cart.setpoint_velocity"

        def before(time, _):
            instance.write({name: wave(time)})
            instance.slopes(name, *(wave(time, order) for order in (1, 2, 3)))

        rows_out = cosimulate(instance, TIMES, before, OUTPUTS)

        def follow(time, velocity):
            return (wave(time) - velocity) / tau if tau else wave(time, 1 if tau == 0.0 else 0)

        # a velocity that the axes have at once errs as its Taylor series does: 0.8 · 3⁴ · (10 ms)⁴ / 4! m/s
        np.testing.assert_allclose(rows_out, expected(follow), rtol=0.0, atol=1e-8 if tau != 0.0 else 3e-8)
        instance.close()

    @pytest.mark.parametrize("kind", ["plant-acceleration", "plant-velocity"])
    def test_asks_for_inputs_on_the_way(self, kind):
        """In FMI 3, where inputs have no derivatives: at the middle of each integration step of 1 ms."""
        lag = kind == "plant-velocity"
        name = "cart.setpoint_velocity" if lag else "cart.setpoint_acceleration"
        observed, shown = [], []

        def update(_, time, asked, readable, finished, may_return, *__):
            assert (asked, may_return) == (not readable, False)
            assert readable == finished
            if asked:
                instance.write({name: wave(time)})
            else:
                shown.append(time)
                observed.append(instance.read(*OUTPUTS))

        instance = Instance(cached_fmu(model_of(kind, CRANE), Version.FMI3), Version.FMI3, exchange=False,
                            intermediateUpdate=update)  # fmt: skip
        instance.begin({**OTHER, **({"tau": 0.05} if lag else {})})
        cosimulate(instance, TIMES, lambda *_: None, OUTPUTS)
        instance.close()
        fine = np.linspace(0.0, 2.0, 2001)
        np.testing.assert_allclose(shown, fine[1:], rtol=0.0, atol=1e-12)
        follow = (lambda t, v: (wave(t) - v) / 0.05) if lag else (lambda t, v: wave(t))
        np.testing.assert_allclose(observed, expected(follow, fine)[1:], rtol=0.0, atol=5e-6)

    @pytest.mark.parametrize("kind", ["plant-acceleration", "plant-velocity"])
    def test_holds_inputs_that_have_no_derivatives(self, open_instance, kind):
        instance = open_instance(kind, exchange=False)
        lag = kind == "plant-velocity"
        instance.begin({**OTHER, **({"tau": 0.05} if lag else {})})
        name = "cart.setpoint_velocity" if lag else "cart.setpoint_acceleration"
        times = np.arange(0.0, 1.01, 0.1)
        rows_out = cosimulate(instance, times, lambda time, _: instance.write({name: wave(time)}), OUTPUTS)
        state, rows = np.zeros(6), [np.zeros(4)]
        for low, high in pairwise(times):

            def rates(_, x, low=low):
                push = (wave(low) - x[5]) / 0.05 if lag else wave(low)
                return np.concatenate(
                    (x[2:4], oracle.accelerations(x[:2], x[2:4], push, OTHER), [x[5], push])
                )

            state = solve_ivp(rates, (low, high), state, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
            rows.append(state[[0, 1, 4, 5]])
        np.testing.assert_allclose(rows_out, rows, rtol=0.0, atol=1e-9)

    def test_of_velocities_that_ideal_drives_have_at_once(self, open_instance):
        """As interpolated setpoints: a velocity held over a step strikes the loads as its impulse."""
        instance = open_instance("plant-velocity", exchange=False)
        instance.begin({**OTHER, "tau": 0.0})
        velocities = np.diff(POSITIONS) / 0.02
        rows_out = cosimulate(
            instance,
            STEPS,
            lambda time, _: instance.write({"cart.setpoint_velocity": velocities[round(time / 0.02)]}),
            OUTPUTS,
        )
        assert_swung(rows_out, 0.0, 1e-9, 1e-12)

    @pytest.mark.parametrize("tau", [0.0, 0.05])
    def test_of_setpoints(self, open_instance, tau):
        instance = open_instance("plant-setpoint", exchange=False)
        instance.begin({**OTHER, "tau": tau})
        rows_out = cosimulate(
            instance,
            STEPS,
            lambda _, end: instance.write({"cart.setpoint": POSITIONS[round(end / 0.02)]}),
            OUTPUTS,
        )
        assert_swung(rows_out, tau, 1e-9, 1e-12)

    @pytest.mark.parametrize("tau", [0.0, 0.05])
    @pytest.mark.parametrize("step", [0.01, 0.07])
    def test_of_a_system_is_exact_whatever_the_step(self, open_instance, tau, step):
        instance = open_instance("system", exchange=False)
        instance.begin({**OTHER, "tau": tau, "start_time": 0.1})
        times = np.arange(0.0, 4.0001, step)
        rows_out = cosimulate(instance, times, lambda *_: None, OUTPUTS)
        np.testing.assert_allclose(rows_out, followed(times, tau), rtol=0.0, atol=1e-8)
        if tau == 0.0:
            assert rows_out[-1, 2] == motion(1).target[0]

    @pytest.mark.parametrize("step", [0.001, 0.013, 0.9])
    def test_of_a_profile_is_exact_at_any_communication_point(self, open_instance, step):
        instance = open_instance("profile", exchange=False)
        instance.begin({"start_time": 0.1})
        times = np.arange(0.0, 3.0, step)
        names = [f"cart.setpoint{suffix}" for suffix in ("", "_velocity", "_acceleration", "_jerk")]
        rows_out = cosimulate(instance, times, lambda *_: None, names)
        for order in range(4):
            exact = motion(1).derivative(times - 0.1, order)[:, 0]
            np.testing.assert_allclose(rows_out[:, order], exact, rtol=0.0, atol=1e-13)

    @pytest.mark.slow
    def test_begins_with_a_swing_and_goes_on_at_speed(self, version):
        """What a spec's `move.initial` and `move.final_velocity` ask for."""
        given = np.array([[0.1], [0.0], [0.15]])[None]
        onward = Profile(
            knots=[0.0, 1.0], coefficients=given, target=[0.25], final_velocity=[0.3], method="test"
        )
        swing = {"theta1": 0.2, "theta2": -0.1, "theta2.rate": 0.3}
        machine = PlantInstance(plant=CRANE, parameters=OTHER, initial=swing)
        models = system_model("onward", machine, onward), profile_model("onward", CRANE.actuated, onward)
        outputs = OUTPUTS, ("cart.setpoint", "cart.setpoint_velocity")
        rows_out = []
        for model, names in zip(models, outputs, strict=True):
            instance = Instance(cached_fmu(model, version), version, exchange=False)
            instance.begin({})
            rows_out.append(cosimulate(instance, TIMES, lambda *_: None, names))
            instance.close()
        swung, moved = rows_out
        exact = np.column_stack([onward.derivative(TIMES, order)[:, 0] for order in range(2)])
        np.testing.assert_allclose(moved, exact, rtol=0.0, atol=1e-14)
        np.testing.assert_allclose(swung[:, 2:], exact, rtol=0.0, atol=1e-12)
        first = expected(lambda *_: 0.3, TIMES[:101], start=(0.2, 0.1, 0.0, 0.3), cart=(0.1, 0.0))
        np.testing.assert_allclose(swung[:101, :2], first[:, :2], rtol=0.0, atol=1e-8)
        still = np.abs(np.diff(swung[101:, 3]))
        assert still.max() == 0.0

    @pytest.mark.parametrize("kind", ["profile", "system"])
    def test_waits_for_its_trigger(self, open_instance, kind):
        instance = open_instance(kind, exchange=False)
        instance.begin({"start_time": 0.05}, wait_for_trigger=True)
        observed = []
        for k in range(400):
            instance.set_boolean("trigger", k in {2, 50, 60})  # too early; in time; once more
            instance.fmu.doStep(k * 0.01, 0.01)
            observed.append((instance.get_boolean("moving"), instance.get_boolean("done")))
            time = 0.01 * (k + 1) - 0.5
            exact = motion(1)(np.array([time])).position[0, 0]
            assert instance.read("cart.setpoint")[0] == pytest.approx(exact, abs=1e-12)
        began, ended = observed.index((True, False)), observed.index((False, True))
        assert (began, ended) == (50, pytest.approx(274, abs=1))
        assert observed == [(False, False)] * began + [(True, False)] * (ended - began) + [(False, True)] * (
            400 - ended
        )

    def test_starts_swinging_where_asked(self, open_instance):
        instance = open_instance("plant-acceleration", exchange=False)
        instance.begin({**OTHER, "theta1": 0.2, "theta2": -0.1, "theta2.rate": 0.3, "cart.start": 0.5})
        rows_out = cosimulate(instance, TIMES, lambda *_: None, OUTPUTS)
        exact = expected(lambda *_: 0.0, start=(0.2, 0.1, 0.0, 0.3), cart=(0.5, 0.0))
        np.testing.assert_allclose(rows_out, exact, rtol=0.0, atol=1e-8)


class TestDirectionalDerivatives:
    @pytest.mark.parametrize("kind", ["plant-acceleration", "plant-velocity", "plant-setpoint", "system"])
    def test_agree_with_differences(self, open_instance, kind):
        """In continuous-time mode, every output and derivative by every state and input."""
        instance = open_instance(kind, exchange=True)
        instance.begin({**OTHER, **({} if kind == "plant-acceleration" else {"tau": 0.05})})
        instance.events()
        instance.fmu.enterContinuousTimeMode()
        x = np.array([0.3, -0.2, 0.5, 0.4, 0.1, -0.3])
        instance.rates(0.4, x)
        table = instance.references
        unknowns = [
            name
            for name in table
            if name.startswith(("der(", "sway", "height", "angle", "position", "energy"))
        ]
        states = ["theta1", "theta2", "theta1.rate", "theta2.rate", "cart.position", "cart.velocity"]
        inputs = [name for name in table if kind != "system" and name.startswith("cart.setpoint_")]

        def evaluate(shift, name):
            y = x + shift * np.array([state == name for state in states])
            if name in inputs:
                instance.write({name: shift})
            instance.rates(0.4, y)
            return instance.read(*unknowns)

        for known in (*states, *inputs):
            exact = (evaluate(1e-5, known) - evaluate(-1e-5, known)) / 2e-5
            evaluate(0.0, known)
            rows_out = instance.directional(unknowns, [known], [1.0])
            np.testing.assert_allclose(rows_out, exact, rtol=1e-7, atol=1e-7, err_msg=known)
        twice = instance.directional(unknowns, states[:2], [2.0, 3.0])
        one = [instance.directional(unknowns, [state], [1.0]) for state in states[:2]]
        np.testing.assert_allclose(twice, 2.0 * one[0] + 3.0 * one[1], rtol=1e-12)

    def test_reach_parameters_and_starts(self, open_instance):
        instance = open_instance("plant-velocity", exchange=True)
        unknowns = ["sway.payload", "der(theta1.rate)", "cart.position", "der(cart.velocity)"]

        def evaluate(**changes):
            instance.fmu.reset()
            values = {"theta1": 0.3, "theta2": 0.1, "tau": 0.05, "cart.setpoint_velocity": 0.7, **OTHER}
            instance.write({**values, **{name.replace("__", "."): v for name, v in changes.items()}})
            instance.initialise()
            return instance.read(*unknowns)

        for known, value in {"L1": 0.6, "m2": 0.1, "tau": 0.05, "cart__start": 0.0, "theta1": 0.3}.items():
            exact = (evaluate(**{known: value + 1e-6}) - evaluate(**{known: value - 1e-6})) / 2e-6
            evaluate()
            rows_out = instance.directional(unknowns, [known.replace("__", ".")], [1.0])
            np.testing.assert_allclose(rows_out, exact, rtol=1e-6, atol=1e-7, err_msg=known)
        instance.fmu.exitInitializationMode()

    @pytest.mark.parametrize("kind", ["profile", "system"])
    def test_of_a_motion_reach_its_parameters(self, open_instance, kind):
        """Half a second after it began, and where it goes elsewhere than planned."""
        instance = open_instance(kind, exchange=True)
        unknowns = [f"cart.setpoint{suffix}" for suffix in ("", "_velocity", "_acceleration", "_jerk")]
        unknowns += ["cart.position", "sway.payload", "der(theta1.rate)"] if kind == "system" else []

        def evaluate(**changes):
            instance.fmu.reset()
            values = {"cart.start": 0.2, "cart.distance": -0.5, "start_time": -1.0}
            instance.write({**values, **{name.replace("__", "."): v for name, v in changes.items()}})
            instance.initialise()
            return instance.read(*unknowns)

        for known, value in {"cart__start": 0.2, "cart__distance": -0.5, "start_time": -1.0}.items():
            exact = (evaluate(**{known: value + 1e-6}) - evaluate(**{known: value - 1e-6})) / 2e-6
            evaluate()
            rows_out = instance.directional(unknowns, [known.replace("__", ".")], [1.0])
            np.testing.assert_allclose(rows_out, exact, rtol=1e-6, atol=1e-8, err_msg=known)
        instance.fmu.exitInitializationMode()


class TestMotion:
    """What a profile and a system can do beyond the motion that was planned."""

    @pytest.mark.parametrize("kind", ["profile", "system"])
    def test_goes_elsewhere(self, open_instance, kind):
        instance = open_instance(kind, exchange=False)
        instance.begin({"cart.start": 1.0, "cart.distance": -0.6})
        times = np.arange(0.0, 3.0, 0.01)
        names = [f"cart.setpoint{suffix}" for suffix in ("", "_velocity", "_acceleration", "_jerk")]
        rows_out = cosimulate(instance, times, lambda *_: None, names)
        planned = motion(1)
        scale = -0.6 / (planned.target[0] - 0.1)
        for order in range(4):
            exact = scale * planned.derivative(times, order)[:, 0] + (
                1.0 - 0.1 * scale if order == 0 else 0.0
            )
            np.testing.assert_allclose(rows_out[:, order], exact, rtol=0.0, atol=1e-12)
        if kind == "system":
            assert instance.read("cart.position")[0] == pytest.approx(0.4, abs=1e-15)

    def test_has_exact_output_derivatives(self, open_instance, version):
        instance = open_instance("profile", exchange=False)
        instance.begin({})
        for low, high in pairwise([0.0, 0.3, 1.1, 2.5]):  # in both pieces, and after them
            instance.fmu.doStep(low, high - low)
            for done, suffix in enumerate(("", "_velocity", "_acceleration", "_jerk")):
                for order in (1, 2, 3):
                    rows_out = instance.output_derivative(f"cart.setpoint{suffix}", order)
                    exact = motion(1).derivative(np.array([high]), done + order)[0, 0]
                    assert rows_out == pytest.approx(exact, abs=1e-12)
        description = ElementTree.parse(instance.fmu.unzipDirectory + "/modelDescription.xml")
        assert description.find("CoSimulation").get("maxOutputDerivativeOrder") == "3"

    @pytest.mark.parametrize(
        ("name", "order"), [("cart.setpoint", 0), ("cart.setpoint", 4), ("start_time", 1)]
    )
    def test_refuses_derivatives_that_it_does_not_have(self, open_instance, name, order):
        instance = open_instance("profile", exchange=False)
        instance.begin({})
        with pytest.raises(FMICallException):
            instance.output_derivative(name, order)
        instance.fmu.reset()
        instance.begin({})

    @pytest.mark.parametrize("kind", ["profile", "system"])
    def test_is_known_beyond_an_event_that_was_not_handled_yet(self, open_instance, kind):
        """As importers look that take a step across an event, and handle it afterwards; and back again."""
        instance = open_instance(kind, exchange=True)
        instance.begin({"start_time": 0.1})
        instance.events()
        instance.fmu.enterContinuousTimeMode()
        for time in (0.05, 0.3, 0.9, 2.4, 3.0, 0.9, 0.3, 0.05):
            instance.fmu.setTime(time)
            rows_out = instance.read("cart.setpoint", "cart.setpoint_acceleration")
            exact = [motion(1).derivative(np.array([time - 0.1]), order)[0, 0] for order in (0, 2)]
            np.testing.assert_allclose(rows_out, exact, rtol=0.0, atol=1e-13)

    def test_of_a_system_survives_late_events(self, open_instance):
        """An importer with a fixed step that handles an event at the next end of a step."""
        instance = open_instance("system", exchange=True)
        instance.begin(OTHER)
        event, step, rows = instance.events(), 2.3e-3, []
        instance.fmu.enterContinuousTimeMode()
        times = np.arange(1740) * step
        for time in times[:-1]:
            rows.append(instance.read(*OUTPUTS))
            advance(instance, time, step, lambda _: None)
            if event is not None and time + step >= event:
                instance.fmu.enterEventMode()
                event = instance.events()
                instance.fmu.enterContinuousTimeMode()
        began = followed(np.array([0.0, *(times + 0.1)]), 0.0)[1:]
        # a step over the jump of the acceleration errs by a sixth of it; the old segment's polynomial, by all
        np.testing.assert_allclose(rows, began[:-1], rtol=0.0, atol=5e-4)


class TestBackwards:
    def test_agrees_with_forwards(self):
        fmu = cached_fmu(model_of("plant-velocity", CRANE), Version.FMI3)
        instance = Instance(fmu, Version.FMI3, exchange=True)
        instance.begin({**OTHER, "theta1": 0.3, "theta2": 0.1})
        unknowns, knowns = ["der(theta1.rate)", "sway.payload"], ["theta1", "cart.velocity", "L1"]
        jacobian = np.column_stack([instance.directional(unknowns, [known], [1.0]) for known in knowns])
        references = [[instance.references[name] for name in names] for names in (unknowns, knowns)]
        rows_out = instance.fmu.getAdjointDerivative(*references, [2.0, -1.0], nSensitivity=3)
        np.testing.assert_allclose(rows_out, [2.0, -1.0] @ jacobian, rtol=1e-13)
        instance.close()
