"""`loopaudit worker` with four loops that are bad for whoever audits them: the processes under test are otherwise ours.

POISON_KILL ends its process, POISON_HANG never returns to Python, POISON_SLOW takes for ever, POISON_MEMORY asks for
more memory than its process may have.
"""

import ctypes
import os
import resource
import signal
import sys

KILL, HANG, SLOW, MEMORY = "POISON_KILL", "POISON_HANG", "POISON_SLOW", "POISON_MEMORY"
ROOM_BYTES = 128 << 20


def spoil() -> None:
    from app.services.auditing import chunks

    audit = chunks.audit

    def spoiled(recording, config=None):
        if recording.name in POISONS:
            POISONS[recording.name]()
        return audit(recording, config)

    chunks.audit = spoiled


def kill() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def hang() -> None:
    """In C, holding the lock of the interpreter, as a compiled loop that does not end."""
    ctypes.PyDLL(None).pause.restype = ctypes.c_int
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGALRM})
    ctypes.PyDLL(None).pause()


def slow() -> None:
    while True:
        sum(range(1000))


def memory() -> None:
    """As in a container with a limit: the process may grow by 128 MB, and the audit wants 1 GB."""
    import numpy as np

    in_use = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()  # noqa: SIM115 - a line of /proc
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (in_use + ROOM_BYTES, before[1]))
    try:
        np.ones(1 << 27)
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


POISONS = {KILL: kill, HANG: hang, SLOW: slow, MEMORY: memory}

if __name__ == "__main__":
    from app.threads import use_one_thread

    use_one_thread()
    spoil()
    from app.cli.main import main

    sys.argv = ["loopaudit", *sys.argv[1:]]
    main()
