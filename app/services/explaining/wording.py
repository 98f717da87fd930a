"""An explanation in plain words, for pages and reports."""

from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from typing import Any

from app.services.moments import PlantClock, iso_utc
from app.services.telling.naming import isolated
from app.services.telling.wording import LIKELY

LEAST_P = 0.001
VERDICT_WORDS = {
    "missing_physics": "physics is missing from the simulation",
    "consistent": "nothing is missing",
    "inconclusive": "the record cannot tell",
}
LOOP_WORDS = {
    "recorded": "recorded",
    "given": "simulation as given",
    "refitted": "refitted simulation",
    "explained": "explained simulation",
    "with_noise": "  with its noise",
    "as_recorded": "  as the sensor shows it",
}
SIMULATION_WORDS = {
    "trace": "a simulated trace",
    "column": "the simulation recorded with the loop",
    "model": "a given model",
    "identified": "our own linear loop, identified from this record",
}
EFFECT_WORDS = {
    "valve.stiction": "the valve sticks",
    "valve.deadband": "deadband or backlash at the valve",
    "valve.slew_limit": "the valve moves no faster than a limit",
    "valve.saturation": "the valve acts only up to a limit of OP",
    "valve.characteristic": "the valve's characteristic is curved",
    "process.dead_time": "more dead time",
    "process.extra_lag": "another lag in the process",
    "process.integrating": "the process integrates",
    "process.nonlinear_gain": "the gain depends on the operating point",
    "process.outflow_law": "the outflow depends on the level",
    "process.gain_drift": "the gain drifts",
    "process.overflow": "the vessel overflows",
    "process.inverse_response": "the process first answers the wrong way",
    "process.resonance": "the process oscillates by itself",
    "process.friction": "friction in a moving mass",
    "sensor.lag": "the sensor lags",
    "sensor.quantization": "the measurement is coarse",
    "sensor.saturation": "the sensor shows no more than a limit",
    "sensor.drift": "the sensor drifts",
    "sensor.stuck": "the sensor is stuck",
    "sensor.dropout": "the signal of the sensor is lost for a while",
    "sensor.step": "the sensor's reading steps",
    "sensor.compression": "the historian kept only some of the samples",
    "sensor.sample_hold": "PV is measured once an interval and held until the next time",
    "disturbance.oscillation": "a disturbance that oscillates",
    "disturbance.step": "a disturbance that steps",
    "disturbance.ramp": "a disturbance that ramps",
    "disturbance.coupling": "another signal moves PV",
    "unnamed": "something that fits no known physics",
}
EVIDENCE_WORDS = {
    "likelihood": "how much more the effect explains than the simulation without it",
    "margin": "how far behind the next candidate is",
    "residual": "what the free run leaves of PV",
    "refit": "the simulation's own parameters, fitted to the record",
    "scan": "what the effect gains in a quick scan",
    "no_effect_pays": "the best effect gains less than is asked of it",
    "own_loop": "our own loop as it was found behind the stem",
    "own_dynamics": "no simulation was given, and our own loop needed more lags",
    "parameters_off": "other parameters of the simulation explain the record better than any effect, or are far off",
    "lack_of_fit": "unnamed terms still explain much of what the effect leaves",
    "nearest_name": "the name that came nearest, where none fits",
    "held_out_disagrees": "data that no fit has seen contradict what was fitted",
    "whole_disagrees": "what a shortened record suggested does not hold on the full one",
    "held_out_worse": "the free run on data that no fit has seen is worse with the effect, which stands nevertheless",
    "op_moves_nothing": "PV does not answer OP",
    "too_few_data": "too few samples, or too short a record, to judge a simulation",
    "free_run_astray": "the free run is far from PV on unseen data, as with a load that wanders, or acts slowly",
    "too_little_excitation": "OP explains too little of PV to judge a simulation",
    "simulation_unrelated": "the simulated trace does not answer the recorded OP",
    "simulation_shifted": "the simulation is early or late and was shifted before the comparison",
    "simulation_bridged": "samples of the simulation without a value are bridged",
    "second_elsewhere": "the second recording is far from the first: another unit, loop or operating point",
    "second_not_simulated": "the given simulation is not linear, and the second recording has none",
    "simulation_cut": "samples of the simulation outside the recording are not compared",
    "controller_cleared": "a PID law explains OP: the controller works as it should",
    "controller_not_evaluated": "no PID law explains OP: the controller is not judged",
    "controller_differs": "the simulation's controller is tuned differently from the recorded one",
    "yper_lacked": "what the clean simulation lacked for Yper to come out as recorded",
    "pv_held": "PV is held between measurements",
    "pv_levels": "PV takes few levels",
    "pv_at_limit": "PV is at a limit",
    "pv_repeats": "PV repeats one value while the loop moves",
    "pv_dropped": "PV jumps to a value, repeats it and jumps back",
    "pv_frozen": "PV is frozen, with less noise than elsewhere, while the loop moves",
    "pv_straight": "PV lies on straight lines between few samples",
    "read_back": "a measured signal is the valve's own position",
    "given_not_validated": "the given simulation covers only the first or only the second recording",
    "samples_damaged": "a part of the samples cannot be read and is left out",
    "wild_samples": "samples of PV far outside all others are left out",
    "time_runs_back": "times run back in the file",
    "part_explained": "only part of a long record is explained",
    "numbers_in_doubt": "numbers in the file can be read in two ways",
    "times_assumed": "no column of the file is named as times: which one was taken",
    "times_repeated": "samples with a repeated time are left out",
}
SHOWN_WINDOWS = 4
UNASKED = "–"
SAME_RMSE = 0.01
SAME_HELD_OUT = (
    "the held-out RMSE is the same with what was named: on that stretch it changes nothing, or its samples are left "
    "out there"
)
LEFT = (
    "is a pattern of PV, or of OP, left beside the noise model of each? This names nothing, because that model may "
    "absorb what is missing; the names and the held-out RMSE decide:"
)
WAVE_PARTS = ("sine", "cosine")
"""How the numbers of a wave begin, of which any may be zero."""
SIZED_ELSEWHERE = ("valve.stiction", "valve.deadband")
NO_SIZE = "S and J of the model that reproduces PV, not the size: the audit states that, and J cannot be determined"
RANGES = "The range behind a number is right only where the model is. It is no 95 % interval on a plant's records"
HELD = (
    "since engine 0.1.17 those of a valve's S count what OP did between two samples, and held the true S in 34 of 35 "
    "simulated loops, most of other forms than the model (before that in 11 of 33, of nine simulated nights)"
)


