"""Audits that more than one test asks about, made once: of one record the engine always says the same."""

import pickle
from dataclasses import dataclass, field, fields
from functools import lru_cache

from app.engine.audit import Audit, audit
from app.engine.recording import Recording


@dataclass(frozen=True)
class _Told:
    by: bytes
    recording: Recording = field(compare=False)


@lru_cache(maxsize=200)
def _audited(told: _Told) -> Audit:
    return audit(told.recording)


def audited(recording: Recording) -> Audit:
    """The audit of what a recording holds, by all that it holds."""
    return _audited(_Told(pickle.dumps([getattr(recording, part.name) for part in fields(recording)]), recording))
