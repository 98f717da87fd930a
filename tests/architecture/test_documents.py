"""What README and pages of docs name can be found, every setting stands in its table, and figures told twice agree."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer

from app.cli.main import cli
from app.lab.bench.page import performance_page
from app.lab.bench.running import read
from app.main import create_app
from app.settings import Settings

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
SETTINGS = (ROOT / "docs" / "SETTINGS.md").read_text(encoding="utf-8")
ACCURACY = (ROOT / "docs" / "ACCURACY.md").read_text(encoding="utf-8")
MEASURED = read(ROOT / "docs" / "performance.json")
ROWS = re.findall(r"^\| `(LOOPAUDIT_\w+)` \| (?:`(.*?)`)? *\| (.+?) \|$", SETTINGS, re.MULTILINE)
DOCUMENTS = [
    *(ROOT / name for name in ("README.md", "CHANGELOG.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
    *sorted((ROOT / "app" / "engine").glob("*.md")),
]
OF_THE_CLIENT = {"LOOPAUDIT_URL", "LOOPAUDIT_KEY"}


def test_every_setting_stands_in_the_table_with_its_meaning():
    listed = {name: meaning for name, _, meaning in ROWS}
    settings = {f"LOOPAUDIT_{name.upper()}": field.description for name, field in Settings.model_fields.items()}
    assert {name: meaning for name, meaning in listed.items() if name not in OF_THE_CLIENT} == settings


def test_the_readme_lists_every_setting():
    assert set(re.findall(r"`(LOOPAUDIT_[A-Z_]+)`", README)) >= {name for name, *_ in ROWS}


@pytest.mark.parametrize("name", [name for name in Settings.model_fields if not name.endswith("_port")])
def test_what_a_value_is_refused_for_stands_in_its_meaning(name):
    field = Settings.model_fields[name]
    ends = [getattr(limit, end) for limit in field.metadata for end in ("ge", "le") if hasattr(limit, end)]
    told = [int(number.replace(",", "")) for number in re.findall(r"\d[\d,]*", field.description)]
    asked = [int(end) for end in ends if end not in (0, 1)]
    weeks = 43_200  # minutes, for which nobody asks
    assert not {end for end in asked if end != weeks} - set(told)


@pytest.mark.parametrize(("variable", "default"), [(name, default) for name, default, _ in ROWS if default])
def test_the_defaults_in_the_table_are_the_defaults(monkeypatch, variable, default):
    if variable in OF_THE_CLIENT:
        return
    field = variable.removeprefix("LOOPAUDIT_").lower()
    monkeypatch.delenv(variable, raising=False)
    own = getattr(Settings(), field)
    monkeypatch.setenv(variable, default)
    assert getattr(Settings(), field) == own


def _anchors(page: Path) -> set[str]:
    """What a link may name in a page: its headings in small letters, without signs, hyphens for blanks."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", DOCUMENTS, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_files_and_to_headings_in_them(page):
    for path, anchor in re.findall(r"\]\((?!http)([^)#\s]*)(?:#([^)]*))?\)", page.read_text(encoding="utf-8")):
        target = page.parent / path if path else page
        assert target.exists(), path
        assert not anchor or anchor in _anchors(target), f"{path}#{anchor}"


TWO_WORDS = re.compile(r"(?<!stiction )data\s+bases?\b", re.IGNORECASE)
"""English writes it as one; the International Stiction Data Base is called so."""


@pytest.mark.parametrize("page", DOCUMENTS, ids=lambda page: str(page.relative_to(ROOT)))
def test_pages_write_database_as_one_word(page):
    assert not TWO_WORDS.findall(page.read_text(encoding="utf-8"))


def _texts(module: Path) -> Iterator[str]:
    """The strings of a module that are not its docstrings."""
    nodes = list(ast.walk(ast.parse(module.read_text(encoding="utf-8"))))
    alone = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in alone:
            yield node.value


def test_what_programs_tell_writes_database_as_one_word():
    told = [text for module in (ROOT / "app").rglob("*.py") for text in _texts(module)]
    assert len(told) > 10_000
    assert not [text for text in told if TWO_WORDS.search(text)]


def test_modules_write_database_as_one_word_in_what_they_say_of_themselves_too():
    modules = [module for room in ("app", "migrations", "workers", "tests") for module in (ROOT / room).rglob("*.py")]
    assert len(modules) > 1_000
    assert not [module for module in modules if TWO_WORDS.search(module.read_text(encoding="utf-8"))]


