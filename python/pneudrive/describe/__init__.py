"""What a drive is: quantities with units, checked, from Python or from TOML."""

from pneudrive.describe.drive import Drive
from pneudrive.describe.friction import Friction, SealPressure, friction_laws
from pneudrive.describe.parts import Ambient, Cylinder, EndStop, Gas, Initial, Load, Spring, Supply, Valve

__all__ = [
    "Ambient",
    "Cylinder",
    "Drive",
    "EndStop",
    "Friction",
    "Gas",
    "Initial",
    "Load",
    "SealPressure",
    "Spring",
    "Supply",
    "Valve",
    "friction_laws",
]
