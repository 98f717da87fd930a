"""What the audit line leaves out, for storage and charts."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from app.engine.audit import Audit
from app.engine.corroborate import Corroboration
from app.engine.recording import FloatArray
from app.engine.reference.hammerstein import OneParameterResult, TwoParameterResult
from app.engine.reference.reliability import Rung
from app.services.audit_json.line import episode_line, rival_line, space_of
from app.services.audit_json.numbers import scalars, short, short_together
from app.services.audit_json.size import stiction_size_detail
from app.services.audit_json.spectra import spectra


def detail(audit: Audit, line: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """What the line leaves out, for storage and charts: findings, rungs with their curves and surfaces, spectra.

    Numbers have five significant digits, spectra at most 256 lines (the highest of each group is kept). line: that of
    the audit, where it is there already; what it has is taken from there.
    """
    reference = audit.reference
    told = line or {
        "rivals": [rival_line(rival).model_dump() for rival in audit.judgement.rivals],
        "episodes": [episode_line(episode).model_dump() for episode in audit.episodes.found],
    }
    return {
        "findings": [_finding(finding) for finding in audit.fitness.findings],
        "window": None if audit.window is None else vars(audit.window),
        "identified": None if audit.identified is None else vars(audit.identified),
        "op_ends": None if audit.fitness.record is None else short(_ends(audit.fitness.record.op)),
        "key_figures": scalars(vars(audit.key_figures)),
        "health": [vars(part) for part in audit.health.parts],
        "oscillation": None if audit.oscillation is None else scalars(vars(audit.oscillation)),
        "rivals": told["rivals"],
        "methods": [_method(method) for method in audit.judgement.methods],
        "episodes": told["episodes"],
        "episode_windows": [scalars(vars(window)) for window in audit.episodes.windows],
        "rungs": [] if reference is None else [_rung(rung) for rung in reference.rungs],
        "spectra": None if reference is None else spectra(reference.yper),
        "stiction_size": None if audit.stiction_size is None else stiction_size_detail(audit.stiction_size),
    }


def _ends(values: FloatArray) -> FloatArray:
    return np.array([np.min(values), np.max(values)])


def _method(method: Corroboration) -> dict[str, Any]:
    """What a published method says beside the verdict; its sentence and its source are the engine's."""
    told = ("method", "applies", "why_not", "statistic", "threshold", "says")
    return scalars({name: getattr(method, name) for name in told})


def _finding(finding: Any) -> dict[str, Any]:
    return scalars(vars(finding))


def _rung(rung: Rung) -> dict[str, Any]:
    return {
        "search_space": list(space_of(rung)),
        "stiction": bool(rung.stiction),
        "reading": rung.reading,
        "agrees": bool(rung.agrees),
        "one_parameter": _curve(rung.one),
        "two_parameter": None if rung.two is None else _surface(rung.two),
    }


def _curve(one: OneParameterResult) -> dict[str, Any]:
    return {
        **short_together(d=one.d, rmse=one.rmse, rmse_refined=one.rmse_refined, aic=one.aic),
        "orders": np.stack([one.na, one.nb, one.nc], axis=1).tolist(),
        "best": int(one.best),
        "stiction": bool(one.stiction),
    }


def _surface(two: TwoParameterResult) -> dict[str, Any]:
    return {
        **short_together(S=two.S, J=two.J, rmse=two.rmse, rmse_refined=two.rmse_refined),
        "best": int(two.best),
        "stiction": bool(two.stiction),
    }
