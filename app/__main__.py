"""The console script, and `python -m app` where it is not on the path, as for child processes of `serve`."""

import atexit
import codecs
import gc
import io
import os
import signal
import sys

BETWEEN_LOOKS = 20_000  # objects; at Python's 700, a sixth of a start is looking through what was imported for garbage


def open_missing_streams() -> None:
    """Stands in for a stream that the caller closed (`>&-`), or the next file that is opened would have its number. One
    in place of stdout refuses what is written: results are not lost in silence.
    """
    for number, mode, stream in ((0, "r", sys.stdin), (1, "w", sys.stdout), (2, "w", sys.stderr)):
        if stream is not None:
            continue
        os.set_inheritable(os.open(os.devnull, os.O_WRONLY if number == 2 else os.O_RDONLY), True)
        setattr(sys, ("stdin", "stdout", "stderr")[number], os.fdopen(number, mode, encoding="utf-8", closefd=False))


def as_escapes(error: UnicodeError) -> tuple[str, int]:
    """What an encoding lacks, as JSON writes it: a line of JSON stays one, and no tag is lost."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    import json

    return json.dumps(error.object[error.start : error.end])[1:-1], error.end


def escape_what_stdout_lacks() -> None:
    """A locale that is not UTF-8 has no letters for the tags of other countries: results are not lost for that. That of
    C lets bytes of file names through, and has no letters either."""
    codecs.register_error("loopaudit.escapes", as_escapes)
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors in ("strict", "surrogateescape"):
        sys.stdout.reconfigure(errors="loopaudit.escapes")


def main() -> None:
    """Ctrl-C while the command is loaded ends it without a word; from then on it is the command's."""
    open_missing_streams()
    escape_what_stdout_lacks()
    gc.set_threshold(BETWEEN_LOOKS)
    # What ends with the process is not looked through once more: that was a sixth of a short command.
    atexit.register(gc.freeze)
    before = signal.signal(signal.SIGINT, signal.SIG_DFL)
    from app.cli.main import main as command

    signal.signal(signal.SIGINT, before)
    command()


if __name__ == "__main__":
    main()
