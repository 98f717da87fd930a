"""`loopaudit simulate`: a recording of a loop whose valve is known, to try detectors on."""

from collections.abc import Iterator
from datetime import datetime, timedelta
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli.messages import ExitCode, say
from app.cli.outputs import written
from app.cli.stamps import DateOrder, read_in

if TYPE_CHECKING:
    from app.engine.simulate import Plant, Signal, SimulatedLoop, Valve
    from app.ingest import IngestOptions

PROCESS, CONTROLLER, VALVE, UPSETS = "Process", "Controller", "Valve", "What happens to the loop"
EXPLAINED = "An explained model"
STARTS = ["%Y-%m-%d", "%Y-%m-%dT%H:%M:%S"]


class ValveModel(StrEnum):
    linear = "linear"
    one_parameter = "one-parameter"
    he = "he"
    choudhury = "choudhury"
    kano = "kano"
    classic = "classic"
    packed = "packed"
    stuck = "stuck"


TWO = ("-S", "-J")
TAKEN = {
    ValveModel.one_parameter: ("-d",),
    ValveModel.he: TWO,
    ValveModel.choudhury: TWO,
    ValveModel.kano: TWO,
}


def simulate(
    context: typer.Context,
    out: Annotated[Path | None, typer.Option("--out", help="Write the recording here instead of stdout.")] = None,
    samples: int = typer.Option(1440, "--samples", min=2, help="Samples of the recording."),
    interval_s: float = typer.Option(1.0, "--interval", min=0.001, help="Sampling interval in seconds."),
    gain: float = typer.Option(
        1.0, "--gain", help="Process gain, units of PV per unit of OP.", rich_help_panel=PROCESS
    ),
    time_constant_s: float = typer.Option(20.0, "--time-constant", min=0.0, help="Seconds.", rich_help_panel=PROCESS),
    dead_time_s: float = typer.Option(2.0, "--dead-time", min=0.0, help="Seconds.", rich_help_panel=PROCESS),
    integrating: bool = typer.Option(
        False, "--integrating", help="A level: PV moves by gain a second.", rich_help_panel=PROCESS
    ),
    kc: float = typer.Option(
        1.0, "--kc", help="Controller gain, units of OP per unit of PV.", rich_help_panel=CONTROLLER
    ),
    ti_s: float = typer.Option(20.0, "--ti", help="Integral time in seconds.", rich_help_panel=CONTROLLER),
    td_s: float = typer.Option(0.0, "--td", min=0.0, help="Derivative time in seconds.", rich_help_panel=CONTROLLER),
    valve: Annotated[
        ValveModel, typer.Option("--valve", help="classic, packed: physical valves.", rich_help_panel=VALVE)
    ] = ValveModel.linear,
    d: float = typer.Option(0.0, "-d", min=0.0, help="Band of the one-parameter model, OP.", rich_help_panel=VALVE),
    S: float = typer.Option(0.0, "-S", min=0.0, help="Deadband plus stickband, OP.", rich_help_panel=VALVE),
    J: float = typer.Option(0.0, "-J", min=0.0, help="Slip jump, OP.", rich_help_panel=VALVE),
    noise: float = typer.Option(
        0.0, "--noise", min=0.0, help="Standard deviation of PV's noise.", rich_help_panel=UPSETS
    ),
    load: float = typer.Option(1.0, "--load", help="Step of load at the start, in OP.", rich_help_panel=UPSETS),
    wave: float = typer.Option(
        0.0, "--wave", min=0.0, help="Amplitude of an oscillating load, in OP.", rich_help_panel=UPSETS
    ),
    wave_period_s: float = typer.Option(
        120.0, "--wave-period", min=0.001, help="Its period, seconds.", rich_help_panel=UPSETS
    ),
    step: float = typer.Option(0.0, "--sp-step", help="Set-point step in the middle, in PV.", rich_help_panel=UPSETS),
    start: Annotated[
        datetime | None,
        typer.Option("--start", formats=STARTS, help="Write stamps from this instant on (UTC) instead of seconds."),
    ] = None,
    seed: int = typer.Option(0, "--seed", min=0, help="The same seed gives the same noise."),
    model: Annotated[
        Path | None,
        typer.Option("--model", help="A model that explain wrote, simulated again.", rich_help_panel=EXPLAINED),
    ] = None,
    recording: Annotated[
        Path | None, typer.Option("--recording", help="The recording whose OP drives it.", rich_help_panel=EXPLAINED)
    ] = None,
    op: Annotated[str | None, typer.Option("--op", help="Its column of OP.", rich_help_panel=EXPLAINED)] = None,
    pv: Annotated[str | None, typer.Option("--pv", help="Its column of PV.", rich_help_panel=EXPLAINED)] = None,
    time_zone: Annotated[
        str,
        typer.Option(
            "--time-zone",
            envvar="LOOPAUDIT_TIME_ZONE",
            help="Zone of its time stamps that name none (IANA).",
            rich_help_panel=EXPLAINED,
        ),
    ] = "UTC",
    date_order: Annotated[
        DateOrder,
        typer.Option(
            "--date-order",
            envvar="LOOPAUDIT_DATE_ORDER",
            help="What stands first in its dates such as 03/04/2026, where it leaves it open.",
            rich_help_panel=EXPLAINED,
        ),
    ] = DateOrder.auto,
    with_valve: bool = typer.Option(False, "--with-valve", help="Add the column V: where the valve really is."),
) -> None:
    """Simulate a loop in closed loop and write its recording: time,SP,PV,OP as CSV; or an explained model along OP.

    [bold]Examples[/bold]

      loopaudit simulate --valve he -S 5 -J 2 --noise 0.05 --out sticky.csv

      loopaudit simulate --wave 3 --wave-period 90 --out shaken.csv

      loopaudit simulate --integrating --gain 0.002 --ti 600 --valve packed > level.csv

      loopaudit simulate --valve he -S 5 -J 2 --start 2026-03-01 --out FIC101.csv

      loopaudit explain FIC101.csv --model FIC101.json; loopaudit simulate --model FIC101.json --recording FIC101.csv
    """
    explained = model is not None or recording is not None
    refuse_of_the_other(context, explained)
    refuse_without_effect(valve, d, S, J)
    if explained:
        _simulate_explained(model, recording, (op, pv), read_in(time_zone, date_order), out)
        raise typer.Exit(ExitCode.DONE)
    from app.engine.simulate import LoopSpec, Pid, Signal, simulate_loop

    spec = LoopSpec(
        plant=_plant(gain, time_constant_s, dead_time_s, integrating),
        controller=Pid(kc, ti_s, td_s),
        valve=_valve(valve, d, S, J),
        sp=Signal(steps=((0.5 * samples * interval_s, step),) if step else ()),
        load=_load(load, wave, wave_period_s),
        noise=Signal(noise_sd=noise),
        pv_start=50.0,
        op_start=50.0,
        op_limits=(0.0, 100.0),
    )
    loop = simulate_loop(spec, samples * interval_s, interval_s, seed)
    with written(out) as stream:
        stream.writelines(_lines(loop, with_valve, start))
    say(f"{samples:,} samples of a loop with a {valve.value} valve" + (f" in {out}" if out else ""))
    raise typer.Exit(ExitCode.DONE)


