"""What a command writes is there whole or not at all, and never over what it reads."""

import json
import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest

from app.cli.outputs import part_of, refuse_outputs, written
from app.errors import RequestError
from app.lab.bench import running
from tests import forked
from tests.cli.calling import run

FULL = Path("/dev/full")


def in_a_process(*arguments: object, stdout: object = subprocess.PIPE, **options) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "app", *map(str, arguments)]
    # Tests that were started in the background may pass over interrupts, and their processes would do so too.
    hears = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    return subprocess.Popen(command, stdout=stdout, stderr=subprocess.PIPE, text=True, preexec_fn=hears, **options)


@pytest.fixture(scope="module")
def kept(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("recordings")
    assert run("simulate", "--samples", 300, "--valve", "he", "-S", 5, "--out", folder / "L1.csv").exit_code == 0
    return folder / "L1.csv"


@pytest.fixture
def recording(kept, tmp_path) -> Path:
    target = tmp_path / "in" / "L1.csv"
    target.parent.mkdir()
    target.write_bytes(kept.read_bytes())
    return target


@pytest.mark.parametrize(
    "arguments",
    [
        ["audit", "{0}", "--out", "{0}"],
        ["audit", "{0.parent}", "--out", "{0}"],
        ["audit", "{0.parent}", "--format", "csv", "--out", "{0.parent}/verdicts.csv"],
        ["audit", "{0}", "--out", "{0.parent}/../in/L1.csv"],
        ["audit", "{0}", "--out", "{0.parent}/link.csv"],
        ["audit", "{0}", "--mapping", "{0.parent}/tags.csv", "--out", "{0.parent}/tags.csv"],
        ["explain", "{0}", "--trace", "{0}"],
        ["explain", "{0}", "--model", "{0}"],
        ["explain", "{0}", "--plot", "{0.parent}/page.html", "--trace", "{0.parent}/page.html"],
        ["explain", "{0}", "--validate", "{0.parent}/tags.csv", "--model", "{0.parent}/tags.csv"],
        ["explain", "{0}", "--sim-model", "{0.parent}/tags.csv", "--model", "{0.parent}/tags.csv"],
        ["simulate", "--model", "{0.parent}/tags.csv", "--recording", "{0}", "--out", "{0}"],
    ],
    ids=lambda arguments: " ".join(arguments[:1] + arguments[2:]),
)
def test_a_file_that_is_read_is_never_written(arguments, recording):
    (recording.parent / "link.csv").symlink_to(recording)
    tags = recording.parent / "tags.csv"
    tags.write_text("tag,loop,signal\nPV,L1,PV\nOP,L1,OP\n")
    before = recording.read_bytes(), tags.read_bytes(), sorted(recording.parent.iterdir())
    done = run(*(argument.format(recording) for argument in arguments))
    assert isinstance(done.exception, RequestError)
    assert done.exception.code in {"output_is_input", "outputs_same"}
    assert (recording.read_bytes(), tags.read_bytes(), sorted(recording.parent.iterdir())) == before


def test_a_plot_is_written_under_the_name_that_was_asked_for_or_refused(recording):
    done = run("explain", recording, "--plot", recording.with_suffix(".png"))
    assert isinstance(done.exception, RequestError)
    assert done.exception.code == "plot_form"
    page = recording.with_suffix(".svg")
    recording.rename(page)
    done = run("explain", page, "--plot", page)
    assert isinstance(done.exception, RequestError)
    assert done.exception.code == "output_is_input"


def test_what_was_there_stays_until_all_is_written(tmp_path):
    out = tmp_path / "verdicts.csv"
    out.write_text("yesterday\n")
    out.chmod(0o640)
    with written(out) as stream:
        stream.write("today\n")
        stream.flush()
        assert out.read_text() == "yesterday\n"
    assert out.read_text() == "today\n"
    assert out.stat().st_mode & 0o777 == 0o640
    assert list(tmp_path.iterdir()) == [out]


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()], ids=str)
def test_what_was_there_stays_where_something_fails(tmp_path, error):
    out = tmp_path / "verdicts.csv"
    out.write_text("yesterday\n")
    breaking_off = written(out)
    breaking_off.__enter__().write("half of today")
    assert not breaking_off.__exit__(type(error), error, None)
    assert out.read_text() == "yesterday\n"
    assert list(tmp_path.iterdir()) == [out]


def test_a_link_goes_on_pointing_where_it_did(tmp_path):
    (tmp_path / "there").mkdir()
    link, target = tmp_path / "link.csv", tmp_path / "there" / "verdicts.csv"
    link.symlink_to(target)
    for text in ("first", "second"):
        with written(link) as stream:
            stream.write(text)
        assert link.is_symlink()
        assert target.read_text() == text