@pytest.mark.parametrize("path", sorted(set(re.findall(r"`((?:app|tests|workers|migrations)/[\w/.]*)`", README))))
def test_places_named_for_changes_are_there(path):
    assert (ROOT / path).exists()


def test_commands_of_the_readme_exist():
    commands = {command.name for command in cli.registered_commands} | {group.name for group in cli.registered_groups}
    assert set(re.findall(r"`loopaudit (\w+)", README)) <= commands
    assert commands <= set(re.findall(r"loopaudit (\w+)", README))


def _options(command) -> set[str]:
    """Of a command and of those below it."""
    own = {name for parameter in command.params for name in (*parameter.opts, *parameter.secondary_opts)}
    return own.union({"--help"}, *(_options(below) for below in getattr(command, "commands", {}).values()))


@pytest.mark.parametrize("page", DOCUMENTS, ids=lambda page: str(page.relative_to(ROOT)))
def test_options_of_commands_in_all_pages_exist(page):
    commands = typer.main.get_command(cli).commands
    for name, behind in re.findall(r"loopaudit ([a-z]+)\b([^\n`&;#]*)", page.read_text(encoding="utf-8")):
        told = set(re.findall(r"(?<![\w-])(--[a-z][a-z-]+|-[A-Z])\b", behind))
        assert not told or told <= _options(commands[name]), name


def test_routes_of_the_readme_exist():
    paths = set(create_app(Settings()).openapi()["paths"])
    assert set(re.findall(r"(/v1/\w+(?:/\{\w+\})?)`", README)) <= {
        path.replace("upload_id", "id").replace("audit_id", "id") for path in paths
    }
    assert {path.split("/")[2] for path in paths if path.startswith("/v1/")} <= set(re.findall(r"/v1/(\w+)", README))


def _row(page: str, head: str) -> list[str]:
    """The cells behind the first one, of the first row of a table whose first cell begins so."""
    line = re.search(rf"^\| {re.escape(head)}.*$", page, re.MULTILINE)
    assert line, head
    return [cell.strip() for cell in line[0].strip("|").split("|")][1:]


def test_the_first_figures_of_the_readme_are_those_of_accuracy():
    rule_auc, rule_balanced = _row(ACCURACY, "published rule |")[1:3]
    (auc, auc_95), (right, right_95) = _row(ACCURACY, "AUC |"), _row(ACCURACY, "right of those called reliable")
    accused, accused_95 = _row(ACCURACY, "healthy valves called sticky and reliable")
    share = float(_row(ACCURACY, "called reliable")[0].removesuffix(" %"))
    undecided = _row(ACCURACY, "balanced accuracy, undecided counted as wrong")[0]
    unseen_auc, *_, unseen_share, unseen_right, _ = _row(ACCURACY, "whole industries")
    told = _row(README, "balanced accuracy, called at 0.5")
    assert _row(README, "AUC |") == [f"{auc} (95 %: {auc_95})", rule_auc]
    assert told[0].startswith(f"{_row(ACCURACY, 'forced balanced accuracy |')[0]} (")
    assert told[0].endswith(f" {undecided})")
    assert told[1].startswith(f"{rule_balanced} ")
    reliable = f"{share:.0f} % of the valves, {right} of those right (95 %: {right_95})"
    assert _row(README, "says which of its verdicts to rely on")[0] == reliable
    assert _row(README, "healthy valves that are accused")[0] == f"{accused}, one of 40 (95 %: {accused_95})"
    unseen = f"[{unseen_auc}; {float(unseen_share.removesuffix(' %')):.0f} %, {unseen_right}]"
    assert _row(README, "all others of its kind unseen")[0].startswith(unseen)


def test_the_times_of_the_readme_are_those_of_the_benchmark():
    audit, night = MEASURED["sections"]["audit"], MEASURED["sections"]["plant"]["whole"]
    mean, dearest = (f"{audit['longer'][name]:.0f}" for name in ("ms_mean", "ms_max"))
    assert f"takes {mean} ms on one core (the mean of 60 simulated loops, {dearest} at most;" in README
    mean, dearest = (f"{audit['recorded'][name]:.0f}" for name in ("ms_mean", "ms_max"))
    assert f"recorded in plants the mean is {mean}, {dearest} at most)" in README
    minutes = {2: "two", 3: "three"}[round(night["wall_min"])]
    assert night["workers"] == 2
    assert f"a night of 14,000 loops {minutes} minutes on two" in README


