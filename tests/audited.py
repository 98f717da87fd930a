"""Audits that more than one test asks about, made once: of one record the engine always says the same."""

import pickle
from dataclasses import dataclass, field
from functools import lru_cache

from app.engine.audit import Audit, AuditConfig, audit
from app.engine.recording import Recording


@dataclass(frozen=True)
class _Told:
    by: bytes
    recording: Recording = field(compare=False)


@lru_cache(maxsize=2000)
def _audited(told: _Told, config: AuditConfig) -> Audit:
    return audit(told.recording, config)


def audited(recording: Recording, config: AuditConfig | None = None) -> Audit:
    """The audit of what a recording holds, by all that it holds."""
    by = pickle.dumps((recording.fingerprint(), recording.name, dict(recording.others)))
    return _audited(_Told(by, recording), config or AuditConfig())
