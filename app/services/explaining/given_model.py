"""The model of a simulation as somebody writes it down, in JSON: a linear process, and perhaps its controller."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from app.engine.mismatch import Controller, LinearSimulation
from app.errors import DataError
from app.json_texts import given_json

# The first name of each row is ours; the others are what people write as well.
MODEL = {
    "gain": ("K", "Kp"),
    "time_constants_s": ("time_constants", "time_constant_s", "time_constant", "taus", "tau", "tau_s"),
    "dead_time_s": ("dead_time", "theta", "theta_s", "delay_s", "delay"),
    "damping": ("damping_ratio", "zeta"),
    "integrating": ("integrator",),
    "controller": (),
    "name": (),
}
TIMES = ("integral_time_s", "derivative_time_s")
CONTROLLER = {
    "gain": ("Kc", "kc", "Kp", "kp"),
    "integral_time_s": ("integral_time", "Ti_s", "Ti", "ti"),
    "derivative_time_s": ("derivative_time", "Td_s", "Td", "td"),
    "type": (),
    "form": (),
    "name": (),
}
# What type and form may say, a word or two: which actions there are, and how they act together.
ACTIONS = {"p": (), "pi": ("integral_time_s",), "pd": ("derivative_time_s",), "pid": TIMES}
IDEAL = {"ideal", "standard", "isa", "noninteracting", "non-interacting"}
SERIES = {"series", "serial", "interacting"}


def simulation_from_json(text: str) -> LinearSimulation:
    """A model as JSON: {"gain": 1.2, "time_constants_s": [30, 5], "dead_time_s": 4, "integrating": false, "controller":
    {"gain": 0.5, "integral_time_s": 40, "derivative_time_s": 0}}, or a file with it; only its gain is needed. With a
    "damping" the first time constant is one over the natural angular frequency. Its figures are checked where it is
    compared. A controller is of the ideal form unless its type or form says series.

    Raises DataError("model_invalid") where it is no such JSON.
    """
    return linear_model(json_of(text))


def json_of(text: str) -> object:
    """JSON, or what a file of that name holds. Raises DataError("model_invalid") where it is none."""
    try:
        return given_json(Path(text).read_text(encoding="utf-8") if not text.lstrip().startswith("{") else text)
    except (OSError, ValueError, RecursionError) as error:
        raise not_understood(error) from error


def linear_model(found: object) -> LinearSimulation:
    """The model as `simulation_from_json` takes it. Raises DataError("model_invalid")."""
    try:
        told = understood(found, MODEL, "the model")
        integrating = told.get("integrating", False)
        if integrating not in (True, False):
            raise ValueError(f"integrating is {integrating!r}, true or false are needed")
        taus = told.get("time_constants_s", [])
        return LinearSimulation(
            number(told, "gain", "the model"),
            tuple(as_number(tau, "a time constant") for tau in (taus if isinstance(taus, list) else [taus])),
            number(told, "dead_time_s", "the model", 0.0),
            bool(integrating),
            None if told.get("controller") is None else controller_from(told["controller"]),
            None if told.get("damping") is None else number(told, "damping", "the model"),
        )
    except (ValueError, OverflowError) as error:
        raise not_understood(error) from error


def not_understood(error: Exception) -> DataError:
    return DataError("model_invalid", f"the model is not JSON with gain, time_constants_s, dead_time_s: {error}")


def controller_from(found: object) -> Controller:
    told = understood(found, CONTROLLER, "its controller")
    integral = None if told.get("integral_time_s") is None else number(told, "integral_time_s", "its controller")
    found = Controller(
        number(told, "gain", "its controller"), integral, number(told, "derivative_time_s", "its controller", 0.0)
    )
    words = words_of(told)
    check_actions(words, {"integral_time_s": found.integral_time_s, "derivative_time_s": found.derivative_time_s})
    return of_series(found) if words & SERIES else found


def words_of(told: Mapping[str, Any]) -> set[str]:
    """What type and form say of a controller. Raises ValueError for what is not understood: another law than the one
    that is meant would be compared.
    """
    said = [told[name] for name in ("type", "form") if told.get(name) is not None]
    words = {word for text in said for word in str(text).lower().replace("_", " ").split()}
    strange = words - IDEAL - SERIES - ACTIONS.keys()
    if strange or (words & IDEAL and words & SERIES) or len(words & ACTIONS.keys()) > 1:
        raise ValueError(
            f"its controller is {' and '.join(map(repr, said))}; P, PI, PD or PID, ideal or series are understood"
        )
    return words


def check_actions(words: set[str], times: Mapping[str, float | None]) -> None:
    """Raises ValueError where a controller has a time of an action that it has not."""
    for kind in words & ACTIONS.keys():
        if beyond := [name for name, value in times.items() if value and name not in ACTIONS[kind]]:
            raise ValueError(f"its controller is a {kind.upper()} and has {' and '.join(beyond)}")


def of_series(series: Controller) -> Controller:
    """The ideal controller that is the same as gain (1 + 1 / (Ti s)) (1 + Td s)."""
    integral, derivative = series.integral_time_s, series.derivative_time_s
    if integral is None or integral <= 0.0:
        return series
    both = integral + derivative
    return Controller(series.gain * both / integral, both, integral * derivative / both if both else 0.0)


def understood(found: object, names: Mapping[str, tuple[str, ...]], whose: str) -> dict[str, Any]:
    """What is told by our own names. Raises ValueError for a name that is not known, and for two names of one thing: it
    may be a slip, and what it meant must not be left out unsaid.
    """
    if not isinstance(found, dict):
        raise ValueError(f"{whose} is {found!r}, not an object with {', '.join(names)}")
    ours = {other: name for name, others in names.items() for other in (name, *others)}
    strange = [name for name in found if name not in ours]
    if strange:
        raise ValueError(f"{whose} has {', '.join(map(repr, strange))}; {', '.join(names)} are understood")
    told: dict[str, str] = {}
    for name in found:
        if ours[name] in told:
            raise ValueError(f"{whose} has {told[ours[name]]!r} and {name!r}, which are names of one thing")
        told[ours[name]] = name
    return {name: found[theirs] for name, theirs in told.items()}


def number(told: Mapping[str, Any], name: str, whose: str, otherwise: float | None = None) -> float:
    value = told.get(name, otherwise)
    if value is None:
        if otherwise is not None:
            return otherwise
        raise ValueError(f"{whose} has no {name}")
    return as_number(value, f"the {name} of {whose}")


def as_number(value: object, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{what} is {value!r}, a number is needed")
    return float(value)
