"""Long records window by window: stretches in which the valve sticks, and when.

Three windows of fifteen cycles speak for a whole record well where it is of one piece. A long one need not be: a valve
sticks for a shift, or is repaired. Here the whole record is covered, cheaply: a window is weighed only where it swings.
"""

from dataclasses import dataclass

import numpy as np

from app.engine.codes import ReasonCode
from app.engine.evidence import Reason, told_probability
from app.engine.features import extract
from app.engine.judgement import Reliability
from app.engine.long_records.episode_edges import refined
from app.engine.oscillation import Oscillation, detect
from app.engine.recording import UniformRecord
from app.engine.rivals import compete
from app.engine.verdict.shape_model import ShapeModel, fitted_model
from app.engine.verdict.weighing import weigh_features

SPELL: ReasonCode = "short_lived_stiction"
ENDED: ReasonCode = "stiction_ended"
BEGAN: ReasonCode = "stiction_began"


@dataclass(frozen=True)
class EpisodeConfig:
    """When a record is looked at window by window, and what is an episode.

    long_samples, long_cycles: a record is long with more samples than the former, or with more than half of them and
    more cycles than the latter.
    cycles: of the record's oscillation in a window, at least. most_windows: bounds the cost.
    screen_strength, screen_irregular, screen_cycles: an oscillation (an irregular one) that is weaker, or shorter, is
    not weighed.
    sticky_from: probability of a window in an episode; reliable_from: median probability of a reliable episode, which
    has at least `reliable_windows` windows. least_windows: sticky windows in an episode; they overlap by half.
    bridged_windows: so many that say nothing or less may lie between two sticky ones.
    rest_below: median probability of the windows outside; with a higher one the record is of one piece.
    """

    long_samples: int = 5000
    long_cycles: float = 45.0
    cycles: float = 15.0
    most_windows: int = 24
    screen_strength: float = 0.2
    screen_irregular: float = 0.3
    screen_cycles: float = 5.0
    sticky_from: float = 0.7
    reliable_from: float = 0.85
    least_windows: int = 2
    bridged_windows: int = 2
    rest_below: float = 0.4
    reliable_windows: int = 3


@dataclass(frozen=True)
class WindowEvidence:
    """One window, in s from the start of the recording. probability: of stiction; 0 where nothing swings in it."""

    start_s: float
    end_s: float
    probability: float
    period_s: float | None


@dataclass(frozen=True)
class Episode:
    """A stretch in which the valve sticks. start_s, end_s: in s from the start of the recording.

    probability: median of its windows. period_s: median period in them. at_start, at_end: whether it reaches the
    record's start or end.
    """

    start_s: float
    end_s: float
    probability: float
    reliability: Reliability
    period_s: float
    windows: int
    at_start: bool
    at_end: bool


@dataclass(frozen=True)
class Episodes:
    """What the windows of a long record say; both empty where it is not long."""

    windows: tuple[WindowEvidence, ...] = ()
    found: tuple[Episode, ...] = ()


NO_EPISODES = Episodes()


def is_long(record: UniformRecord, oscillation: Oscillation, config: EpisodeConfig) -> bool:
    many = oscillation.cycles > config.long_cycles and 2 * record.samples > config.long_samples
    return many or record.samples > config.long_samples


def find(
    record: UniformRecord,
    oscillation: Oscillation,
    config: EpisodeConfig | None = None,
    model: ShapeModel | None = None,
) -> Episodes:
    """The stretches of a long record in which the valve sticks, in order of time.

    record: the whole stretch that is audited. oscillation: of the whole; each window finds its own. model: of
    the shapes, the shipped one where None. Windows overlap by half; edges are then moved to where the movement of the
    loop changes most. Costs at most `most_windows` detections and extractions of one feature window each, and one more
    for each spell. Spells shorter than a window and a half are not seen, and of a spell whose loop moves like the rest
    the edges are as coarse as half a window.
    """
    config = config or EpisodeConfig()
    if not is_long(record, oscillation, config):
        return Episodes()
    spans = window_spans(record, oscillation, config)
    shapes = model or fitted_model()
    windows = tuple(_weighed(record, part, config, shapes) for part in spans)
    sticky = [window.probability >= config.sticky_from for window in windows]
    runs = [run for run in _runs(sticky, config) if _differs(windows, run, config)]
    found = tuple(_episode(record, windows, spans, run, config) for run in runs if not _spoiled(record, spans, run))
    return Episodes(windows, found)


def episode_reasons(episodes: Episodes) -> tuple[Reason, ...]:
    """What reliable episodes add to the reasons of the whole record's verdict, which they do not move."""
    reasons = []
    for episode in episodes.found:
        if episode.reliability != "reliable":
            continue
        start, end = f"{episode.start_s:.0f} s", f"{episode.end_s:.0f} s"
        codes = [SPELL, *([ENDED] if episode.at_start else []), *([BEGAN] if episode.at_end else [])]
        reasons += [Reason(code, episode_text(code, episode.probability, start, end)) for code in codes]
    return tuple(reasons)


