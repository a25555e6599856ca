"""Descriptions of drives and circuits, from Python or TOML, with checked quantities and units."""

from __future__ import annotations

from pneudrive.lazy_names import lazily

with lazily(__name__):
    from pneudrive.describe.circuit import Circuit as Circuit
    from pneudrive.describe.components import Component as Component
    from pneudrive.describe.drive import Drive as Drive
    from pneudrive.describe.formulas import FrictionLaw as FrictionLaw
    from pneudrive.describe.tables.friction import friction_laws as friction_laws
