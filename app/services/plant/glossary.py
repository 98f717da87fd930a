"""What each figure means, where it comes from, and where it misleads: for the pages and for whoever asks why."""

from dataclasses import dataclass
from typing import Any

from app.services.audit_json.models import AuditFields, KeyFiguresLine, ReliabilityRow

JELALI = ("Jelali 2013, Control Performance Management in Industrial Automation", "10.1007/978-1-4471-4546-2")
HARRIS = ("Harris 1989; Desborough and Harris 1992", "10.1002/cjce.5450670519")
THORNHILL = ("Thornhill, Huang, Zhang 2003, J. Process Control 13, 91-100", "10.1016/S0959-1524(02)00007-0")
YPER = ("Srinivasan, Spinner, Rengaswamy 2015, Ind. Eng. Chem. Res. 54, 7476-7488", "10.1021/acs.iecr.5b00939")
OURS = ("loopaudit", "")


@dataclass(frozen=True)
class Figure:
    """A key figure: its field, its name for people, unit ("PV", "OP": that of the signal), digits, source, caveat."""

    field: str
    label: str
    unit: str
    digits: int
    source: tuple[str, str]
    caveat: str = ""

    @property
    def definition(self) -> str:
        for model in (KeyFiguresLine, AuditFields, ReliabilityRow):
            if self.field in model.model_fields:
                return model.model_fields[self.field].description or ""
        raise KeyError(self.field)


FIGURES = (
    Figure("health", "Health", "of 100", 0, OURS, "Its weights are chosen, not fitted: see what it is made of."),
    Figure("good_share_pct", "Good samples", "%", 1, JELALI),
    Figure("service_factor_pct", "Service factor", "%", 1, JELALI),
    Figure("op_saturation_pct", "OP at a limit", "%", 1, JELALI),
    Figure("op_at_extreme_pct", "OP at its own extreme, span not known", "%", 1, OURS),
    Figure("error_mean", "Control error, mean", "PV", 3, JELALI),
    Figure("error_std", "Control error, standard deviation", "PV", 3, JELALI),
    Figure("error_abs_mean", "Control error, mean size", "PV", 3, JELALI),
    Figure("error_abs_mean_pct_of_span", "Control error, mean share of PV's span", "%", 2, JELALI),
    Figure("error_abs_p95", "Control error, 95 % are below", "PV", 3, JELALI),
    Figure("error_p05", "Control error, 5th percentile", "PV", 3, JELALI),
    Figure("error_median", "Control error, median", "PV", 3, JELALI),
    Figure("error_p95", "Control error, 95th percentile", "PV", 3, JELALI),
    Figure("variability_pct", "Variability of PV", "%", 2, JELALI, "Left out where PV is near zero."),
    Figure("pv_std", "PV, standard deviation", "PV", 3, JELALI),
    Figure("op_std", "OP, standard deviation", "OP", 3, JELALI),
    Figure("oscillation_period_s", "Period of the oscillation", "s", 0, THORNHILL),
    Figure(
        "oscillation_regularity",
        "Regularity of the oscillation",
        "(regular above 1; at most 100)",
        1,
        THORNHILL,
        "Above 1 it is regular; values above 100 are not shown. What a wandering load leaves is often above 1 too, "
        "but seldom stronger than 0.5: look at both.",
    ),
    Figure("oscillation_strength", "Strength of the oscillation", "(0 none, 1 strongest)", 2, THORNHILL),
    Figure(
        "op_travel_per_h", "Valve travel asked for", "OP an hour", 1, JELALI, "OP's travel: the stem may not follow."
    ),
    Figure("op_travel_pct_of_span_per_h", "Valve travel asked for, share of OP's span", "% an hour", 1, JELALI),
    Figure(
        "op_reversals_per_h",
        "Reversals",
        "an hour",
        1,
        JELALI,
        "Where OP is noisy, its noise counts, all the more with faster sampling and the less OP moves otherwise: "
        "compare nights with the same sampling interval and similar loads.",
    ),
    Figure("response_time_s", "Time an upset is felt", "s", 0, JELALI, "Closed loop; gaps in the record shorten it."),
    Figure(
        "harris_index",
        "Harris index",
        "(1 is best, 0 worst)",
        2,
        HARRIS,
        "Rests on an assumed dead time, the same for every loop, and penalises loops that follow a set point or let "
        "a level float: compare a loop with itself over time, never one loop with another. Not given where a "
        "historian drew PV on straight lines between the samples that it kept: these predict themselves.",
    ),
    Figure("harris_horizon_samples", "Dead time the Harris index assumes", "samples", 0, HARRIS),
    Figure("yper_pct", "Yper", "%", 1, YPER, "A measure of how far the identification can be trusted, not a detector."),
    Figure("stiction_band_pct_of_op_range", "Band d of the published rule (not the size)", "% of OP's range", 1, YPER),
)


def figures(row: dict[str, Any], pv_unit: str | None = None) -> list[tuple[Figure, float | None, str]]:
    """Each figure with its value in a loop's newest verdict (None: not known) and its unit in words."""
    words = {"PV": pv_unit or "unit of PV", "OP": "unit of OP", "OP an hour": "units of OP an hour"}
    return [(figure, row.get(figure.field), words.get(figure.unit, figure.unit)) for figure in FIGURES]