def episode_text(code: str, probability: float, start: str, end: str) -> str:
    """The sentence behind a reason of an episode; start, end: of it, in words, because a service knows the calendar."""
    if code == ENDED:
        return f"the valve stuck until {end}, and no sign of it since: repaired, freed, or less exercised"
    if code == BEGAN:
        return f"the valve has been sticking since {start}; nothing recorded before that shows it"
    where = f"the valve sticks from {start} to {end} (probability {told_probability(probability)})"
    return f"{where}, and the rest of the record does not show it"


def window_spans(record: UniformRecord, oscillation: Oscillation, config: EpisodeConfig) -> list[slice]:
    """Windows over the whole record, each overlapping the next by half: at most `most_windows`."""
    shortest = 2.0 * record.samples / (config.most_windows + 1)
    length = int(np.clip(max(samples_wanted(oscillation, config), shortest), 64, record.samples))
    count = min(config.most_windows, max(1, round(2.0 * record.samples / length) - 1))
    starts = np.linspace(0, record.samples - length, count).astype(int)
    return [slice(int(start), int(start) + length) for start in starts]


def samples_wanted(oscillation: Oscillation, config: EpisodeConfig) -> float:
    """Samples of a window by an oscillation; 0 where that does not swing: it says nothing about a spell."""
    known = oscillation.regular and oscillation.strength >= config.screen_strength
    return config.cycles * (oscillation.samples_per_cycle or 0.0) if known else 0.0


def _weighed(record: UniformRecord, part: slice, config: EpisodeConfig, model: ShapeModel) -> WindowEvidence:
    window = record.part(part)
    end_s = window.start_s + (window.samples - 1) * window.sampling_interval_s
    oscillation = detect(window)
    if not oscillation.swings(config.screen_strength, config.screen_irregular, config.screen_cycles):
        return WindowEvidence(window.start_s, end_s, 0.0, oscillation.period_s)
    features = extract(window, oscillation, most_windows=1)
    if features is None:
        return WindowEvidence(window.start_s, end_s, 0.0, oscillation.period_s)
    weighing = weigh_features(features, (), model)
    return WindowEvidence(window.start_s, end_s, weighing.probability, oscillation.period_s)


def _spoiled(record: UniformRecord, spans: list[slice], run: slice) -> bool:
    """Whether in the middle of the run a rival stands out that counts against stiction."""
    window = record.part(spans[(run.start + run.stop) // 2])
    oscillation = detect(window)
    features = extract(window, oscillation, most_windows=1)
    return features is not None and any(r.stands_out and r.counts for r in compete(window, oscillation, features))


def _runs(sticky: list[bool], config: EpisodeConfig) -> list[slice]:
    """Runs with enough sticky windows; a few others between two sticky ones are bridged."""
    runs: list[slice] = []
    for k in np.flatnonzero(sticky):
        if runs and k - runs[-1].stop <= config.bridged_windows:
            runs[-1] = slice(runs[-1].start, int(k) + 1)
        else:
            runs.append(slice(int(k), int(k) + 1))
    return [run for run in runs if sum(sticky[run]) >= config.least_windows]


def _differs(windows: tuple[WindowEvidence, ...], run: slice, config: EpisodeConfig) -> bool:
    """Whether the rest of the record says something else; a record that sticks all along is the verdict's business."""
    rest = [window.probability for window in (*windows[: run.start], *windows[run.stop :])]
    return bool(rest) and float(np.median(rest)) <= config.rest_below


def _episode(
    record: UniformRecord, windows: tuple[WindowEvidence, ...], spans: list[slice], run: slice, config: EpisodeConfig
) -> Episode:
    inside = windows[run]
    probability = float(np.median([window.probability for window in inside]))
    periods = [window.period_s for window in inside if window.period_s is not None]
    period_s = float(np.median(periods))
    at_start, at_end = run.start == 0, run.stop == len(windows)
    first, last = spans[run.start], spans[run.stop - 1]
    half = (first.stop - first.start) // 2
    per_cycle = period_s / record.sampling_interval_s
    start = 0 if at_start else refined(record, first.start, half, per_cycle, rises=True)
    end = record.samples - 1 if at_end else refined(record, last.stop, half, per_cycle, rises=False)
    if end <= start:
        start, end = first.start + half // 2, last.stop - half // 2
    enough = len(inside) >= config.reliable_windows and probability >= config.reliable_from
    return Episode(
        start_s=record.start_s + start * record.sampling_interval_s,
        end_s=record.start_s + end * record.sampling_interval_s,
        probability=probability,
        reliability="reliable" if enough else "not_reliable",
        period_s=period_s,
        windows=len(inside),
        at_start=at_start,
        at_end=at_end,
    )
