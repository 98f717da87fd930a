"""`python -m app.lab.evaluation FOLDER`: leave-one-valve-out figures of a folder of labelled recordings.

--write puts the model fitted on all of them into app/engine/verdict/parameters.py; --verdicts FILE writes the
leave-one-valve-out verdicts as JSON lines for the scorer; --pairs fits a model for each pair of a sticky and a healthy
valve as well (minutes); --groups leaves whole sources and industries out (minutes); --strangers N asks the engine of PV
and OP of different valves; --stored judges the recordings as other historians would have stored them. Simulated loops
and networks have fixed seeds: the same recordings give the same numbers.
"""

import argparse
import json
import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from app.engine.audit_config import AuditConfig
from app.engine.judged import judge
from app.engine.judgement import Judgement
from app.engine.recording import FloatArray, IntArray
from app.engine.rivals import compete
from app.engine.verdict import shape_model
from app.engine.verdict.shape_model import ShapeModel
from app.engine.verdict.weighing import counted_against
from app.lab.evaluation import parameters, report, scoring
from app.lab.evaluation.components import component_scores
from app.lab.evaluation.fitting import FitConfig, Samples, TextArray, fit
from app.lab.evaluation.leave_group_out import groups_of, models_without
from app.lab.evaluation.leave_one_out import Table, by_valve, calibration_of, fit_of, simulated_samples
from app.lab.evaluation.leave_pair_out import area_by_pairs
from app.lab.evaluation.recordings import Labelled, labelled
from app.lab.evaluation.stored import WAYS
from app.lab.evaluation.strangers import judged as judged_strangers
from app.lab.evaluation.strangers import strangers

_CONFIG = AuditConfig()
_PARAMETERS = Path(shape_model.__file__).with_name("parameters.py")


def main(arguments: list[str] | None = None) -> int:
    options = _options().parse_args(arguments)
    if not (options.folder / "labels.csv").is_file():
        sys.stderr.write(f"no labels.csv in {options.folder}\n")
        return 2
    config = FitConfig()
    simulated = simulated_samples(options.simulated, options.seed)
    # What is learnt from a long record hangs on no label, nor on the fit that is shipped: on it the next one would.
    loops = labelled(options.folder, fit(simulated, simulated, config))
    usable = [loop for loop in loops if loop.features is not None]
    table = _table(usable)
    models = _models_without_each_valve(table, simulated, config)
    raw = np.array([float(models[v].raw_log_odds(x)) for v, x in zip(table.valves, table.values, strict=True)])
    against = np.array([_against(loop) for loop in usable])
    calibration = calibration_of(table, raw, against)
    judged = _judged_all(loops, models, dict.fromkeys(models, calibration))
    _print(loops, judged, models, options.reference)
    _print_nested(loops, table, raw, against, models)
    if options.pairs:
        _print_pairs(loops, table, raw, against, simulated)
    if options.strangers:
        _print_strangers(usable, options.strangers, options.seed)
    if options.groups:
        _print_groups(loops, table, against, simulated)
    if options.stored:
        _print_stored(loops, {valve: replace(model, calibration=calibration) for valve, model in models.items()})
    if options.verdicts:
        options.verdicts.write_text("".join(_line(loop, j) for loop, j in zip(loops, judged, strict=True)))
    everything = fit_of(table, np.full(len(table.valves), True), simulated, config)
    whole = replace(everything, calibration=calibration)
    _say("\n" + report.shipped_beside(whole, shape_model.fitted_model(), table.values))
    if options.write:
        _say(f"wrote {_PARAMETERS.name}, version {parameters.write(whole, _PARAMETERS)}")
    return 0


def _options() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m app.lab.evaluation", description="measure the verdict")
    default = os.environ.get("LOOPAUDIT_RECORDINGS", "../shared/recordings")
    parser.add_argument("folder", type=Path, nargs="?", default=Path(default), help="recordings with labels.csv")
    parser.add_argument("--simulated", type=int, default=9000, help="simulated loops to train on")
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--verdicts", type=Path, help="write the verdicts as JSON lines")
    parser.add_argument("--write", action="store_true", help="write the fitted parameters into the engine")
    parser.add_argument("--pairs", action="store_true", help="AUC from models that miss two valves each (minutes)")
    parser.add_argument("--strangers", type=int, default=0, help="pairs of PV and OP of different valves to draw")
    parser.add_argument("--groups", action="store_true", help="leave whole sources and industries out (minutes)")
    parser.add_argument("--stored", action="store_true", help="judge them as other historians would have stored them")
    parser.add_argument("--reference", action="store_true", help="run the published rule beside it (minutes)")
    return parser


def _table(loops: list[Labelled]) -> Table:
    return Table(
        np.array([loop.features.values for loop in loops if loop.features is not None]),
        np.array([loop.valve for loop in loops]),
        np.array([loop.sticky for loop in loops], dtype=np.int64),
        np.array([loop.trust for loop in loops]),
    )


def _models_without_each_valve(table: Table, simulated: Samples, config: FitConfig) -> dict[str, ShapeModel]:
    valves: TextArray = np.unique(table.valves)
    return {str(v): fit_of(table, table.valves != v, simulated, config) for v in valves}


def _against(loop: Labelled) -> float:
    if loop.features is None or loop.oscillation is None or loop.fitness.record is None:
        return 0.0
    return counted_against(compete(loop.fitness.record, loop.oscillation, loop.features))


