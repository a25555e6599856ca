"""Physical constants and numbers of standards; a test compares them with those of the core."""

#: Standard acceleration of gravity, exact by definition [bipm2019].
STANDARD_GRAVITY_M_S2 = 9.80665

#: Standard atmosphere, exact by definition: default surroundings of drives, recordings and rigs.
STANDARD_ATMOSPHERE_PA = 101325.0

#: 0 degrees Celsius, exact by definition [bipm2019].
ZERO_CELSIUS_K = 273.15

#: Standard reference atmosphere (ANR) of air volumes and sonic conductances. At 65 % relative humidity, the density
# differs from p/(R T) of dry air [iso8778-2003], [iso6358-2013].
ANR_PRESSURE_PA = 1.0e5
ANR_TEMPERATURE_K = 293.15
ANR_DENSITY_KG_M3 = 1.185
ANR_LITRES_PER_KG = 1e3 / ANR_DENSITY_KG_M3

#: Dry air, the usual values (assumed).
AIR_HEAT_CAPACITY_RATIO = 1.4
AIR_GAS_CONSTANT_J_KG_K = 287.05

#: Critical pressure ratio of a leak past a seal, a narrow gap unlike an ideal nozzle (assumed).
LEAK_CRITICAL_RATIO = 0.2

#: Kinetic energy that a cylinder absorbs at its end, J for each m2 of piston (assumed): 2 J at a bore of 25 mm.
IMPACT_ENERGY_J_M2 = 4000.0

#: Highest peak pressure in a cylinder whose data sheet states none, above ambient (assumed): 1.5 times the 1.0 MPa that
# most catalogues give as the highest supply pressure.
USUAL_PEAK_PA = 1.5e6

#: Molar gas constant, exact by definition [bipm2019].
MOLAR_GAS_CONSTANT_J_MOL_K = 8.31446261815324