def test_the_page_of_performance_is_what_its_figures_write():
    assert (ROOT / "docs" / "PERFORMANCE.md").read_text(encoding="utf-8") == performance_page(MEASURED)


def test_what_an_administrator_reckons_with_is_what_was_measured():
    sections = MEASURED["sections"]
    bytes_a_loop, night = sections["plant"]["storage"], sections["plant"]["whole"]
    page = (ROOT / "docs" / "guides" / "ADMINISTRATOR.md").read_text(encoding="utf-8")
    kept = bytes_a_loop["verdicts"] + bytes_a_loop["audit_items"]
    assert f"| the night's audit ({night['ms_a_loop']:.0f} ms a loop and worker) | " in page
    assert _row(page, "the night's audit")[1] == f"{night['wall_s']:.0f} s"
    assert f"| series, 400 days ({bytes_a_loop['series']:,.0f} bytes a loop and day) | " in page
    assert f"| details of verdicts, 90 days ({bytes_a_loop['verdict_details']:,.0f} bytes) | " in page
    assert _row(page, "series, 400 days")[1] == f"{bytes_a_loop['series'] * 400 * 14_000 / 1e9:.0f} GB"
    assert _row(page, f"verdicts and runs, 1,825 days ({kept:,.0f} bytes)")[1] == f"{kept * 1825 * 14_000 / 1e9:.0f} GB"
    rows = sections["api"]["busy"]["table, a page of 100"]["kb"] / 100
    connections = (ROOT / "docs" / "CONNECTIONS.md").read_text(encoding="utf-8")
    assert f"| size | a row is {rows:.1f} kB (" in connections


def test_what_the_guides_tell_of_derivative_action_is_what_the_bench_found():
    bench = (ROOT / "docs" / "TESTBENCH.md").read_text(encoding="utf-8")
    counts = []
    for process in ("flow", "level"):
        called, _, wrong = _row(bench, f"PID on {process}  ")[2:5]  # the first row of it is that of sticky loops
        assert _row(bench, f"**derivative action**: PID on {process}") == [called, wrong]
        counts += [round(8 * float(share.removesuffix(" %")) / 100) for share in (called, wrong)]
    found, cleared, found_level, cleared_level = (("no", "one", "two", "three", "four", "five")[n] for n in counts)
    operator, engineer = (
        " ".join((ROOT / "docs" / "guides" / name).read_text(encoding="utf-8").split())
        for name in ("OPERATOR.md", "ENGINEER.md")
    )
    assert f"under PID on a flow {found} was found, and {cleared} were cleared with *rely on it*, wrongly." in operator
    assert f"On a level {found_level} was found and {cleared_level} were cleared" in operator
    assert f"under PID on a flow {found} is found and {cleared} are cleared *reliably*, wrongly;" in engineer
    assert f"of eight on a level {found_level} is found and {cleared_level} are cleared so." in engineer


def test_the_results_of_the_proof_are_those_of_its_tables():
    page = (ROOT / "docs" / "PROOF.md").read_text(encoding="utf-8")
    named, held_out = (
        "one effect, first name or its alternatives right",
        "held-out RMSE over the true model's on the same",
    )
    assert _row(page, "one effect missing, named right")[0] == ", ".join(_row(page, named)[:2])
    told = _row(page, "the free run's error on unseen data, one effect")[0]
    assert told == f"{', '.join(_row(page, held_out)[:2])} (median)"


def test_neighbours_are_told_alike_on_both_pages():
    wirings, days = ((ROOT / "docs" / name).read_text(encoding="utf-8") for name in ("WIRINGS.md", "LONG_RECORDS.md"))
    accused = re.search(r"shaken by 60 valves that stick, (\d+) are accused reliably by their own records", wirings)
    relied = re.search(r"(\d+) of the 60 sticking valves are relied on before and after", wirings)
    assert accused
    assert relied
    assert _row(days, "healthy, shaken by a valve that sticks")[-1].startswith(f"{accused[1]} and ")
    assert _row(days, "the 60 valves that shake them")[-1].startswith(f"{relied[1]} and ")
