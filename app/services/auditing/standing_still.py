"""Whether anybody works on the loops that wait, for monitoring and for who waits for them."""

from app.services.backend import Backend
from app.storage import standstill

SWEEPS = 10
"""So many times the workers were to be called again, and none came."""


def standstill_s(backend: Backend) -> float:
    """For how many seconds no worker gave a sign although loops wait; 0 where none waits or one is at work."""
    with backend.database.read() as connection:
        return standstill.standstill_s(connection)


def stands_still_s(backend: Backend) -> float:
    """The same where it is so long that nobody will come; else 0."""
    silent_s = standstill_s(backend)
    return silent_s if silent_s > SWEEPS * backend.settings.stalled_s else 0.0


def nobody_works(backend: Backend) -> str:
    """What a page says of a run that nobody works on; empty where somebody does."""
    silent_s = stands_still_s(backend)
    if not silent_s:
        return ""
    return (
        f"Nobody works on it: for {silent_s / 60:.0f} minutes no worker has given a sign of life. Tell whoever runs "
        "this service; loopaudit doctor says why."
    )
