"""`python -m app.lab.evaluation.causes [FOLDER]`: how often a stated likely cause is right.

Simulated loops of known cause, and the recordings whose label states one. The seed's loops are new to the thresholds.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path

from app.engine.audit import audit
from app.engine.codes import Cause
from app.lab.evaluation.recordings import labelled
from app.lab.testbench.causes import spoiled_loops

NONE_STATED = "none stated"
_LOAD: tuple[Cause, ...] = ("disturbance", "no_oscillation")
_SINE: tuple[Cause, ...] = ("external_oscillation", "tuning_or_sinusoidal_disturbance")
_TUNING: tuple[Cause, ...] = ("tight_tuning", "aggressive_controller", "tuning_or_sinusoidal_disturbance")

RIGHT: dict[str, tuple[Cause, ...]] = {
    "stiction": ("stiction",),
    "backlash": ("stiction", "backlash"),
    "tight_tuning": _TUNING,
    "aggressive_controller": _TUNING,
    "sluggish_controller": ("sluggish_controller",),
    "sine_from_outside": _SINE,
    "wandering_load": _LOAD,
    "load_steps": _LOAD,
    "quiet": _LOAD,
    "set_point_following": ("set_point_following",),
    "saturated_op": ("saturated_op",),
    "quantised_sensor": ("quantised_sensor",),
    "sensor_spikes": ("sensor_spikes",),
    "sensor_sticking": ("sensor_sticking",),
}
"""Which stated causes are right for a simulated one. A deadband is a fault of the valve too."""

RIGHT_OF_LABELS: dict[str, tuple[Cause, ...]] = {
    "no_oscillation": _LOAD,
    "quantisation": ("quantised_sensor",),
    "sensor_fault": ("sensor_spikes", "sensor_sticking", "quantised_sensor"),
    "external_disturbance": (*_SINE, *_LOAD),
    "dead_zone+tight_tuning": (*_TUNING, "backlash"),
    "tuning": _TUNING,
    "saturation": ("saturated_op",),
}
"""The same for the labels of recordings; a label that names no cause ("other") is left out."""


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m app.lab.evaluation.causes", description="measure the causes")
    parser.add_argument("folder", type=Path, nargs="?", help="recordings with labels.csv")
    parser.add_argument("--each", type=int, default=30, help="simulated loops of each cause")
    parser.add_argument("--seed", type=int, default=2)
    options = parser.parse_args(arguments)
    simulated = [
        (x.cause, audit(x.recording).judgement.likely_cause) for x in spoiled_loops(options.each, options.seed)
    ]
    _say(confusion(simulated, RIGHT))
    if options.folder is not None:
        recorded = [
            (loop.cause, audit(loop.recording).judgement.likely_cause, loop.recording.name)
            for loop in labelled(options.folder)
            if loop.cause in RIGHT_OF_LABELS
        ]
        _say("\n" + confusion([(truth, said) for truth, said, _ in recorded], RIGHT_OF_LABELS))
        _say("\n" + "\n".join(f"{name}: {truth}, stated: {said or NONE_STATED}" for truth, said, name in recorded))
    return 0


def confusion(stated: Iterable[tuple[str, str | None]], right: Mapping[str, tuple[str, ...]]) -> str:
    """A table by true cause: how many, stated right, stated wrong (with what), not stated; then the share right."""
    pairs = list(stated)
    lines = ["| true cause | loops | right | wrong | none stated | what was stated |", "|---|---|---|---|---|---|"]
    for truth in dict.fromkeys(truth for truth, _ in pairs):
        said = Counter(cause or NONE_STATED for t, cause in pairs if t == truth)
        good = sum(n for cause, n in said.items() if cause in right[truth])
        silent = said[NONE_STATED]
        told = ", ".join(f"{cause} {n}" for cause, n in said.most_common())
        lines.append(f"| {truth} | {said.total()} | {good} | {said.total() - good - silent} | {silent} | {told} |")
    rivals = [(truth, cause) for truth, cause in pairs if cause not in (None, "stiction")]
    hits = sum(cause in right[truth] for truth, cause in rivals)
    share = f", {100.0 * hits / len(rivals):.0f} %" if rivals else ""
    return (
        "\n".join(lines)
        + f"\n\nA cause other than stiction was stated {len(rivals)} times and right {hits} times{share}."
    )


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")


if __name__ == "__main__":
    raise SystemExit(main())