def refuse_of_the_other(context: typer.Context, explained: bool) -> None:
    """Options of a loop do nothing beside a model, and those of a model's recording nothing without it."""
    for option in context.command.params:
        own = getattr(option, "rich_help_panel", None) == EXPLAINED
        source = context.get_parameter_source(option.name or "")
        if own == explained or option.name == "out" or source is None or source.name != "COMMANDLINE":
            continue
        why = (
            "a model is simulated as it was explained" if explained else "it is of a --recording that drives a --model"
        )
        raise typer.BadParameter(f"{option.opts[0]} would do nothing: {why}", param_hint=option.opts[0])


def refuse_without_effect(valve: ValveModel, d: float, S: float, J: float) -> None:
    """A recording of a healthy valve that was meant to stick would be believed."""
    given = {"-d": d, "-S": S, "-J": J}
    used = TAKEN.get(valve, ())
    if idle := [name for name, value in given.items() if value and name not in used]:
        takes = f"takes {' and '.join(used)}" if used else "takes none of -d, -S, -J"
        text = f"{' and '.join(idle)} would do nothing: a {valve.value} valve {takes}; say --valve he, for example"
        raise typer.BadParameter(text, param_hint="--valve")


def _simulate_explained(
    model: Path | None,
    recording: Path | None,
    columns: tuple[str | None, str | None],
    options: "IngestOptions",
    out: Path | None,
) -> None:
    from app.errors import RequestError
    from app.services.explaining.comparisons import Columns
    from app.services.explaining.models import simulate_files

    if model is None or recording is None:
        raise RequestError("model_invalid", "--model and --recording belong together: a model needs an OP to drive it")
    with written(out, [model, recording]) as stream:
        found = simulate_files(model, recording, Columns(*columns), options)
        stream.write("time,OP,PV\n")
        for row in zip(found.time_s, found.op, found.pv, strict=True):
            stream.write(",".join(f"{value:.8g}" for value in row) + "\n")
    say(f"{len(found.pv):,} samples of the model in {model}" + (f" in {out}" if out else ""))


def _plant(gain: float, time_constant_s: float, dead_time_s: float, integrating: bool) -> "Plant":
    from app.engine.simulate import first_order, integrator

    if integrating:
        return integrator(gain, dead_time_s, time_constant_s)
    return first_order(gain, time_constant_s, dead_time_s)


def _valve(model: ValveModel, d: float, S: float, J: float) -> "Valve":
    from app.engine import simulate as sim
    from app.engine.valve import CLASSIC, PACKED

    simple: dict[ValveModel, Any] = {
        ValveModel.linear: sim.LinearValve(),
        ValveModel.stuck: sim.StuckValve(),
        ValveModel.one_parameter: sim.OneParameterValve(d),
        ValveModel.classic: sim.PhysicalActuator(CLASSIC),
        ValveModel.packed: sim.PhysicalActuator(PACKED),
    }
    if model in simple:
        return simple[model]
    return sim.TwoParameterValve(S, J, model.value)  # type: ignore[arg-type]


def _load(step: float, amplitude: float, period_s: float) -> "Signal":
    from app.engine.simulate import Signal, Wave

    return Signal(value=step, waves=(Wave(amplitude, period_s),) if amplitude else ())


def _lines(loop: "SimulatedLoop", with_valve: bool, start: datetime | None) -> Iterator[str]:
    yield "time,SP,PV,OP" + (",V" if with_valve else "") + "\n"
    columns = [loop.sp, loop.pv, loop.op] + ([loop.v] if with_valve else [])
    whole_ms = (1000.0 * loop.sampling_interval_s).is_integer()
    for time_s, *row in zip(loop.time_s, *columns, strict=True):
        yield ",".join([_stamp(time_s, start, whole_ms), *(f"{value:.8g}" for value in row)]) + "\n"


def _stamp(time_s: float, start: datetime | None, whole_ms: bool) -> str:
    if start is None:
        return f"{time_s:.8g}"
    timespec = "milliseconds" if whole_ms else "microseconds"
    return (start + timedelta(seconds=time_s)).isoformat(timespec=timespec) + "Z"
