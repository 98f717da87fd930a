"""Valve models: OP in, stem position out. One step function each, for the grid and the closed-loop simulator;
he_stems and kano_stems move many valves abreast.
"""

from app.engine.valve.abreast import he_stems, kano_stems
from app.engine.valve.choudhury import choudhury_start, choudhury_stem, choudhury_step, two_parameter_choudhury
from app.engine.valve.he import he_stem, he_step, two_parameter_he
from app.engine.valve.kano import kano_start, kano_step, two_parameter_kano
from app.engine.valve.one_parameter import one_parameter, one_parameter_step
from app.engine.valve.physical import CLASSIC, PACKED, PhysicalValve, physical_step

__all__ = [
    "CLASSIC",
    "PACKED",
    "PhysicalValve",
    "choudhury_start",
    "choudhury_stem",
    "choudhury_step",
    "he_stem",
    "he_stems",
    "he_step",
    "kano_start",
    "kano_stems",
    "kano_step",
    "one_parameter",
    "one_parameter_step",
    "physical_step",
    "two_parameter_choudhury",
    "two_parameter_he",
    "two_parameter_kano",
]
