"""`loopaudit explain`: where a recording and a simulation differ, what physics was left out, how much better it fits
with it.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli.compiling import compiling_told
from app.cli.messages import say
from app.cli.outputs import refuse_outputs, written
from app.cli.stamps import DateOrder, DateOrderOption, TimeZoneOption, read_in
from app.errors import DataError, RequestError
from app.threads import OF_LINEAR_ALGEBRA, limit_to_one

if TYPE_CHECKING:
    from app.engine.mismatch import Comparison, Explanation
    from app.services.explaining.files import Asked


FIGURES = ("given", "refitted", "explained")
NO_MORE = "no_effect_pays"


class Form(StrEnum):
    text = "text"
    json = "json"


def explain(
    file: Annotated[Path, typer.Argument(help="A recording: columns time, SP, PV, OP and perhaps others.")],
    sim: Annotated[str | None, typer.Option("--sim", help="The simulated PV: a column, or a file.")] = None,
    sim_model: Annotated[
        str | None,
        typer.Option(
            "--sim-model",
            help='The simulation as JSON, or a file: {"gain": 1.2, "time_constants_s": [30], "dead_time_s": 4}; '
            'perhaps "integrating": true, "damping": 0.4 (the time constant is then one over the natural frequency), '
            '"controller": {"gain": 0.5, "integral_time_s": 40}. Or a model that explain wrote.',
        ),
    ] = None,
    validate: Annotated[
        Path | None,
        typer.Option(
            "--validate",
            help="A second recording, unseen in the fit, taken for a later one: what set in or drifted stays.",
        ),
    ] = None,
    op: Annotated[str | None, typer.Option("--op", help="The column of OP.")] = None,
    pv: Annotated[str | None, typer.Option("--pv", help="The column of PV.")] = None,
    sp: Annotated[str | None, typer.Option("--sp", help="The column of SP.")] = None,
    loop: Annotated[str | None, typer.Option("--loop", help="The loop, in an export of several.")] = None,
    validate_op: Annotated[
        str | None, typer.Option("--validate-op", help="OP in --validate, where it differs.")
    ] = None,
    validate_pv: Annotated[
        str | None, typer.Option("--validate-pv", help="PV in --validate, where it differs.")
    ] = None,
    format_: Annotated[Form, typer.Option("--format", help="To read, or for machines.")] = Form.text,
    trace: Annotated[Path | None, typer.Option("--trace", help="Write PV, simulations and residuals as CSV.")] = None,
    plot: Annotated[Path | None, typer.Option("--plot", help="Write a plot: HTML, or a small picture (.svg).")] = None,
    model: Annotated[Path | None, typer.Option("--model", help="Write the explained model, for simulate.")] = None,
    judged: Annotated[
        bool, typer.Option("--judged", help="Of a long record only the part that an audit judges, without --sim.")
    ] = False,
    quick: Annotated[bool, typer.Option("--quick", help="Only where they differ, in a second, no names.")] = False,
    time_zone: TimeZoneOption = "UTC",
    date_order: DateOrderOption = DateOrder.auto,
) -> None:
    """Compare a recording with a simulation: where they differ, which physics was left out, and the fit with it.

    Without --sim and --sim-model a column PV_sim is taken where there is one, and our own identified linear loop where
    not.

    [bold]Examples[/bold]

      loopaudit explain FIC101.csv --sim PV_sim

      loopaudit explain tanks.csv --op uEst --pv yEst --validate tanks.csv --validate-op uVal --validate-pv yVal --plot
      tanks.html
    """
    from time import perf_counter

    limit_to_one(OF_LINEAR_ALGEBRA)
    from app.engine.mismatch import explain as explain_comparison
    from app.engine.mismatch import locate
    from app.services.explaining.comparisons import Columns
    from app.services.explaining.files import Asked, explained_files
    from app.services.explaining.line import explanation_line, located_line

    started, options = perf_counter(), read_in(time_zone, date_order)
    if sim is not None and sim_model is not None:
        raise RequestError("several_simulations", "--sim and --sim-model are both given; one simulation is compared")
    if quick and any(given is not None for given in (validate, trace, plot, model)):
        raise RequestError("quick_alone", "--quick has no fit: --validate, --trace, --plot and --model need one")
    if validate is None and (validate_op or validate_pv):
        raise RequestError(
            "no_validation", "--validate-op and --validate-pv name columns of a --validate, and none is given"
        )
    refuse_other_pictures(plot)
    refuse_outputs([trace, plot, model], files_read(file, validate, sim, sim_model))
    second = Columns(validate_op or op, validate_pv or pv, sp, loop)
    asked = Asked(file, Columns(op, pv, sp, loop), sim, sim_model, validate, second, judged, options)
    with compiling_told(), answering_unusable(asked, format_, started):
        found = explained_files(asked)
    comparison = found.first
    if found.long:
        say(f"all {len(comparison.pv):,} samples are explained by one loop; --judged takes those that an audit judges")
    if quick:
        with compiling_told(), answering_unusable(asked, format_, started):
            located = located_line(locate(comparison), comparison.name, perf_counter() - started)
        sys.stdout.write(as_json(located) if format_ is Form.json else located_in_words(located))
        return
    with compiling_told(), answering_unusable(asked, format_, started):
        explanation = explain_comparison(comparison, found.second)
    line = explanation_line(explanation, perf_counter() - started, found.kind, found.told_second)
    for path, text in files_to_write(explanation, comparison, line, (trace, plot, model)):
        with written(path) as stream:
            stream.write(text)
        say(f"wrote {path}")
    sys.stdout.write(as_json(line) if format_ is Form.json else as_text(line))


@contextmanager
def answering_unusable(asked: "Asked", form: Form, started: float) -> Iterator[None]:
    """Machines get their object too where recording or simulation hold nothing to compare, before the command ends."""
    from time import perf_counter

    from app.services.explaining.comparisons import name_of
    from app.services.explaining.files import asked_kind, is_unusable
    from app.services.explaining.line import unusable_line

    try:
        yield
    except DataError as error:
        if form is Form.json and is_unusable(error):
            line = unusable_line(error, name_of(asked.file), asked_kind(asked), perf_counter() - started)
            sys.stdout.write(as_json(line))
        raise


def as_json(line: dict[str, Any]) -> str:
    import json

    return json.dumps(line, ensure_ascii=False, allow_nan=False) + "\n"


def refuse_other_pictures(plot: Path | None) -> None:
    """A page or a drawing, under the very name that was asked for; a name without an ending is a page's."""
    if plot is not None and plot.suffix.lower() not in ("", ".html", ".htm", ".svg"):
        raise RequestError("plot_form", f"a plot is a page (.html) or a drawing (.svg), not {plot.suffix}: {plot}")