def test_a_new_file_has_the_rights_that_the_umask_leaves(tmp_path):
    before = os.umask(0o027)
    try:
        with written(tmp_path / "new.csv") as stream:
            stream.write("x")
    finally:
        os.umask(before)
    assert (tmp_path / "new.csv").stat().st_mode & 0o777 == 0o640


def test_no_folder_is_said_before_anything_is_done(tmp_path, recording):
    for out in (tmp_path / "nowhere" / "x.csv", tmp_path):
        with pytest.raises(RequestError) as refused:
            refuse_outputs([out], [recording])
        assert refused.value.code == "file"


def test_results_of_yesterday_outlast_an_audit_of_nothing_usable(tmp_path):
    out = tmp_path / "verdicts.csv"
    out.write_text("yesterday\n")
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "labels.csv").write_text("recording,label\nL0,stiction\n")
    assert run("audit", tmp_path / "in", "--format", "csv", "--out", out).exit_code == 2
    assert out.read_text() == "yesterday\n"


def test_stdout_by_its_name_is_stdout(recording):
    done = run("audit", recording, "--format", "jsonl", "--out", "/dev/stdout")
    assert json.loads(done.stdout)["recording"] == "L1"


@pytest.mark.parametrize("arguments", [["audit", "{}"], ["simulate"], ["explain", "{}", "--quick"]], ids=" ".join)
def test_a_full_disk_on_stdout_is_one_sentence_and_2(arguments, recording):
    with FULL.open("w") as full:
        done = forked.run(*(argument.format(recording) for argument in arguments), stdout=full, timeout=240)
    told = done.stderr.splitlines()
    assert done.returncode == 2
    assert told[-1] == "loopaudit: the results could not be written: No space left on device [output]"
    assert not any("Traceback" in line or "ignored" in line for line in told)


def written_as_it_ends(stdout: object) -> subprocess.CompletedProcess[str]:
    """A command by itself, of which all that it wrote is still to be written when it is done: what is forked ends
    without the last flush of an interpreter."""
    buffered = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    done = in_a_process("--version", stdout=stdout, env=buffered)
    return subprocess.CompletedProcess(done.args, stderr=done.communicate(timeout=60)[1], returncode=done.returncode)


def test_what_found_no_room_is_not_written_once_more_as_the_interpreter_ends():
    with FULL.open("w") as full:
        done = written_as_it_ends(full)
    told = "loopaudit: the results could not be written: No space left on device [output]\n"
    assert (done.returncode, done.stderr) == (2, told)


def test_what_found_no_reader_is_not_written_once_more_as_the_interpreter_ends():
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as nobody:
        done = written_as_it_ends(nobody)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("form", ["table", "csv", "jsonl"])
def test_a_full_disk_under_out_is_one_sentence_and_2(form, recording):
    done = forked.run("audit", recording, "--format", form, "--out", FULL, timeout=240)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "No space left on device [output]" in done.stderr


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_an_interrupt_ends_an_audit_soon_and_keeps_what_was_found(jobs, kept, tmp_path):
    folder, results = tmp_path / "in", tmp_path / "results.jsonl"
    folder.mkdir()
    for number in range(400):
        (folder / f"L{number:03}.csv").write_bytes(kept.read_bytes())
    with results.open("w") as stream:
        command = ("audit", folder, "--format", "jsonl", "--jobs", jobs)
        done = in_a_process(*command, stdout=stream, start_new_session=True)
        while not results.read_text().count("\n") and done.poll() is None:
            time.sleep(0.05)
        os.killpg(done.pid, signal.SIGINT)
        sent = time.monotonic()
        told = done.communicate(timeout=60)[1]
    assert time.monotonic() - sent < 5.0
    found = [json.loads(line)["recording"] for line in results.read_text().splitlines()]
    assert found == [f"L{number:03}" for number in range(len(found))]
    assert 0 < len(found) < 400
    assert done.returncode == 130
    assert told == f"loopaudit: interrupted, {len(found)} of 400 files audited; what was found so far is written\n"


@pytest.mark.parametrize("form", ["csv", "jsonl"])
def test_an_interrupt_leaves_a_file_as_it_was_and_keeps_what_was_found_beside_it(form, kept, tmp_path):
    folder, out, part = tmp_path / "in", tmp_path / f"verdicts.{form}", tmp_path / f"verdicts.{form}.part"
    folder.mkdir()
    out.write_text("yesterday\n")
    for number in range(400):
        (folder / f"L{number:03}.csv").write_bytes(kept.read_bytes())
    (folder / "L005.csv").write_text("time,temp\n")  # of which it is told, so that it is known how far the audit came
    reading, writing = os.pipe()
    with os.fdopen(writing, "w") as said, Path(os.devnull).open("w") as nothing:
        command = ("audit", folder, "--jobs", "1", "--format", form, "--out", out)
        done = forked.command(*command, stdout=nothing, stderr=said)
    with os.fdopen(reading) as saying:
        told = saying.readline()
        os.killpg(done.pid, signal.SIGINT)
        told += saying.read()
    assert done.wait(60) == 130
    assert told.endswith(f"what was found so far is in {part}; {out} is left as it was\n")
    assert out.read_text() == "yesterday\n"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in", out.name, part.name]
    lines = part.read_text().splitlines()[form == "csv" :]
    assert 5 <= len(lines) < 400
    assert all(f"L{number:03}" in line for number, line in zip((0, 1, 2, 3, 4, 6), lines, strict=False))


