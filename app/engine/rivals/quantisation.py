"""PV takes only a few values: the loop cycles on the last digit of its transmitter."""

from app.engine.rivals.rival import Rival
from app.engine.rivals.scene import Scene

# Fixed beforehand, not fitted.
_AGAINST_STICTION = 1.0
QUANTUM = 0.6


def quantised_sensor(scene: Scene) -> Rival:
    """PV moves in steps nearly as large as its standard deviation: the loop cycles on the resolution of the sensor.

    Misleads where only the historian rounds, and the controller sees PV as it is.
    """
    quantum = scene.features.named("pv_quantum")
    text = f"the resolution of PV is {quantum:.2g} of its standard deviation"
    strength = min(quantum / (2 * QUANTUM), 1.0)
    return Rival("quantised_sensor", strength, text, _AGAINST_STICTION, statistic=quantum, threshold=QUANTUM)