def effect_words(code: str) -> str:
    return EFFECT_WORDS.get(code, code.replace(".", ": ").replace("_", " "))


def number(value: float | None) -> str:
    return "–" if value is None else f"{value:.4g}"


def parameters_in_words(parameters: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """ "S = 4.1 OP (3.9 to 4.3)": value, unit and the range of the fit, where it has one."""
    return [
        f"{name} = {number(p['value'])} {p['unit']} ({interval_in_words(name, p)})" for name, p in parameters.items()
    ]


def interval_in_words(name: str, parameter: Mapping[str, Any]) -> str:
    low, high = parameter["low"], parameter["high"]
    if low == high:
        return "no interval"
    about_zero = not name.startswith(WAVE_PARTS) and (low or 0.0) < 0.0 < (high or 0.0)
    return f"{number(low)} to {number(high)}" + ("; it may be zero" if about_zero else "")


def windows_in_words(windows: Sequence[Sequence[float]], start: str | None, clock: PlantClock) -> str:
    """The first of the windows, by the plant's clock as the chart beside them; in seconds from the start of a record
    that has no date (`start`, ISO 8601, None: not known)."""
    first = windows[:SHOWN_WINDOWS]
    if start is None or not clock.dated(start):
        told = [f"{begin:.0f}–{end:.0f} s" for begin, end in first]
    else:
        told = [_stretch(start, window, clock) for window in first]
    shown = ", ".join(told)
    left = len(windows) - SHOWN_WINDOWS
    return f"{shown} and {left} more" if left > 0 else shown


def _stretch(start: str, window: Sequence[float], clock: PlantClock) -> str:
    """2026-01-31 04:00:00 to 04:10:00."""
    began = datetime.fromisoformat(start)
    first, last = (iso_utc(began + timedelta(seconds=at)) or "" for at in window)
    return clock.span(first, last, to_the_second=True)


def in_words(found: dict[str, Any], clock: PlantClock) -> dict[str, Any]:
    """An explanation with what pages and reports say of it."""
    return found | {
        "verdict_words": verdict_in_words(found["verdict"], found["effects"], found["evidence"]),
        "named": named(found["effects"]),
        "simulation_words": SIMULATION_WORDS[found["simulation"]],
        "told_effects": [effect_in_words(effect, found["window_start"], clock) for effect in found["effects"]],
        "errors": errors(found["fit"], bool(found["effects"])),
        "loops": loops(found["closed_loop"]),
        "reasons": [isolated(reason["text"]) for reason in found["evidence"]],
        "unmoved": unmoved(found["fit"], found["effects"]) if found["fit"] else [],
        "ranges": ranges_of(found["effects"]),
    }


def ranges_of(effects: Sequence[Mapping[str, Any]]) -> str:
    """How far the ranges behind the numbers of effects can be trusted, and how often those of a valve's S held; nothing
    where there are none.
    """
    ranged = {effect["effect"] for effect in effects if effect["parameters"]}
    return (f"{RANGES}: {HELD}." if ranged & set(SIZED_ELSEWHERE) else f"{RANGES}.") if ranged else ""


def no_size(effect: Mapping[str, Any]) -> str:
    """That the numbers of a valve are not its size; nothing where there are none."""
    return NO_SIZE if effect["effect"] in SIZED_ELSEWHERE and effect["parameters"] else ""


def verdict_in_words(
    verdict: str | None, effects: Sequence[Mapping[str, Any]], evidence: Sequence[Mapping[str, Any]]
) -> str:
    """Where no name is likelier than all others together, that one is named for lack of a better one is said too; and
    of a simulation that lacks nothing, that its parameters are not the loop's."""
    words = VERDICT_WORDS.get(verdict or "", "")
    if verdict == "consistent" and any(reason["code"] == "parameters_off" for reason in evidence):
        return f"{words}, but the simulation's own parameters are off"
    return (
        words if verdict != "missing_physics" or named(effects) else f"{words}; which one, the record can hardly tell"
    )


def named(effects: Sequence[Mapping[str, Any]]) -> bool:
    """Whether one name is likelier than all others together."""
    return max((effect["probability"] for effect in effects), default=1.0) >= LIKELY


def effect_in_words(effect: dict[str, Any], start: str | None, clock: PlantClock) -> dict[str, Any]:
    return {
        "code": effect["effect"],
        "words": effect_words(effect["effect"]),
        "alternatives": [effect_words(code) for code in effect["alternatives"]],
        "probability": effect["probability"],
        "block": effect["block"],
        "condition": isolated(effect["condition"]),
        "parameters": list(map(isolated, parameters_in_words(effect["parameters"]))),
        "no_size": no_size(effect),
        "windows": windows_in_words(effect["windows"], start, clock),
        "reasons": [isolated(reason["text"]) for reason in effect["evidence"]],
    }


def errors(fit: dict[str, Any] | None, any_named: bool) -> list[tuple[str, ...]]:
    """Free-run error and fit on the stretch that no fit has seen, and whether a pattern or OP is seen in what is left
    there: as given, refitted, explained. any_named: whether an effect is; without one nothing is said to be missing.
    """
    if fit is None:
        return []
    explained = "with the missing physics" if any_named else "as explained: no effect is named"
    names = {"given": "as given", "refitted": "its own parameters fitted", "explained": explained}
    return [
        (words, number(fit[f"rmse_{name}"]), number(fit[f"fit_pct_{name}"]), *residuals_in_words(fit, name))
        for name, words in names.items()
        if fit[f"rmse_{name}"] is not None
    ]


def residuals_in_words(fit: dict[str, Any], name: str) -> tuple[str, str]:
    """Whether a pattern is left in what a simulation leaves, once a noise model is fitted to that, and whether OP is
    seen in it; a dash where it was not asked."""
    tests = (fit.get("residuals") or {}).get(name) or {}
    return outcome(tests.get("whiteness")), outcome(tests.get("independence"))


def outcome(test: dict[str, Any] | None) -> str:
    """A dash too where an answer was kept without a figure."""
    if test is None or test["p"] is None or test["statistic"] is None:
        return UNASKED
    chance = "p < 0.001" if test["p"] < LEAST_P else f"p {test['p']:.2g}"
    return f"{'none seen' if test['statistic'] <= test['limit'] else 'yes'} ({chance})"


def left_in_words(fit: dict[str, Any], figures_of: Mapping[str, str | None]) -> list[str]:
    """What each simulation leaves, and that this names nothing: its noise model takes up much of what is missing."""
    lines, asked = [], False
    for name, of in figures_of.items():
        white, free = residuals_in_words(fit, name)
        known = (white, free) != (UNASKED, UNASKED)
        asked |= known
        if of is not None:
            lines.append(f"{name}: {of}" + (f"; pattern: {white}, OP in it: {free}" if known else ""))
    return [LEFT, *lines] if asked else lines


def beyond_held_out(fit: Mapping[str, Any], effects: Sequence[Mapping[str, Any]]) -> list[str]:
    """Of which named effects the held-out error says nothing, because they do not act there."""
    held = fit["held_out"] or []
    return [
        f"{effect['effect']} does not act in the stretch that no fit has seen: the held-out RMSE says nothing about it"
        for effect in effects
        if held and effect["windows"] and not any(_overlap(own, part) for own in effect["windows"] for part in held)
    ]


def unmoved(fit: Mapping[str, Any], effects: Sequence[Mapping[str, Any]]) -> list[str]:
    """Says so where what was named moves the held-out error by less than a hundredth."""
    refitted, explained = fit["rmse_refitted"], fit["rmse_explained"]
    if not effects or not refitted or explained is None or abs(explained - refitted) > SAME_RMSE * refitted:
        return []
    return beyond_held_out(fit, effects) or [SAME_HELD_OUT]


def _overlap(one: Sequence[float], other: Sequence[float]) -> bool:
    return one[0] < other[1] and other[0] < one[1]


def loops(closed: dict[str, Any] | None) -> list[tuple[str, ...]]:
    """Period, amplitude, Yper and wave shape of the loop as recorded, and as simulated from SP alone; those that did
    not settle, or that there are none of, are left out.
    """
    known = [(words.strip(), (closed or {}).get(name)) for name, words in LOOP_WORDS.items()]
    return [
        (words, *(number(f[figure]) for figure in ("period_s", "amplitude", "yper_pct", "shape")))
        for words, f in known
        if f is not None
    ]
