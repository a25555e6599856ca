"""Descriptions of drives and circuits: quantities with units, checked, from Python or from TOML."""

from __future__ import annotations

from pneudrive.lazy_names import lazily

with lazily(__name__):
    from pneudrive.describe.circuit import Circuit as Circuit
    from pneudrive.describe.components import Component as Component
    from pneudrive.describe.drive import Drive as Drive
    from pneudrive.describe.formulas.law import FrictionLaw as FrictionLaw
    from pneudrive.describe.tables.dependences import SealPressure as SealPressure
    from pneudrive.describe.tables.friction import Friction as Friction
    from pneudrive.describe.tables.friction import friction_laws as friction_laws
    from pneudrive.describe.tables.parts import Ambient as Ambient
    from pneudrive.describe.tables.parts import Cylinder as Cylinder
    from pneudrive.describe.tables.parts import EndStop as EndStop
    from pneudrive.describe.tables.parts import Gas as Gas
    from pneudrive.describe.tables.parts import Initial as Initial
    from pneudrive.describe.tables.parts import Load as Load
    from pneudrive.describe.tables.parts import Spring as Spring
    from pneudrive.describe.tables.parts import Supply as Supply
    from pneudrive.describe.tables.parts import Valve as Valve
