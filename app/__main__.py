"""The console script, and `python -m app` where it is not on the path, as for child processes of `serve`."""

import gc
import signal

BETWEEN_LOOKS = 20_000  # objects; at Python's 700, a sixth of a start is looking through what was imported for garbage


def main() -> None:
    """Ctrl-C while the command is loaded ends it without a word; from then on it is the command's."""
    gc.set_threshold(BETWEEN_LOOKS)
    before = signal.signal(signal.SIGINT, signal.SIG_DFL)
    from app.cli.main import main as command

    signal.signal(signal.SIGINT, before)
    command()


if __name__ == "__main__":
    main()
