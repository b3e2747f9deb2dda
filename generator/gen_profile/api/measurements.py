"""Measurements on site, and the parameters that follow from them."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from gen_profile.spec.arguments import as_names, as_number, as_numbers, as_path, as_text
from gen_profile.spec.model import Spec
from gen_profile.spec.reading import as_spec
from gen_profile.studies.identification.identify import Identification
from gen_profile.studies.identification.identify import identify as _identify
from gen_profile.studies.identification.identify import read_swing as _read_swing
from gen_profile.studies.identification.measurements import DirectReading, Measurement, Period, SwingLog
from gen_profile.studies.identification.measurements import parse_period as _parse_period
from gen_profile.studies.identification.measurements import parse_reading as _parse_reading
from gen_profile.support.errors import SpecError
from gen_profile.support.progress import Progress, no_progress, require_progress


def identify(
    spec: Spec | Path | str,
    measurements: Sequence[Measurement] | Measurement,
    free: Sequence[str] | str = (),
    q_a: Sequence[float] | None = None,
    progress: Progress = no_progress,
) -> Identification:
    """Identify parameters of a spec's machine, and put them and their ranges into the spec.

    Parameters
    ----------
    spec : Spec, or the path of one
        Its parameters are where the search starts; those that are not identified are taken as exact.
    measurements : sequence of Measurement, or Measurement
    free : sequence of str, or str
        Parameters to identify, beside those that were read directly.
    q_a : (m,) sequence of float, optional
        Where the axes stood while periods and swings were measured; the target of the move by default.
    progress : callable
        Told what is being done.

    Raises
    ------
    SpecError
        A measurement or parameter does not belong to the machine.
    InfeasibleProblem
        The measurements do not determine the parameters, or not well enough to be of use.

    Examples
    --------
    >>> timed = gp.parse_period("49.2±0.2/10")  # ten swings, with a stop watch
    >>> gp.identify(gp.preset_spec("bay-crane"), [timed], "L1")
    <Identification name: bay-crane, L1: 4.68921>
    """
    require_progress(progress)
    spec = as_spec(spec)
    given = tuple(measurements) if isinstance(measurements, Iterable) else (measurements,)
    for one in given:
        if not isinstance(one, Measurement):
            known = "parse_reading, parse_period and read_swing"
            raise SpecError(f"measurements: what {known} give is expected, found {one!r}.")
    return _identify(spec, given, as_names(free), None if q_a is None else as_numbers(q_a, "at"), progress)


def read_swing(
    path: Path | str,
    spec: Spec | Path | str,
    *,
    columns: tuple[str | int, str | int] | None = None,
    signal: str = "angle",
    unit: str | None = None,
    time_unit: str | None = None,
    after: float | None = None,
) -> SwingLog:
    """Read a logged swing of a spec's machine.

    Parameters
    ----------
    path : Path or str
        Table with a column of times and one of values.
    spec : Spec, or the path of one
    columns : (str or int, str or int) or None
        Their names, or their numbers from 1; by default those whose names tell it, or the first two.
    signal : str
        What the values are: ``angle``, ``sway``, ``rate`` (of the angle) or ``acceleration`` (of the sway,
        without gravity) of the first load, or of a named one, ``angle:hook``.
    unit : str or None
        Of the values; by default what their column's name says, or the SI unit. A number before it is the
        size of one count, ``0.09 deg``.
    time_unit : str or None
        One of `TIME_UNITS`; by default what the column's name says, or the times show.
    after : float or None
        Time in s from which on the axes stood still; None for the whole log.

    Raises
    ------
    SpecError
        The machine has no such signal, or a choice is wrong.
    OutputError
        The file cannot be read.

    Examples
    --------
    >>> times = np.arange(0.0, 20.0, 0.05)
    >>> swing = 3.0 * np.cos(1.278 * times + 0.3)
    >>> np.savetxt("swing.csv", np.c_[times, swing], delimiter=",", header="time_s,angle_deg", comments="")
    >>> gp.read_swing("swing.csv", gp.preset_spec("bay-crane"), columns=("time_s", "angle_deg"))
    <SwingLog times: (400,), values: (400,), quantity: angle, load: hook, ...>
    """
    spec = as_spec(spec)
    if columns is not None and (not isinstance(columns, tuple | list) or len(columns) != 2):
        raise SpecError(f"columns: name two, of times and values, such as (1, 2), found {columns!r}.")
    return _read_swing(
        as_path(path),
        spec,
        columns=None if columns is None else (str(columns[0]), str(columns[1])),
        signal=as_text(signal, "signal: a name"),
        unit=None if unit is None else as_text(unit, "unit: a unit"),
        time_unit=None if time_unit is None else as_text(time_unit, "time_unit: a unit"),
        after=None if after is None else as_number(after, "after"),
    )


def parse_reading(text: str, option: str = "measured") -> DirectReading:
    """Read ``L1=0.47±0.005``, given by an option of some name.

    Raises
    ------
    SpecError

    Examples
    --------
    >>> gp.parse_reading("L1=0.47±0.005")
    DirectReading(parameter='L1', value=0.47, uncertainty=0.005)
    """
    return _parse_reading(as_text(text, f"{option}: a text"), option)


def parse_period(text: str) -> Period:
    """Read ``17.3±0.2/10``: ten swings in 17.3 s; ``2:0.70±0.01`` is one swing of the second mode.

    Raises
    ------
    SpecError

    Examples
    --------
    >>> gp.parse_period("17.3±0.2/10")
    Period(mode=1, seconds=1.73, uncertainty=0.02)
    """
    return _parse_period(as_text(text, "period: a text"))
