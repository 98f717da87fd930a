"""Commands as the tests call them, in this process, and an export that most of them can be given."""

import pytest
from typer.testing import CliRunner, Result

from app.cli.main import cli, main

WIDE = "DateTime,FIC1.PV,FIC1.OP,FIC2.PV\n" + "".join(
    f"2026-01-01T00:00:{k:02d}Z,{50 + k % 7},{40 + k % 5},{k}\n" for k in range(60)
)


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, list(map(str, arguments)))


def as_program(monkeypatch, capsys, *arguments) -> tuple[int, str, str]:
    """Through `main`, which turns a user's error into a line and an exit code."""
    monkeypatch.setattr("sys.argv", ["loopaudit", *map(str, arguments)])
    with pytest.raises(SystemExit) as ended:
        main()
    said = capsys.readouterr()
    return int(ended.value.code), said.out, said.err
