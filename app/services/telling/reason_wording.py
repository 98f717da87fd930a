"""What the codes of a verdict's reasons mean: the reason itself says what was measured."""

from app.engine.features import NAMES
from app.engine.verdict.wording import WORDED, is_spoken, sentence_without_value

# Codes of the checks before an audit. The first part refuses a recording; the others only make it doubtful.
_DATA = {
    "too_short": "The recording has too few samples.",
    "missing_values": "PV and OP have a value together in too few samples.",
    "wild_samples": "Samples far from all others, one or two in a row, were taken as missing.",
    "not_in_automatic": "The recorded mode says automatic for too few samples in a row.",
    "gaps": "Holes leave no stretch that is long enough.",
    "filled": "Too many samples had to be interpolated.",
    "op_flat": "OP holds one value: no controller acts, or the signal is frozen.",
    "pv_flat": "PV holds one value: the valve is stuck, or the transmitter is dead.",
    "op_two_values": "OP is switched between two values: it does not show how a valve follows it.",
    "op_at_limits": "OP is at an end of its span for most of the time.",
    "samples_per_cycle": "An oscillation has too few samples per cycle to have a shape.",
    "irregular_sampling": "Sampling is irregular: the record was interpolated to even steps.",
    "pv_quantised": "PV has few levels over its range: its resolution is coarse.",
    "op_quantised": "OP has few levels over its range.",
    "pv_interpolated": "PV mostly lies on straight lines: the historian compressed it.",
    "op_interpolated": "OP mostly lies on straight lines: the historian compressed it, or it integrates a standing PV.",
    "time_skew": "OP and the PV that responds to it have time stamps some samples apart; they were aligned.",
    "stored_points": "The historian stored too few points of PV per cycle: the shape is the historian's own.",
    "filled_share": "So many samples were interpolated that the verdict is not reliable.",
    "mode_share": "The loop was in automatic for too small a part of the recording for the verdict to be reliable.",
    "record_too_short": "The record is too short for an identification.",
    "flat_signal": "PV or OP does not move in the stretch to be identified.",
    "not_finite": "PV or OP has missing values in the stretch to be identified.",
    "signal_length": "PV and OP differ in length.",
}
_DOUBTS = {
    "no_variation": "PV or OP does not vary in the audited stretch: nothing can be said.",
    "evidence_not_clear": "The probability of stiction is too near one half for the verdict to be reliable.",
    "not_cleared": "Another cause explains the record, but the shapes alone do not clear the valve.",
    "few_cycles": "The record holds too few cycles to be trusted.",
    "few_samples": "The record holds too few samples to be trusted.",
    "windows_disagree": "Parts of the record disagree about the valve.",
    "uncoupled_slowly": "PV and OP are related only in their fast movements, not over part of a cycle.",
    "uncoupled": "PV and OP are unrelated: they may belong to two loops.",
    "same_signal": "PV is OP on another scale: a proportional-only controller, one tag for both, or no process.",
    "set_point_moves": "PV and OP mostly follow the set point, so that their shape need not be the valve's.",
    "set_point_rests": (
        "The set point hides a limit cycle: judged where the set point is constant and the loop cycles by itself."
    ),
    "nearly_sinusoidal": "PV and OP are nearly one sine, so that their shape need not be the valve's.",
    "keeps_time": "The cycles keep time, as if driven by a timer or a machine; a valve that sticks does not.",
    "pv_stands": (
        "PV has been frozen up to the end of the record while OP moved, which never happened before: dead "
        "transmitter, or stuck valve."
    ),
    "answers_no_more": "PV has stopped answering OP, which moves up and down: a stuck stem, or another signal.",
    "no_answer": "PV shows no answer to OP: a valve that is stuck fast looks the same, whatever the shapes say.",
    "hidden_band": "PV moves as if the valve had a deadband: it may stick, or have backlash, whatever the shapes say.",
    "foreign_cycle": "PV does not move as it would if the valve caused the oscillation: the cause may be elsewhere.",
    "outside_corners": (
        "PV reverses by itself, not where OP has travelled far enough: a load elsewhere may make the corners."
    ),
    "linear_look_alikes": "Under a wandering load, a loop whose valve does not stick would look as sticky by chance.",
    "wound_up": (
        "OP has stayed at its limit, which never happened before, and PV does not come back: is the valve stuck?"
    ),
    "pv_does_not_answer": "OP moves and PV does not answer at all: a stuck valve, or a dead transmitter.",
    "prior_only": "The probability is a prior for these two causes, not a measurement.",
}
_FOR = {
    "own_cycle": (
        "PV moves as it does with a valve that sticks for much of a cycle: the oscillation is probably its own."
    )
}
_NEIGHBOURS = {
    "moves_no_valve": (
        "OP moves no valve, according to the loop's settings: the valve is judged at the loop whose set point it is."
    ),
    "moves_set_point": "OP is another loop's set point: unless it also moves a valve, the valve is judged there.",
    "stood_together": "PV of other loops froze at about the same time: look first at what they share.",
    "shaken_by_neighbour": (
        "The loop oscillates in step with one that is more likely the source and may be disturbing it."
    ),
}
_METHODS = {
    "published_methods": "How the published methods vote; they do not affect the verdict.",
    "reference_disagrees": "The published rule disagrees with the verdict.",
    "yper_high_stiction": "Published rule: Yper is high and the identification finds stiction; reliable by table 2.",
    "yper_low_no_stiction": "Published rule: Yper is low and the identification finds none; reliable by table 2.",
    "yper_high_no_stiction": "Published rule: Yper is high, the identification finds none; not reliable by table 2.",
    "yper_low_stiction": "Published rule: Yper is low, the identification finds stiction; not reliable by table 2.",
    "rmse_least_with_stiction": "Published rule: a valve with a stiction band predicts PV best.",
    "rmse_least_without_stiction": "Published rule: a valve without a stiction band predicts PV best.",
    "two_parameter_disagrees": "Published rule: the two-parameter valve model and the one-parameter one disagree.",
    "search_space_widened": "Published rule: the search space was widened to reach agreement.",
    "search_space_not_widened": "Published rule: the search space was not widened, because the shapes clear the valve.",
    "record_too_short_to_widen": "Published rule: the record is too short for the next search space.",
    "reference_only": "Verdict and probability come from the published rule alone and are not calibrated.",
}
NO_VOTE = frozenset(_METHODS)
"""Codes of what is only heard."""