def _judged_all(
    loops: list[Labelled], models: dict[str, ShapeModel], calibrations: dict[str, tuple[float, float]]
) -> list[Judgement]:
    calibrated = {valve: replace(model, calibration=calibrations[valve]) for valve, model in models.items()}
    return [_judged(loop, calibrated) for loop in loops]


def _judged(loop: Labelled, models: dict[str, ShapeModel]) -> Judgement:
    """What an audit would say of the loop, with a model that has not seen its valve."""
    return judge(loop.recording, _CONFIG, models.get(loop.valve)).judgement


def _print(loops: list[Labelled], judged: list[Judgement], models: dict[str, ShapeModel], reference: bool) -> None:
    valves, sticky = _labels(loops)
    probability = _probabilities(judged)
    label = scoring.valve_labels(valves, sticky)
    auc, forced = scoring.bootstrap(label, by_valve(valves, probability)[1])
    _say(f"{len(loops)} recordings of {len(label)} valves, leave one valve out\n")
    _say(report.headline(scoring.figures(valves, sticky, judged), auc, forced))
    _say("\nReliability diagram\n\n" + report.reliability_diagram(valves, sticky, probability))
    _say("\nAccuracy against coverage\n\n" + report.accuracy_coverage(valves, sticky, probability))
    scores = component_scores(loops, models, reference)
    tiers = np.array([loop.tier for loop in loops])
    _say("\nBy how sure the label is\n\n" + report.by_tier(valves, sticky, tiers, probability))
    _say("\nEach component alone\n\n" + report.components(valves, sticky, [("verdict", probability), *scores]))
    names = [loop.recording.name for loop in loops]
    _say("\nOn the wrong side\n\n" + report.failures(names, [loop.cause for loop in loops], sticky, judged))


def _print_nested(
    loops: list[Labelled], table: Table, raw: FloatArray, against: FloatArray, models: dict[str, ShapeModel]
) -> None:
    """The same with calibrations that have not seen the valve either."""
    own = {valve: calibration_of(table, raw, against, without=(valve,)) for valve in models}
    found = scoring.figures(*_labels(loops), _judged_all(loops, models, own))
    _say(f"\nWith the calibration nested too: AUC {found.auc:.3f}, forced balanced accuracy {found.forced:.3f}")


def _print_pairs(loops: list[Labelled], table: Table, raw: FloatArray, against: FloatArray, simulated: Samples) -> None:
    """The AUC of pairs of valves, fit and calibration without either."""

    def compared(*pair: str) -> tuple[float, float]:
        model = fit_of(table, ~np.isin(table.valves, pair), simulated, FitConfig())
        calibrated = replace(model, calibration=calibration_of(table, raw, against, without=pair))
        first, second = (_stated([loop for loop in loops if loop.valve == valve], calibrated) for valve in pair)
        return first, second

    valves, sticky = _labels(loops)
    area = area_by_pairs(np.unique(valves), scoring.valve_labels(valves, sticky), compared)
    _say(f"\nWith one sticky and one healthy valve left out at a time, all nested: AUC {area:.3f}")


def _print_strangers(loops: list[Labelled], count: int, seed: int) -> None:
    said = [j for j in map(judged_strangers, strangers(loops, count, seed)) if j is not None]
    sure = [j.verdict for j in said if j.reliability == "reliable"]
    called, cleared = sure.count("stiction"), sure.count("no_stiction")
    _say(f"\nOf {len(said)} pairs of strangers {called} are called sticky and {cleared} cleared, reliably")


def _print_groups(loops: list[Labelled], table: Table, against: FloatArray, simulated: Samples) -> None:
    """Whole sources, then whole industries, fit and calibration without any of their valves."""
    found = []
    for what, groups in groups_of(loops).items():
        models = models_without(groups, table, against, simulated, FitConfig())
        found.append((what, scoring.figures(*_labels(loops), [_judged(loop, models) for loop in loops])))
    _say("\nWith whole groups of valves left out, all nested\n\n" + report.by_way("left out", found))


def _print_stored(loops: list[Labelled], models: dict[str, ShapeModel]) -> None:
    found = (
        (way, [_judged(replace(loop, recording=stored(loop.recording)), models) for loop in loops])
        for way, stored in WAYS.items()
    )
    figures = ((way, scoring.figures(*_labels(loops), judged)) for way, judged in found)
    _say("\nAs other historians would have stored them\n\n" + report.by_way("stored", figures))


def _stated(loops: list[Labelled], model: ShapeModel) -> float:
    """The probability of one valve: the mean over its recordings."""
    return float(_probabilities([_judged(loop, {loop.valve: model}) for loop in loops]).mean())


def _probabilities(judged: list[Judgement]) -> FloatArray:
    return np.array([0.5 if j.stiction_probability is None else j.stiction_probability for j in judged])


def _labels(loops: list[Labelled]) -> tuple[TextArray, IntArray]:
    return np.array([loop.valve for loop in loops]), np.array([loop.sticky for loop in loops], dtype=np.int64)


def _line(loop: Labelled, judgement: Judgement) -> str:
    fields = {
        "recording": loop.recording.name,
        "verdict": judgement.verdict,
        "stiction_probability": judgement.stiction_probability,
        "reliability": judgement.reliability,
        "likely_cause": judgement.likely_cause,
    }
    return json.dumps(fields) + "\n"


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")


if __name__ == "__main__":
    raise SystemExit(main())
