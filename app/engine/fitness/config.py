"""When a recording is fit to be audited: the thresholds of the checks, none of them in an engineering unit."""

from dataclasses import dataclass

LIMIT_BAND = 0.005
"""How near to an end of OP's known span counts as at the limit, as a share of the span."""

FEWEST_VALUES = 10
"""Of OP while PV stands: a unit that is shut down by hand has fewer."""


@dataclass(frozen=True)
class FitnessConfig:
    """Thresholds of the fitness checks. Shares are of samples, 0 to 1.

    min_samples: fewest usable samples in one stretch; the smallest ladder rungs have some ten parameters to find.
    wild_ranges, most_wild, most_wild_spells: so many times the range of a signal (without its outermost values) outside
    of that, for so many samples in a row at most and so often, a value is no measurement: a dropout, or a code of a
    system. What the loop does lasts longer, goes less far or comes again. aside_ranges, jump_ranges: nor is it less far
    outside, where it is so many ranges from what is around it.
    newest_share: the newest stretch that has this share of the samples of the longest is judged in its place.
    max_gap_intervals, max_gap_share, most_gap_intervals: a hole longer than this many sampling intervals splits the
    record, a shorter one is filled; of long records one is filled up to that share of their samples, but not beyond so
    many intervals.
    jitter_tolerance, off_clock: a stretch is taken as regular where its intervals all lie within this share of their
    median, or its stamps within that share of an interval of an even clock.
    max_filled_share: more filled samples than this, and the record says more about the filling than about the valve.
    flat_share: a signal that does not change for this share of the stretch is dead there.
    least_still, longer_still: PV that holds one value up to the end of the stretch, for so many samples and so many
    times as long as ever before, while OP takes fewest_moves values and goes over least_move of what it goes over in
    such a time else, has died: a frozen transmitter, or a stuck valve. Where all is calm PV may stand. Of a recording
    so many samples of one value are a stand too, whatever it held before (`standstill`).
    least_at_limit, most_jump, one_sided: OP that stands at its extremes for half of the time once it stood there for so
    many samples, and came there by less than this share of its range at once, is wound up, if PV is on the side from
    which that would bring it back for this share of the time more than on the other.
    two_values_share: OP near either of two values for this share of the stretch is switched between them, where it is
    near each of them for least_of_two_values and goes from one to the other fewest_switches times (fewer are steps of a
    load or a set point), mostly with most_on_the_way samples between at most (with more it runs from limit to limit).
    op_limit_share: OP at one limit for this share of the stretch is not controlling.
    op_limit_band: how near to the end of a known span counts as at the limit, as a share of the span.
    min_samples_per_cycle: fewest samples in one period of a regular oscillation.
    min_cycles, min_levels, max_on_line_share, min_stored_points (of PV, in a cycle): beyond these the record is still
    audited, and its findings say so.
    """

    min_samples: int = 100
    wild_ranges: float = 5.0
    aside_ranges: float = 1.0
    jump_ranges: float = 1.0
    most_wild: int = 2
    most_wild_spells: int = 6
    newest_share: float = 0.5
    max_gap_intervals: float = 10.0
    max_gap_share: float = 0.05
    most_gap_intervals: float = 40.0
    jitter_tolerance: float = 0.25
    off_clock: float = 0.45
    max_filled_share: float = 0.3
    flat_share: float = 0.5
    least_still: int = 100
    longer_still: float = 5.0
    fewest_moves: int = FEWEST_VALUES
    least_move: float = 0.5
    least_at_limit: int = 20
    most_jump: float = 0.1
    one_sided: float = 0.8
    two_values_share: float = 0.9
    least_of_two_values: float = 0.05
    fewest_switches: int = 6
    most_on_the_way: float = 1.0
    op_limit_share: float = 0.5
    op_limit_band: float = LIMIT_BAND
    min_samples_per_cycle: float = 4.0
    min_cycles: float = 3.0
    min_levels: float = 10.0
    max_on_line_share: float = 0.3
    min_stored_points: float = 6.0