def files_read(file: Path, validate: Path | None, *perhaps: str | None) -> list[Path]:
    """Simulations and models may be files or what would be in them."""
    from app.services.explaining.comparisons import is_file

    named = [] if validate is None else [validate]
    return [file, *named, *(Path(text) for text in perhaps if text and is_file(text))]


def files_to_write(
    explanation: "Explanation",
    comparison: "Comparison",
    line: dict[str, Any],
    where: tuple[Path | None, Path | None, Path | None],
) -> Iterator[tuple[Path, str]]:
    """Trace, plot and model as texts, each that is wanted."""
    from app.services.explaining.plot import explanation_html
    from app.services.explaining.svg import explanation_svg
    from app.services.explaining.trace_table import as_csv, trace_rows

    trace, plot, model = where
    if trace is not None:
        yield trace, as_csv(*trace_rows(explanation))
    if plot is not None:
        draw = explanation_svg if plot.suffix.lower() == ".svg" else explanation_html
        yield plot, draw(explanation, comparison.op)
    if model is not None:
        yield model, as_json(line["model"])


def as_text(line: dict[str, Any]) -> str:
    from app.services.explaining.wording import left_in_words, ranges_of, unmoved, verdict_in_words

    said = [f"{line['recording']}: {verdict_in_words(line['verdict'], line['effects'], line['evidence'])}"]
    for effect in line["effects"]:
        said += effect_in_words(effect)
    said += [f"  {told}" for told in [ranges_of(line["effects"])] if told]
    fit = line["fit"]
    said.append(f"held-out RMSE  {errors_in_words(fit)}")
    said += [f"  {told}" for told in unmoved(fit, line["effects"])]
    said += [f"  {told}" for told in left_in_words(fit, line["figures_of"])]
    if line["validation"] is not None:
        said += validation_in_words(line["validation"])
    if line["closed_loop"] is not None:
        said += loop_in_words(line["closed_loop"])
    besides = "besides what is named, " if line["effects"] else ""
    said += [f"  {besides if reason['code'] == NO_MORE else ''}{reason['text']}" for reason in line["evidence"]]
    return "\n".join(said) + "\n"


def errors_in_words(errors: dict[str, Any]) -> str:
    known = [(figure, errors[f"rmse_{figure}"]) for figure in FIGURES]
    return ", ".join(f"{figure} {rmse}" for figure, rmse in known if rmse is not None) or "no sample could be judged"


def validation_in_words(validation: dict[str, Any]) -> list[str]:
    given = validation["given_of"]
    of = f"; given there: {given}" if given else ""
    return [f"validation     {errors_in_words(validation)}", f"  on {validation['recording']}, seen by no fit{of}"]


def loop_in_words(closed: dict[str, Any]) -> list[str]:
    """The loop closed again from SP alone, a row a simulation."""
    from app.services.explaining.wording import LOOP_WORDS

    said = ["loop closed from SP alone    period s   amplitude   Yper %   shape"]
    for key, name in LOOP_WORDS.items():
        f = closed[key]
        if f is None and key == "given":
            continue
        if f is None:
            said.append(f"  {name:<24} did not settle")
            continue
        period = "none" if f["period_s"] is None else f"{f['period_s']:.4g}"
        said.append(f"  {name:<24} {period:>10}  {f['amplitude']:>10.4g} {f['yper_pct']:>8.3g} {f['shape']:>7.2f}")
    return said


def located_in_words(line: dict[str, Any]) -> str:
    where = line["located"]
    shown = ", ".join(f"{a}-{b} s" for a, b in where["windows"][:6])
    found = f"first look: {where['block']}, {where['condition']}; windows {shown}"
    nothing = "nothing stands out at a first look, which says little: run without --quick"
    said = [f"{line['recording']}: {found if where['block'] else nothing}"]
    return "\n".join([*said, *(f"  {reason['text']}" for reason in line["evidence"])]) + "\n"


def effect_in_words(effect: dict[str, Any]) -> list[str]:
    from app.services.explaining.wording import no_size, parameters_in_words

    other = f" (or {', '.join(effect['alternatives'])})" if effect["alternatives"] else ""
    said = [f"  {effect['effect']}{other}, probability {effect['probability']}, {effect['condition']}"]
    said += [f"    {words}" for words in [*parameters_in_words(effect["parameters"]), no_size(effect)] if words]
    shown = ", ".join(f"{a}-{b} s" for a, b in effect["windows"][:6])
    said.append(f"    windows: {shown}{' ...' if len(effect['windows']) > 6 else ''}")
    return said + [f"    {reason['text']}" for reason in effect["evidence"]]
