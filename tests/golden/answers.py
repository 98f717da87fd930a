"""What this engine says of a few made-up recordings, kept with its version: other answers are another version.

`python -m tests.golden.answers` works them out anew; where one is another than is kept, it raises the last part of
ENGINE_VERSION and keeps the new ones; a question that was not asked before raises nothing. The recordings are made by
sums and products alone, the same on any machine.
"""

import json
import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

import app.engine as engine
from app.engine.audit import audit
from app.engine.mismatch import Comparison, Explanation, LinearSimulation, explain
from app.engine.mismatch.compare.even_grid import comparison_of
from app.engine.recording import Recording

KEPT = Path(__file__).with_name("answers.json")
SAMPLES, INTERVAL_S = 720, 5.0
Answer = dict[str, str | float | None]


def noise(samples: int) -> list[float]:
    """Between -1 and 1, most of it small; the same each time."""
    made, state = [], 1
    for _ in range(samples):
        drawn = []
        for _ in range(4):
            state = (1_664_525 * state + 1_013_904_223) % (1 << 32)
            drawn.append(state / (1 << 31) - 1.0)
        made.append(sum(drawn) / 4.0)
    return made


def teeth(samples: int) -> list[float]:
    """A load that builds up for some 100 samples and falls away within 10, no two teeth as high or as long."""
    made, drawn = [0.0], noise(samples)
    while len(made) < samples:
        height, lasts = 12.0 + 8.0 * drawn[len(made)], 100 + round(10.0 * drawn[-len(made)])
        made += [height * k / lasts for k in range(lasts)] + [height * (1.0 - k / 10.0) for k in range(10)]
    return made[:samples]


def loop(
    S: float = 0.0,
    J: float = 0.0,
    shaken: float = 0.0,
    samples: int = SAMPLES,
    sticks_from: int = 0,
    toothed: bool = False,
    **known: Any,
) -> Recording:
    """A PI loop around a lag with its set point at 50. S, J: of its valve, He's, of OP; shaken: size of what goes up
    and down every 30 samples in a load, of PV; toothed: whether it has `teeth`; known: what else a recording has.
    """
    teeth_ = teeth(samples) if toothed else [0.0] * samples
    pv, op, stem, pushed, integral = [50.0], [50.0], 50.0, 0.0, 50.0
    for t, drawn in enumerate(noise(samples)[1:], 1):
        band, jump = (S, J) if t >= sticks_from else (0.0, 0.0)
        pushed += op[-1] - op[-2] if t > 1 else 0.0
        if abs(pushed) > 0.5 * (band + jump):
            left = 0.5 * (band - jump) if pushed > 0.0 else -0.5 * (band - jump)
            stem, pushed = stem + pushed - left, left
        load = (0.7 if t < 60 else -0.7) + shaken * (abs(t % 30 - 15) / 7.5 - 1.0) + teeth_[t]
        pv.append(pv[-1] + 0.2 * (stem + load - pv[-1]) + 0.05 * drawn)
        integral += 0.1 * (50.0 - pv[-1])
        op.append(min(max(integral + 0.8 * (50.0 - pv[-1]), 0.0), 100.0))
    time_s = INTERVAL_S * np.arange(samples)
    parts = {"time_s": time_s, "pv": np.array(pv), "op": np.array(op), "sp": np.full(samples, 50.0)}
    return Recording("made up", **(parts | known))


