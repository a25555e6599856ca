"""Physical constants and values from standards. A test compares them with the constants of the core."""

#: Standard acceleration of gravity, exact by definition [bipm2019].
STANDARD_GRAVITY_M_S2 = 9.80665

#: Standard atmosphere, exact by definition: default ambient pressure of drives, recordings and rigs.
STANDARD_ATMOSPHERE_PA = 101325.0

#: 0 degrees Celsius, exact by definition [bipm2019].
ZERO_CELSIUS_K = 273.15

#: Standard reference atmosphere (ANR) for air volumes and sonic conductances. At 65 % relative humidity, the density
# differs from p/(R T) of dry air [iso8778-2003], [iso6358-2013].
ANR_PRESSURE_PA = 1.0e5
ANR_TEMPERATURE_K = 293.15
ANR_DENSITY_KG_M3 = 1.185
ANR_LITRES_PER_KG = 1e3 / ANR_DENSITY_KG_M3

#: Dry air, the usual values (assumed).
AIR_HEAT_CAPACITY_RATIO = 1.4
AIR_GAS_CONSTANT_J_KG_K = 287.05

#: Critical pressure ratio of a leak past a seal (assumed): the gap is narrow, unlike an ideal nozzle.
LEAK_CRITICAL_RATIO = 0.2

#: Kinetic energy that the end of a cylinder can absorb, in J per m2 of piston area (assumed): 2 J at a bore of 25 mm.
IMPACT_ENERGY_J_M2 = 4000.0

#: Highest peak gauge pressure in a cylinder whose data sheet states no such limit (assumed): 1.5 times 1.0 MPa, which
# most catalogues give as the highest supply pressure.
USUAL_PEAK_PA = 1.5e6

#: Molar gas constant, exact by definition [bipm2019].
MOLAR_GAS_CONSTANT_J_MOL_K = 8.31446261815324
