"""A closed-loop simulator: any linear plant, controller and valve model, with what disturbs a loop in a plant."""

from app.engine.simulate.actuator import (
    LinearValve,
    OneParameterValve,
    PhysicalActuator,
    StuckValve,
    TwoParameterValve,
    Valve,
)
from app.engine.simulate.compression import Compression, keep, rebuild
from app.engine.simulate.controller import Controller, LinearController, Manual, Pid
from app.engine.simulate.loop import LoopSpec, SimulatedLoop, simulate_loop
from app.engine.simulate.plant import Plant, first_order, integrator, second_order
from app.engine.simulate.signals import Signal, Wave

__all__ = [
    "Compression",
    "Controller",
    "LinearController",
    "LinearValve",
    "LoopSpec",
    "Manual",
    "OneParameterValve",
    "PhysicalActuator",
    "Pid",
    "Plant",
    "Signal",
    "SimulatedLoop",
    "StuckValve",
    "TwoParameterValve",
    "Valve",
    "Wave",
    "first_order",
    "integrator",
    "keep",
    "rebuild",
    "second_order",
    "simulate_loop",
]