_EPISODES = {
    "stretches": "A long record was judged stretch by stretch; the middle one speaks for it.",
    "newer_judged": (
        "The newest stretch is judged by itself: it is sufficient for a reliable verdict, and the longest one is older."
    ),
    "newer_disagrees": "A newer and shorter stretch says otherwise.",
    "stretches_disagree": "Of a long record's stretches fewer than two of three, or none of the newest two, agree.",
    "short_lived_stiction": "The valve sticks in one spell of a long record; the rest does not show it.",
    "stiction_ended": "The valve stuck at the beginning of the record, and no sign of it since.",
    "stiction_began": "The valve sticks up to the end of the record; its beginning does not show it.",
}
_REPAIRS = {
    "since_repair": "The loop is judged on what was recorded since its repair.",
    "before_repair": "The verdict is from before the repair: too little has been recorded since.",
}
_SIZE = {
    "size_regularity": "The oscillation is too irregular for the size of stiction to be determined.",
    "size_cycles": "The record has too few cycles for the size to be determined.",
    "size_samples_per_cycle": "A cycle has too few samples for the size to be determined.",
    "size_evidence": "Stiction explains too little of PV for its size to be determined.",
    "size_as_sampled": "A historian rebuilt PV or OP, so that the size cannot be determined.",
    "size_width": "The interval of the size is too wide for it to be determined.",
}


def _shape(name: str) -> str:
    """What a shape says for and against stiction, without the value that it had."""
    sides = (("for", True), ("against", False))
    return "; ".join(
        f"{side} stiction: {sentence_without_value(name, on)}" for side, on in sides if is_spoken(name, on)
    )


_SHAPES = {f"shape_{name}": _shape(name) for name in NAMES if name in WORDED}

REASON_WORDS = {**_DOUBTS, **_FOR, **_DATA, **_METHODS, **_EPISODES, **_REPAIRS, **_NEIGHBOURS, **_SIZE, **_SHAPES}