def test_an_interrupt_before_anything_is_found_leaves_nothing(kept, tmp_path):
    out = tmp_path / "verdicts.csv"
    writing = written(out, part=part_of(out))
    writing.__enter__()
    assert not writing.__exit__(KeyboardInterrupt, KeyboardInterrupt(), None)
    assert list(tmp_path.iterdir()) == []


def test_the_part_is_never_one_of_the_files_that_are_read(kept, tmp_path):
    given = tmp_path / "verdicts.csv.part"
    given.write_bytes(kept.read_bytes())
    result = run("audit", given, "--out", tmp_path / "verdicts.csv")
    assert (result.exception.code, given.read_bytes()) == ("output_is_input", kept.read_bytes())


def test_figures_of_a_bench_that_breaks_off_stay(tmp_path, monkeypatch):
    out = tmp_path / "bench.json"
    known = {"format": 1, "sections": {"plant": {"took_s": 1.5}}}
    out.write_text(json.dumps(known))
    monkeypatch.setitem(running.SECTIONS, "search", lambda bench: {"fits": 1.23456})

    def no_room(*_: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as full:
        full.setattr(os, "fsync", no_room)
        assert run("bench", "search", "--quick", "--out", out).exit_code != 0
    assert json.loads(out.read_text()) == known
    assert list(tmp_path.iterdir()) == [out]
    assert run("bench", "search", "--quick", "--out", out).exit_code == 0
    sections = json.loads(out.read_text())["sections"]
    assert (sections["plant"], sections["search"]["fits"]) == ({"took_s": 1.5}, 1.235)


def test_figures_and_page_of_a_bench_are_two_files_in_folders_that_are_there(tmp_path):
    same = run("bench", "search", "--quick", "--out", tmp_path / "a", "--page", tmp_path / "a")
    nowhere = run("bench", "search", "--quick", "--out", tmp_path / "none" / "a")
    assert (same.exception.code, nowhere.exception.code) == ("outputs_same", "file")


def test_a_report_is_not_written_over_the_data_base(tmp_path, monkeypatch):
    monkeypatch.setenv("LOOPAUDIT_DATA_DIR", str(tmp_path))
    assert run("keys", "create", "me").exit_code == 0
    before = (tmp_path / "loopaudit.db").read_bytes()
    done = run("report", "--plant", "--out", tmp_path / "loopaudit.db")
    assert isinstance(done.exception, RequestError)
    assert done.exception.code == "output_is_input"
    assert (tmp_path / "loopaudit.db").read_bytes() == before


def closed_before(arguments: str, closing: str) -> subprocess.CompletedProcess[str]:
    """A command of a shell that closed some of its streams first, as cron lines and daemons do."""
    line = f"{sys.executable} -m app {arguments} {closing}"
    return subprocess.run(["sh", "-c", line], capture_output=True, text=True, timeout=120)


@pytest.mark.parametrize("closing", [">&-", "<&- >&-"])
def test_a_stdout_that_was_closed_is_told_as_no_room_for_the_results(closing):
    done = closed_before("simulate --samples 100", closing)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.splitlines()[-1] == ("loopaudit: the results could not be written: Bad file descriptor [output]")


def test_results_that_go_to_a_file_need_no_stdout(tmp_path):
    done = closed_before(f"simulate --samples 100 --out {tmp_path}/new.csv", "<&- >&- 2>&-")
    assert done.returncode == 0
    assert len((tmp_path / "new.csv").read_text().splitlines()) == 101


def test_results_are_made_though_nobody_hears_a_message(recording):
    done = closed_before(f"audit {recording}.none {recording} --format jsonl", "2>&-")
    assert done.returncode == 1
    assert [json.loads(line)["recording"] for line in done.stdout.splitlines()] == ["L1"]


def test_results_are_made_though_there_is_no_room_for_a_message(recording):
    with FULL.open("w") as full:
        done = forked.run("audit", f"{recording}.none", recording, "--format", "jsonl", stderr=full)
    assert done.returncode == 1
    assert [json.loads(line)["recording"] for line in done.stdout.splitlines()] == ["L1"]