def stands() -> Recording:
    """PV stands from the middle on, while OP goes on."""
    moving = loop(shaken=4.0)
    pv = np.where(np.arange(SAMPLES) < SAMPLES // 2, moving.pv, moving.pv[SAMPLES // 2])
    return loop(pv=pv, op=moving.op)


def irregular() -> Recording:
    """Every seventh sample late, every eleventh without a PV."""
    k, whole = np.arange(SAMPLES), loop(S=6.0, J=2.0)
    pv = np.where(k % 11 == 0, np.nan, whole.pv)
    return loop(time_s=INTERVAL_S * (k + 0.4 * (k % 7 == 0)), pv=pv, op=whole.op)


def swings(clipped: float) -> Comparison:
    """What overshoots behind an OP that steps each 40 samples, beside its simulation: OP is not passed on by more than
    `clipped`.
    """
    op = [50.0 + 40.0 * drawn for drawn in noise(SAMPLES) for _ in range(40)][:SAMPLES]
    sides = {"pv": [min(max(u, 50.0 - clipped), 50.0 + clipped) for u in op], "trace": op}
    made = {}
    for name, moved in sides.items():
        answer = [50.0, 50.0]
        for t in range(2, SAMPLES):
            answer.append(1.78 * answer[-1] - 0.84 * answer[-2] + 0.06 * moved[t - 1])
        made[name] = np.array(answer)
    pv = made["pv"] + 0.05 * np.array(noise(SAMPLES))
    return Comparison("made up", INTERVAL_S, np.array(op), pv, trace=made["trace"])


def beside_no_resonance() -> Comparison:
    """The same process (its poles swing at 1 / 19.5 s with a damping of 0.34) beside a simulation that hardly does."""
    given = LinearSimulation(gain=1.0, time_constants_s=(19.5,), damping=0.99)
    return replace(swings(60.0), trace=None, simulation=given)


def beside_two_lags() -> Comparison:
    """The same process beside two equal lags, as a damping of 1 has it, and PV a sample later: above it comes half a
    sample before what a continuous process can answer, no model is right, and the nearest hangs on PV's last bits.
    """
    swung = swings(60.0)
    later = np.concatenate((swung.pv[:1], swung.pv[:-1]))
    return replace(swung, pv=later, trace=None, simulation=LinearSimulation(gain=1.0, time_constants_s=(19.5, 19.5)))


def travels(up: float, down: float) -> Comparison:
    """A lag behind a stem that goes up and down by no more than that a sample, beside a simulation without it."""
    op = [50.0 + 20.0 * drawn for drawn in noise(SAMPLES) for _ in range(40)][:SAMPLES]
    stem, pv = [50.0], [50.0]
    for t in range(1, SAMPLES):
        stem.append(stem[-1] + min(max(op[t] - stem[-1], -down), up))
        pv.append(pv[-1] + 0.2 * (stem[-2] - pv[-1]))
    made = np.array(pv) + 0.05 * np.array(noise(SAMPLES))
    return Comparison("made up", INTERVAL_S, np.array(op), made, simulation=SIMULATION)


def ends_at_a_limit(stood: bool) -> Comparison:
    """A lag, kept to two decimals, behind a sensor whose range ends at 58.123, beside a simulation without either;
    stood: whether it stands from the 300th sample to the 360th too.
    """
    op = [50.0 + 40.0 * drawn for drawn in noise(SAMPLES) for _ in range(40)][:SAMPLES]
    pv, drawn = [50.0], noise(SAMPLES)
    for t in range(1, SAMPLES):
        pv.append(pv[-1] + 0.2 * (op[t - 2 if t > 1 else 0] - pv[-1]))
    seen = [round(min(one + 0.05 * moved, 58.123), 2) for one, moved in zip(pv, drawn, strict=True)]
    if stood:
        seen[300:360] = [seen[299]] * 60
    return Comparison("made up", INTERVAL_S, np.array(op), np.array(seen), simulation=SIMULATION)


def lags(freezes: bool = False, later: bool = False, loaded: bool = False) -> Comparison:
    """A lag beside its simulation. freezes: its sensor does from the 300th sample to the 360th, beside a tenth of its
    noise; later: its dead time is ten samples longer from the 300th sample on; loaded: a load builds up from the 200th
    sample to the 350th, and is gone at the 550th.
    """
    op, drawn = [50.0 + 40.0 * one for one in noise(SAMPLES) for _ in range(40)][:SAMPLES], noise(SAMPLES)
    pv = [50.0]
    for t in range(1, SAMPLES):
        load = 3.0 * max(min((t - 200) / 150.0, (550 - t) / 200.0), 0.0) if loaded else 0.0
        pv.append(pv[-1] + 0.2 * (op[max(t - (12 if later and t >= 300 else 2), 0)] + load - pv[-1]))
    seen = [one + 0.5 * moved for one, moved in zip(pv, drawn, strict=True)]
    if freezes:
        seen[300:360] = [seen[299] + 0.05 * moved for moved in drawn[300:360]]
    return Comparison("made up", INTERVAL_S, np.array(op), np.array(seen), simulation=SIMULATION)


def scanned(S: float, J: float, samples: int = 500, scans: int = 5) -> Comparison:
    """A loop whose valve sticks, He's, and whose controller scans five times between two samples of what is recorded;
    its load steps twice.
    """
    true, stem, pushed, integral, op, before = 50.0, 50.0, 0.0, 50.0, 50.0, 50.0
    seen = []
    for t, drawn in enumerate(noise(samples * scans)):
        pushed, before = pushed + op - before, op
        if abs(pushed) > 0.5 * (S + J):
            left = 0.5 * (S - J) if pushed > 0.0 else -0.5 * (S - J)
            stem, pushed = stem + pushed - left, left
        load = (0.7 if t < 60 * scans else -0.7) + (2.0 if t > 200 * scans else 0.0)
        true += 0.2 / scans * (stem + load - true)
        pv = true + 0.2 * drawn
        integral += 0.3 / scans * (50.0 - pv)
        op = min(max(integral + 1.5 * (50.0 - pv), 0.0), 100.0)
        seen.append((op, pv))
    ops, pvs = np.array(seen[scans - 1 :: scans]).T
    return Comparison("made up", INTERVAL_S, ops, pvs, np.full(samples, 50.0))


RECORDINGS: Mapping[str, Callable[[], Recording]] = {
    "sticks": lambda: loop(S=6.0, J=2.0),
    "sticks and jumps": lambda: loop(S=3.0, J=3.0),
    "shaken": lambda: loop(shaken=4.0),
    "shaken and sticks": lambda: loop(S=3.0, J=1.0, shaken=4.0),
    "under a load in teeth": lambda: loop(toothed=True, samples=1600),
    "sticks a little and is shaken": lambda: loop(S=1.0, J=1.0, shaken=0.3, samples=1600),
    "quiet": loop,
    "PV stands": stands,
    "irregular": irregular,
    "in manual": lambda: loop(S=6.0, J=2.0, automatic=np.zeros(SAMPLES, np.bool_)),
    "sticks at its end": lambda: loop(S=6.0, J=2.0, shaken=0.3, samples=6000, sticks_from=4500),
}


def audited(recording: Recording) -> Answer:
    found = audit(recording)
    said, size, reference = found.judgement, found.stiction_size, found.reference
    return {
        "verdict": said.verdict,
        "reliability": said.reliability,
        "likely_cause": said.likely_cause,
        "reasons": " ".join(reason.code for reason in said.reasons),
        "checks": " ".join(f"{one.code}:{one.outcome}" for one in found.fitness.findings),
        "stiction_probability": said.stiction_probability,
        "period_s": None if found.oscillation is None else found.oscillation.period_s,
        "health": found.health.value,
        "S": None if size is None else size.S,
        "d": None if reference is None else float(reference.last.one.d_best),
        "rmse": None if reference is None else float(np.min(reference.last.one.rmse)),
        **{f"method {one.method}": one.statistic for one in said.methods},
        **{f"figure {name}": figure for name, figure in asdict(found.key_figures).items()},
    }


def explained(found: Explanation) -> Answer:
    return {
        "verdict": found.verdict,
        "effects": " ".join(effect.code for effect in found.effects),
        "evidence": " ".join(reason.code for reason in found.evidence),
        "rmse_refitted": found.fit.refitted.rmse,
        "rmse_explained": found.fit.explained.rmse,
    }


def sized(found: Explanation) -> Answer:
    """The same with the sizes of what was named, and how far their intervals reach."""
    sizes = [(effect.code, one) for effect in found.effects for one in effect.parameters]
    told = {f"{code} {one.name}": one.value for code, one in sizes}
    wide = {f"{code} {one.name} is as wide as": one.high - one.low for code, one in sizes}
    return {**explained(found), **told, **wide}


# Its lag is 5 s / -ln(0.8), its dead time the sample by which PV is behind the stem.
SIMULATION = LinearSimulation(gain=1.0, time_constants_s=(22.4,), dead_time_s=INTERVAL_S)
# Where OP follows a load that shakes, our own loop is found in a wrong valley, the optima beside it are many, and in
# which of them a descent ends hangs on the last bits: what one machine says of it without a simulation binds no other.
EXPLAINED: Mapping[str, tuple[str, LinearSimulation | None]] = {
    "sticks": ("sticks", None),
    "shaken, beside its simulation": ("shaken", SIMULATION),
}


def asked() -> Iterator[tuple[str, Callable[[], Answer]]]:
    for name, made in RECORDINGS.items():
        yield f"audit: {name}", lambda made=made: audited(made())
    for name, (recording, simulation) in EXPLAINED.items():
        made = RECORDINGS[recording]
        yield (
            f"explain: {name}",
            lambda made=made, given=simulation: explained(explain(replace(comparison_of(made()), simulation=given))),
        )
    yield "explain: clipped, beside its simulation that swings", lambda: explained(explain(swings(6.0)))
    yield "explain: passed on, beside its simulation that swings", lambda: explained(explain(swings(60.0)))
    yield "explain: swings, beside a simulation that does not", lambda: explained(explain(beside_no_resonance()))
    yield "explain: swings a sample later, beside two lags", lambda: explained(explain(beside_two_lags()))
    yield "explain: up faster than down, beside its simulation", lambda: explained(explain(travels(0.9, 0.6)))
    yield "explain: ends at a limit, beside its simulation", lambda: sized(explain(ends_at_a_limit(stood=False)))
    yield "explain: freezes beside a little noise", lambda: explained(explain(lags(freezes=True)))
    yield "explain: is later from a time on", lambda: explained(explain(lags(later=True)))
    yield "explain: beside a load that comes and goes", lambda: explained(explain(lags(loaded=True)))
    yield (
        "explain: ends at a limit and stands, beside its simulation",
        lambda: sized(explain(ends_at_a_limit(stood=True))),
    )
    yield "explain: sticks and slips between its samples", lambda: explained(explain(scanned(S=6.0, J=3.6)))


QUESTIONS = dict(asked())


def kept() -> dict[str, Any]:
    """`engine_version`, and the `answers` that it gave, by question."""
    return json.loads(KEPT.read_text(encoding="utf-8"))


def same(given: Answer, before: Answer | None) -> bool:
    """As far as machines agree."""
    if before is None or given.keys() != before.keys():
        return False
    return all(_close(given[name], before[name]) for name in given)


def _close(one: str | float | None, other: str | float | None) -> bool:
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=5e-3, abs_tol=1e-6)
    return one == other


def main() -> None:
    before = kept() if KEPT.exists() else {"engine_version": engine.ENGINE_VERSION, "answers": {}}
    given = {question: answer() for question, answer in QUESTIONS.items()}
    known = before["answers"]
    others = [question for question in given if question in known and not same(given[question], known[question])]
    version = engine.ENGINE_VERSION
    if others and version == before["engine_version"]:
        version = raised()
    answers = {
        question: given[question] if question not in known or question in others else known[question]
        for question in given
    }
    text = json.dumps({"engine_version": version, "answers": answers}, indent=1, ensure_ascii=False)
    KEPT.write_text(text + "\n", encoding="utf-8")
    print(f"engine {version}, other answers: {', '.join(others) or 'none'}")


def raised() -> str:
    """The version with its last part one higher, as it then stands in the engine."""
    home = Path(engine.__file__)
    first, last = engine.ENGINE_VERSION.rsplit(".", 1)
    version = f"{first}.{int(last) + 1}"
    text = home.read_text(encoding="utf-8")
    home.write_text(re.sub(r'ENGINE_VERSION = ".*"', f'ENGINE_VERSION = "{version}"', text), encoding="utf-8")
    return version


if __name__ == "__main__":
    main()
