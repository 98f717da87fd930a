"""Writes the fitted model as a Python module of constants: the engine reads no files."""

import hashlib
from pathlib import Path

import numpy as np

from app.engine.features import NAMES
from app.engine.verdict.shape_model import ShapeModel

_DIGITS = 4
_WIDTH = 112


def version_of(model: ShapeModel) -> str:
    """A hash of the numbers as they are written."""
    return hashlib.sha256(_body(model).encode()).hexdigest()[:12]


def write(model: ShapeModel, path: Path) -> str:
    """Writes the module and returns the version in it."""
    body, version = _body(model), version_of(model)
    head = '"""The fitted numbers of the verdict. Made by `make evaluate`; not to be edited by hand."""\n\n'
    # The formatter would put each number on a line of its own.
    path.write_text(f'{head}# fmt: off\nVERSION = "{version}"\n{body}')
    return version


def _body(model: ShapeModel) -> str:
    parts = [
        _block("FEATURES", [f'"{name}"' for name in NAMES]),
        _numbers("CENTRE", model.centre),
        _numbers("SCALE", model.scale),
        f"CLIP = {model.clip}\n",
        _numbers("SLOPE", model.slope),
        f"INTERCEPT = {model.intercept:.{_DIGITS}g}\n",
        f"NETWORKS = {len(model.out)}\n",
        _numbers("HIDDEN", model.hidden),
        _numbers("HIDDEN_BIAS", model.hidden_bias),
        _numbers("OUT", model.out),
        _numbers("OUT_BIAS", model.out_bias),
        f"CALIBRATION = ({model.calibration[0]:.{_DIGITS}g}, {model.calibration[1]:.{_DIGITS}g})\n",
    ]
    return "".join(parts)


def _numbers(name: str, values: np.ndarray) -> str:
    # Weights of features that stay out are exact zeros; rounding noise around zero is not worth a digit.
    return _block(name, [f"{v:.{_DIGITS}g}" if abs(v) > 1e-5 else "0.0" for v in np.ravel(values)])


def _block(name: str, items: list[str]) -> str:
    lines, line = [], "   "
    for item in items:
        if len(line) + len(item) + 2 > _WIDTH:
            lines.append(line)
            line = "   "
        line += f" {item},"
    return f"{name} = (\n" + "\n".join([*lines, line]) + "\n)\n"
