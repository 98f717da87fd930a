"""`python -m app.lab.testbench.neighbours`: plants of a valve that sticks and healthy loops that it shakes.

Prints how many healthy valves are accused reliably by their own record, and how many are left when the loops of a
plant are heard beside each other: each plant for itself, then all of them as one plant, in which many periods are alike
by chance.
"""

import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from app.engine.audit import Audit, audit
from app.engine.plant_wide.groups import Candidate, groups
from app.engine.recording import FloatArray
from app.engine.simulate import LoopSpec, Pid, Signal, SimulatedLoop, TwoParameterValve, first_order, simulate_loop
from app.lab.testbench.seeded import print_report
from app.services.auditing.hearing import neighbours_doubts

SOURCE = "source"
SHAKEN_LOOPS = 4
SAMPLES, INTERVAL_S = 2880, 5.0
_LIMITS = (-400.0, 600.0)  # far from all that happens


@dataclass(frozen=True)
class Heard:
    """What was said of one plant. accused: healthy valves called sticky reliably, by tag; left: of those that are left
    beside their neighbours. relied_on, kept: the same of valves that stick. named: of which loops it is said that they
    shake others.
    """

    accused: frozenset[str]
    left: frozenset[str]
    relied_on: frozenset[str]
    kept: frozenset[str]
    named: frozenset[str]


def hear(audits: Mapping[str, Audit]) -> Heard:
    """The loops of a plant by tag, each audited by itself, now all of them together."""
    swinging = [
        Candidate(t, a.swing, a.judgement.stiction_probability) for t, a in audits.items() if a.swing is not None
    ]
    together = groups(swinging)
    sure = {tag for tag, found in audits.items() if _sure(found)}
    left = sure - neighbours_doubts(together, sure).keys()
    sources = {tag for tag in audits if tag.endswith(SOURCE)}
    return Heard(
        accused=frozenset(sure - sources),
        left=frozenset(left - sources),
        relied_on=frozenset(sure & sources),
        kept=frozenset(left & sources),
        named=frozenset(sources & {group.source for group in together}),
    )


def audited(seed: int) -> dict[str, Audit]:
    """The plant of a seed, each loop by itself, under tags that begin with the seed."""
    return {f"{seed} {tag}": audit(loop.recording(tag)) for tag, loop in plant(seed).items()}


def plant(seed: int) -> dict[str, SimulatedLoop]:
    """The loops of a plant by tag: the source, and those that it shakes."""
    rng = np.random.default_rng(seed)
    source = sticking(rng, seed)
    return {SOURCE: source} | {f"shaken {k}": shaken(source, rng, seed + k) for k in range(SHAKEN_LOOPS)}


def _sure(found: Audit) -> bool:
    return found.judgement.verdict == "stiction" and found.judgement.reliability == "reliable"


def sticking(rng: np.random.Generator, seed: int) -> SimulatedLoop:
    """A loop whose valve sticks, in its limit cycle."""
    S, tau = float(rng.uniform(3.0, 10.0)), float(rng.uniform(10.0, 80.0))
    spec = LoopSpec(
        plant=first_order(float(rng.uniform(0.6, 1.6)), tau, tau * float(rng.uniform(0.1, 0.5))),
        controller=Pid(float(rng.uniform(0.4, 1.0)), tau * float(rng.uniform(0.8, 1.5))),
        valve=TwoParameterValve(S, S * float(rng.uniform(0.2, 1.0))),
        load=Signal(value=2.5, noise_sd=0.15, noise_tau_s=300.0),
        noise=Signal(noise_sd=0.05),
        settle_s=3600.0,
    )
    return _simulated(spec, seed)


def shaken(source: SimulatedLoop, rng: np.random.Generator, seed: int) -> SimulatedLoop:
    """A healthy loop whose load is what the source's PV does, behind a lag."""
    felt = _lagged(source.true_pv - source.sp, float(rng.uniform(2.0, 60.0)))
    tau = float(rng.uniform(5.0, 150.0))
    spec = LoopSpec(
        plant=first_order(float(rng.uniform(0.6, 1.5)), tau, INTERVAL_S),
        controller=Pid(float(rng.uniform(0.3, 1.2)), tau * float(rng.uniform(0.7, 2.0))),
        load=Signal(steps=tuple(zip(source.time_s.tolist(), np.diff(felt, prepend=0.0).tolist(), strict=True))),
        noise=Signal(noise_sd=float(rng.uniform(0.01, 0.15)) * float(np.std(felt))),
    )
    return _simulated(spec, seed)


def _simulated(spec: LoopSpec, seed: int) -> SimulatedLoop:
    spec = replace(spec, pv_limits=_LIMITS, op_limits=_LIMITS, pv_start=60.0, op_start=50.0)
    return simulate_loop(spec, SAMPLES * INTERVAL_S, INTERVAL_S, seed)


def _lagged(signal: FloatArray, lag_s: float) -> FloatArray:
    share, out = 1.0 - float(np.exp(-INTERVAL_S / lag_s)), np.zeros(len(signal))
    for k in range(1, len(signal)):
        out[k] = out[k - 1] + share * (signal[k] - out[k - 1])
    return out


def report(heard: list[Heard], sources: int) -> str:
    accused, left, relied_on, kept, named = (
        sum(len(getattr(one, name)) for one in heard) for name in ("accused", "left", "relied_on", "kept", "named")
    )
    return (
        f"{SHAKEN_LOOPS * sources} healthy loops shaken by {sources} valves that stick: {accused} accused reliably by "
        f"their own records, {left} beside their neighbours; sticking valves relied on {relied_on}, {kept} beside "
        f"their neighbours; named as the source {named}"
    )


def apart_and_together(seeds: range) -> Iterator[str]:
    """Plants are ten seeds apart, of which their loops take some."""
    plants = [audited(seeds.start + 10 * k) for k in range(len(seeds))]
    yield report([hear(one) for one in plants], len(plants))
    together = {tag: found for one in plants for tag, found in one.items()}
    yield f"as one plant of {len(together)} loops: {report([hear(together)], len(plants))}"


def main(arguments: list[str] | None = None) -> int:
    return print_report(
        "neighbours", __doc__, apart_and_together, arguments, many=60, seed=1000, of="plants", kinds=None
    )


if __name__ == "__main__":
    sys.exit(main())
