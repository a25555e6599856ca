"""Descriptions of drives and circuits: quantities with units, checked, from Python or from TOML."""

from __future__ import annotations

from pneudrive.lazy_names import lazily

with lazily(__name__):
    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.components import Component
    from pneudrive.describe.drive import Drive
    from pneudrive.describe.formulas.law import FrictionLaw
    from pneudrive.describe.kinds import component_kinds
    from pneudrive.describe.tables.dependences import (
        DirectionDependence,
        Dwell,
        Harmonic,
        PositionDependence,
        Relaxation,
        SealPressure,
        SideLoad,
    )
    from pneudrive.describe.tables.friction import Friction, friction_laws
    from pneudrive.describe.tables.parts import Ambient, Cylinder, EndStop, Gas, Initial, Load, Spring, Supply, Valve

__all__ = [
    "Ambient",
    "Circuit",
    "Component",
    "Cylinder",
    "DirectionDependence",
    "Drive",
    "Dwell",
    "EndStop",
    "Friction",
    "FrictionLaw",
    "Gas",
    "Harmonic",
    "Initial",
    "Load",
    "PositionDependence",
    "Relaxation",
    "SealPressure",
    "SideLoad",
    "Spring",
    "Supply",
    "Valve",
    "component_kinds",
    "friction_laws",
]
