"""The stable codes of the engine's reasons and causes, spelled once: a type checker finds what is spelled otherwise.

What each means to people is told by the services (`telling.wording`, `telling.reason_wording`, `explaining.wording`).
"""

from typing import Literal, cast

Cause = Literal[
    "stiction", "external_oscillation", "disturbance", "tuning_or_sinusoidal_disturbance", "tight_tuning",
    "aggressive_controller", "sluggish_controller", "backlash", "set_point_following", "no_oscillation", "saturated_op",
    "quantised_sensor", "sensor_spikes", "sensor_sticking", "stuck_valve_or_dead_transmitter", "controller_not_acting",
    "not_in_automatic", "on_off_control", "op_at_limits", "sampled_too_slowly",
]  # fmt: skip
"""What drives a loop, or spoils its record."""

UNANSWERED: Cause = "stuck_valve_or_dead_transmitter"
"""The cause where PV does not answer OP at all: a failure to be looked at today, whatever is said of stiction."""

NO_ANSWER_VERDICTS = ("inconclusive", "not_auditable")
"""The verdicts that name it."""

CheckCode = Literal[
    "too_short", "missing_values", "wild_samples", "not_in_automatic", "gaps", "filled", "op_flat", "pv_flat",
    "op_two_values", "op_at_limits", "samples_per_cycle", "few_cycles", "irregular_sampling", "pv_quantised",
    "op_quantised", "pv_interpolated", "op_interpolated", "time_skew", "stored_points", "size_regularity",
    "size_cycles", "size_samples_per_cycle", "size_evidence", "size_as_sampled", "size_width",
]  # fmt: skip
"""What a record is checked for before it is audited, and before a size of stiction is told."""

ReasonCode = Literal[
    Cause, CheckCode,
    "no_variation", "evidence_not_clear", "not_cleared", "few_samples", "windows_disagree", "uncoupled_slowly",
    "uncoupled", "same_signal", "set_point_moves", "set_point_rests", "nearly_sinusoidal", "keeps_time", "pv_stands",
    "wound_up", "no_answer", "hidden_band", "own_cycle", "foreign_cycle", "outside_corners", "linear_look_alikes",
    "pv_does_not_answer", "answers_no_more",
    "prior_only", "filled_share", "mode_share", "record_too_short", "flat_signal", "not_finite", "signal_length",
    "published_methods", "reference_disagrees", "yper_high_stiction", "yper_low_no_stiction", "yper_high_no_stiction",
    "yper_low_stiction", "rmse_least_with_stiction", "rmse_least_without_stiction", "two_parameter_disagrees",
    "search_space_widened", "search_space_not_widened", "record_too_short_to_widen", "reference_only",
    "newer_judged", "newer_disagrees", "stretches", "stretches_disagree", "short_lived_stiction", "stiction_ended",
    "stiction_began",
    "since_repair", "before_repair", "moves_no_valve", "moves_set_point", "shaken_by_neighbour",
    "stood_together",
]  # fmt: skip
"""Why a verdict or its reliability is what it is; beside these `shape_` and the name of a feature (`shape_code`)."""

EvidenceCode = Literal[
    "likelihood", "margin", "residual", "refit", "scan", "no_effect_pays", "own_loop", "own_dynamics", "parameters_off",
    "lack_of_fit", "nearest_name", "held_out_disagrees", "held_out_worse", "op_moves_nothing", "too_few_data",
    "free_run_astray", "too_little_excitation", "simulation_unrelated", "simulation_shifted", "simulation_cut",
    "simulation_bridged", "second_elsewhere", "given_not_validated", "second_not_simulated", "samples_damaged",
    "controller_cleared", "controller_not_evaluated", "controller_differs", "yper_lacked", "pv_held", "pv_levels",
    "pv_at_limit", "pv_repeats", "pv_dropped", "pv_frozen", "pv_straight", "read_back", "wild_samples",
    "time_runs_back", "part_explained", "numbers_in_doubt", "times_assumed", "times_repeated", "whole_disagrees",
]  # fmt: skip
"""What an explanation rests on, and what is said of the comparison."""


def shape_code(feature: str) -> ReasonCode:
    """The code of the reason that a feature gives, by its name in `features.NAMES`."""
    return cast(ReasonCode, f"shape_{feature}")
