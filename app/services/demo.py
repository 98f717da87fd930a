"""A simulated plant of 60 loops whose conditions are known, written as historian exports: to try loopaudit on."""

import gzip
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from app.engine.simulate import (
    LoopSpec,
    Manual,
    PhysicalActuator,
    Pid,
    Plant,
    Signal,
    SimulatedLoop,
    TwoParameterValve,
    Valve,
    Wave,
    first_order,
    integrator,
    simulate_loop,
)
from app.engine.valve import PACKED

SAMPLES = 1440
INTERVAL_S = 5.0
SETTLE_S = 3600.0
SEED = 20151

NO_STICTION, STICTION, NOT_AUDITABLE = "no_stiction", "stiction", "not_auditable"


@dataclass(frozen=True)
class DemoLoop:
    """A loop of the demo plant: what is true about it, and the verdict that would be right."""

    tag: str
    unit: str
    type: str
    truth: str
    right_verdict: str
    spec: LoopSpec

    @property
    def condition(self) -> str:
        """The truth without its figures."""
        return self.truth.split(",")[0]

    @property
    def what_it_is(self) -> dict[str, Any]:
        """What a plant tells of a loop: unit, type and spans."""
        low, high = self.spec.pv_limits
        spans = {"pv_low": low, "pv_high": high, "op_low": OP_LIMITS[0], "op_high": OP_LIMITS[1]}
        return {"unit": self.unit, "type": self.type, **spans}


@dataclass(frozen=True)
class DemoExport:
    """A file as the plant's historian would write it, and the loops in it."""

    path: Path
    tags: tuple[str, ...]


@dataclass(frozen=True)
class Process:
    """A kind of loop: its plant, a PI tuning that suits it, its spans and its usual noise."""

    letter: str
    type: str
    plant: Plant
    pid: Pid
    pv_start: float
    pv_limits: tuple[float, float]
    noise_sd: float


FLOW = Process("FIC", "flow", first_order(1.2, 12.0, 5.0), Pid(0.55, 15.0), 62.0, (0.0, 120.0), 0.12)
PRESSURE = Process("PIC", "pressure", first_order(0.16, 40.0, 10.0), Pid(9.0, 45.0), 8.4, (0.0, 16.0), 0.012)
TEMPERATURE = Process("TIC", "temperature", first_order(1.6, 120.0, 25.0), Pid(1.2, 130.0), 184.0, (50.0, 300.0), 0.10)
LEVEL = Process("LIC", "level", integrator(0.0012, 10.0), Pid(9.0, 700.0), 48.0, (0.0, 100.0), 0.08)
OP_LIMITS = (0.0, 100.0)

# Slip jump against deadband: from a packing that only drags to one that sticks and jumps. Per cent of OP.
STICTION_DEGREES = (
    (2.0, 0.5),
    (3.0, 1.0),
    (4.0, 2.0),
    (5.0, 1.0),
    (6.0, 3.0),
    (8.0, 3.0),
    (10.0, 4.0),
)


def plant() -> tuple[DemoLoop, ...]:
    """The 60 loops, unit by unit; the same in every run."""
    loops = [*_healthy(), *_sticky(), *_tight(), *_shaken(), *_levels(), *_dead(), *_manual()]
    units = ("CRUDE", "REACTION", "UTILITIES", "TANKS")
    numbered = [_in_unit(loop, units[index % 4], 101 + index) for index, loop in enumerate(loops)]
    return tuple(sorted(numbered, key=lambda loop: (units.index(loop.unit), loop.tag)))


def write_exports(folder: Path, loops: tuple[DemoLoop, ...], end: datetime | None = None) -> tuple[DemoExport, ...]:
    """Simulates the loops up to `end` (UTC, now by default) and writes one export a unit, each in another layout."""
    folder.mkdir(parents=True, exist_ok=True)
    start = (end or datetime.now(UTC)).replace(microsecond=0) - timedelta(seconds=SAMPLES * INTERVAL_S)
    writers = {"CRUDE": _wide, "REACTION": _long, "UTILITIES": _semicolons, "TANKS": _long_zipped}
    exports = []
    for unit, write in writers.items():
        records = {loop.tag: _simulate(loop) for loop in loops if loop.unit == unit}
        exports.append(DemoExport(write(folder, unit.lower(), records, start), tuple(records)))
    return tuple(exports)


def _in_unit(loop: DemoLoop, unit: str, number: int) -> DemoLoop:
    return replace(loop, unit=unit, tag=f"{loop.tag}{number}")


def _loop(process: Process, truth: str, right: str, **changes: Any) -> DemoLoop:
    spec = LoopSpec(
        plant=process.plant,
        controller=process.pid,
        # What every loop lives with: coloured upsets of the process and noise of its transmitter.
        load=Signal(noise_sd=0.5, noise_tau_s=300.0),
        noise=Signal(noise_sd=process.noise_sd),
        pv_start=process.pv_start,
        op_start=47.0,
        pv_limits=process.pv_limits,
        op_limits=OP_LIMITS,
        settle_s=SETTLE_S,
    )
    return DemoLoop(process.letter, "", process.type, truth, right, replace(spec, **changes))


def _healthy() -> Iterator[DemoLoop]:
    kinds = (FLOW, PRESSURE, TEMPERATURE)
    for index in range(20):
        process = kinds[index % 3]
        step = 0.02 * (process.pv_limits[1] - process.pv_limits[0])
        moves = Signal(steps=((1500.0 + 90.0 * index, step), (4800.0, -step))) if index % 2 else Signal()
        yield _loop(process, "healthy", NO_STICTION, sp=moves)


def _sticky() -> Iterator[DemoLoop]:
    for index, (S, J) in enumerate(STICTION_DEGREES):
        for process in (FLOW, PRESSURE):
            yield _sticking(process, TwoParameterValve(S, J), f"sticky valve, S {S:g} J {J:g}", index)
    yield _sticking(FLOW, PhysicalActuator(PACKED), "sticky valve, packed stem", 3)
    yield _sticking(TEMPERATURE, TwoParameterValve(6.0, 3.0), "sticky valve, S 6 J 3", 4)


def _sticking(process: Process, valve: Valve, truth: str, index: int) -> DemoLoop:
    load = Signal(value=1.5 + 0.3 * index, noise_sd=0.15, noise_tau_s=300.0)
    return _loop(process, truth, STICTION, valve=valve, load=load)


def _tight() -> Iterator[DemoLoop]:
    """Close to the limit of stability: what upsets them rings for a long time."""
    gains = ((FLOW, 4.2), (PRESSURE, 3.1), (TEMPERATURE, 3.1), (FLOW, 4.4), (PRESSURE, 3.3), (TEMPERATURE, 3.3))
    for process, gain in gains:
        pid = replace(process.pid, Kc=process.pid.Kc * gain)
        yield _loop(process, "tight tuning", NO_STICTION, controller=pid)


def _shaken() -> Iterator[DemoLoop]:
    """A neighbour's oscillation comes in with the load."""
    for index, process in enumerate((FLOW, PRESSURE, TEMPERATURE) * 2):
        wave = Wave(amplitude=3.0, period_s=240.0 + 60.0 * index, form="sine", phase_rad=index)
        load = Signal(waves=(wave,), noise_sd=0.4, noise_tau_s=300.0)
        yield _loop(process, "external oscillation", NO_STICTION, load=load)


def _levels() -> Iterator[DemoLoop]:
    for _ in range(4):
        yield _loop(LEVEL, "integrating level", NO_STICTION, load=Signal(noise_sd=3.0, noise_tau_s=900.0))
    sticky = {"valve": TwoParameterValve(5.0, 1.5), "load": Signal(value=4.0, noise_sd=0.3, noise_tau_s=300.0)}
    yield _loop(LEVEL, "sticky level valve, S 5 J 1.5", STICTION, **sticky)


def _dead() -> Iterator[DemoLoop]:
    for process in (FLOW, PRESSURE, TEMPERATURE):
        yield _loop(process, "dead transmitter", NOT_AUDITABLE, transmitter_frozen_from_s=0.0)


def _manual() -> Iterator[DemoLoop]:
    for process in (FLOW, PRESSURE, TEMPERATURE, FLOW):
        yield _loop(process, "in manual", NOT_AUDITABLE, controller=Manual())


def _simulate(loop: DemoLoop) -> SimulatedLoop:
    seed = SEED + int("".join(filter(str.isdigit, loop.tag)))
    return simulate_loop(loop.spec, SAMPLES * INTERVAL_S, INTERVAL_S, seed)


Records = dict[str, SimulatedLoop]


def _columns(records: Records) -> dict[str, np.ndarray]:
    """Every signal of the plant's unit by its historian tag: PV, OP, SP and MODE (1 automatic, 0 manual) a loop."""
    columns: dict[str, np.ndarray] = {}
    for tag, record in records.items():
        automatic = not isinstance(record.spec.controller, Manual)
        columns |= {f"{tag}.PV": record.pv, f"{tag}.OP": record.op, f"{tag}.SP": record.sp}
        columns[f"{tag}.MODE"] = np.full(len(record.pv), float(automatic))
    return columns


def _stamps(start: datetime, form: str) -> list[str]:
    return [(start + timedelta(seconds=INTERVAL_S * k)).strftime(form) for k in range(SAMPLES)]


def _wide_lines(records: Records, stamps: list[str], separator: str, first: str, comma: bool) -> Iterator[str]:
    columns = _columns(records)
    yield separator.join([first, *columns])
    for stamp, row in zip(stamps, np.column_stack(list(columns.values())), strict=True):
        cells = separator.join(f"{value:.6g}" for value in row)
        yield stamp + separator + (cells.replace(".", ",") if comma else cells)


def _long_lines(records: Records, stamps: list[str]) -> Iterator[str]:
    yield "Tagname,TimeStamp,Value,DataQuality"
    columns = _columns(records)
    for k, stamp in enumerate(stamps):
        for tag, values in columns.items():
            yield f"{tag},{stamp},{values[k]:.6g},Good"


def _text(lines: Iterator[str]) -> str:
    return "\n".join(lines) + "\n"


def _wide(folder: Path, name: str, records: Records, start: datetime) -> Path:
    path = folder / f"{name}_wide.csv"
    stamps = _stamps(start, "%Y-%m-%dT%H:%M:%SZ")
    path.write_text(_text(_wide_lines(records, stamps, ",", "DateTime", comma=False)), encoding="utf-8")
    return path


def _semicolons(folder: Path, name: str, records: Records, start: datetime) -> Path:
    path = folder / f"{name}_semicolons.csv"
    stamps = _stamps(start, "%Y-%m-%d %H:%M:%S")
    path.write_text(_text(_wide_lines(records, stamps, ";", "Time", comma=True)), encoding="utf-8")
    return path


def _long(folder: Path, name: str, records: Records, start: datetime) -> Path:
    path = folder / f"{name}_long.csv"
    path.write_text(_text(_long_lines(records, _stamps(start, "%Y-%m-%dT%H:%M:%SZ"))), encoding="utf-8")
    return path


def _long_zipped(folder: Path, name: str, records: Records, start: datetime) -> Path:
    path = folder / f"{name}_long.csv.gz"
    text = _text(_long_lines(records, _stamps(start, "%Y-%m-%dT%H:%M:%SZ")))
    path.write_bytes(gzip.compress(text.encode(), mtime=0))
    return path
