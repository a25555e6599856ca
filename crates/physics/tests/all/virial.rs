//! A gas with a second virial coefficient: its pressure, energy, enthalpy and entropy belong together, without the
//! coefficient it is the ideal gas to the bit, and no state gives what is no number.

use math::Dual;
use physics::chamber::{EnergyBalance, GasState};
use physics::{IdealGas, Virial};

const MOLAR: f64 = 8.314_462_618;
/// R, k, and a, b, c in cm3/mol and K: nitrogen, argon, carbon dioxide.
const GASES: [(f64, f64, [f64; 3]); 3] = [
    (296.80, 1.4, [185.4, 141.8, 88.7]),
    (208.13, 1.667, [154.2, 119.3, 105.1]),
    (188.92, 1.289, [137.6, 87.7, 325.7]),
];

fn gases() -> impl Iterator<Item = (IdealGas<f64>, Virial<f64>)> {
    GASES.into_iter().map(|(r, k, [a, b, c])| {
        let per_kg = 1e-6 * r / MOLAR;
        (IdealGas::new(k, r), Virial { a: a * per_kg, b: b * per_kg, c })
    })
}

/// B by the formula of the table, m3/kg.
fn second(gas: &Virial<f64>, t: f64) -> f64 {
    gas.a - gas.b * (gas.c / t).exp()
}

/// The slope of a function.
fn slope(f: impl Fn(f64) -> f64, at: f64) -> f64 {
    let h = 1e-4 * at;
    (8.0 * (f(at + h) - f(at - h)) - (f(at + 2.0 * h) - f(at - 2.0 * h))) / (12.0 * h)
}

fn near(found: f64, expected: f64, share: f64) {
    assert!((found - expected).abs() <= share * expected.abs(), "{found:e}, not {expected:e}");
}

const STATES: [(f64, f64); 5] = [(1e5, 230.0), (7e5, 293.15), (7e5, 250.0), (1e6, 293.15), (1e6, 400.0)];
const V: f64 = 3e-4;

#[test]
fn pressure_and_temperature_come_back_from_mass_and_energy() {
    for (gas, virial) in gases() {
        for (p, t) in STATES {
            let state = virial.initial(&gas, p, t, V);
            let rho = state[0] / V;
            near(p, rho * gas.gas_constant * t * (1.0 + second(&virial, t) * rho), 1e-13);
            let (found_p, found_t, h) = virial.p_t_h(&gas, state, V);
            // What two Newton steps leave: most where carbon dioxide is cold and dense.
            near(found_t, t, 1e-6);
            near(found_p, p, 1e-6);
            near(h, (state[1] + p * V) / state[0], 1e-6);
            near(virial.enthalpy(&gas, p, t), (state[1] + p * V) / state[0], 1e-12);
        }
    }
}

#[test]
fn carbon_dioxide_of_room_temperature_is_denser_by_what_the_ideal_gas_is_off() {
    let (gas, virial) = gases().nth(2).expect("carbon dioxide");
    for (p, share) in [(7e5, 0.037), (1e6, 0.053)] {
        let ideal = p / (gas.gas_constant * 293.15);
        near(1.0 - ideal / virial.density(&gas, p, 293.15), share, 0.06);
    }
}

#[test]
fn energy_enthalpy_and_entropy_follow_from_one_free_energy() {
    for (gas, virial) in gases() {
        for (p, t) in STATES {
            let rho = virial.density(&gas, p, t);
            let u = |rho: f64, t: f64| {
                let p = rho * gas.gas_constant * t * (1.0 + second(&virial, t) * rho);
                let [m, u] = virial.initial(&gas, p, t, V);
                u / m
            };
            let s = |rho: f64, t: f64| {
                gas.cv * t.ln() - gas.gas_constant * rho.ln() + virial.residual_entropy(&gas, rho, t)
            };
            // T ds = du - p/rho^2 drho, at constant density and at constant temperature.
            near(t * slope(|t| s(rho, t), t), slope(|t| u(rho, t), t), 1e-8);
            near(t * slope(|rho| s(rho, t), rho), slope(|rho| u(rho, t), rho) - p / (rho * rho), 1e-8);
        }
    }
}

#[test]
fn a_throttle_cools_by_the_joule_thomson_coefficient() {
    for (gas, virial) in gases() {
        let (t, drop) = (293.15, 1e3);
        let h = virial.enthalpy(&gas, 1e5, t);
        let after = virial.throttled(&gas, h, t, 1e5 - drop);
        // (T B' - B)/cp at low pressure.
        let expected = (t * slope(|t| second(&virial, t), t) - second(&virial, t)) / gas.cp;
        assert!(expected > 0.0);
        near((t - after) / drop, expected, 0.02);
    }
    // One whose coefficient is a volume of its molecules alone gets warm.
    let (gas, virial) = (IdealGas::new(1.4, 296.8), Virial { a: 1e-3, b: 0.0, c: 1.0 });
    let after = virial.throttled(&gas, virial.enthalpy(&gas, 7e5, 293.15), 293.15, 1e5);
    near(after - 293.15, 6e5 * 1e-3 / gas.cp, 0.02);
}

#[test]
fn without_a_coefficient_it_is_the_ideal_gas_to_the_bit() {
    let (gas, none) = (IdealGas::new(1.4, 287.05), Virial { a: 0.0, b: 0.0, c: 100.0 });
    for (p, t) in STATES {
        let state = EnergyBalance::initial(&gas, p, t, V);
        assert_eq!(none.initial(&gas, p, t, V), state);
        let GasState { p: ideal_p, t: ideal_t, .. } = EnergyBalance::state(&gas, state, V);
        assert_eq!(none.p_t_h(&gas, state, V), (ideal_p, ideal_t, gas.cp * ideal_t));
        assert_eq!(none.enthalpy(&gas, p, t), gas.cp * t);
        assert_eq!(none.residual_entropy(&gas, state[0] / V, t), 0.0);
    }
}

#[test]
fn derivatives_are_those_of_the_values_and_trial_states_have_numbers() {
    for (gas, virial) in gases() {
        let state = virial.initial(&gas, 7e5, 250.0, V);
        let along =
            |value: f64, i: usize| Dual::<f64, 2> { re: value, eps: [0, 1].map(|k| f64::from(k == i)) };
        let (p, t, h) = virial.p_t_h(&gas, [along(state[0], 0), along(state[1], 1)], Dual::from(V));
        for i in 0..2 {
            let of = |part: fn((f64, f64, f64)) -> f64| {
                let moved = |x: f64| if i == 0 { [x, state[1]] } else { [state[0], x] };
                slope(|x| part(virial.p_t_h(&gas, moved(x), V)), state[i])
            };
            near(p.eps[i], of(|state| state.0), 1e-8);
            near(t.eps[i], of(|state| state.1), 1e-8);
            near(h.eps[i], of(|state| state.2), 1e-6);
        }
        for wild in [[state[0], 1e-9], [1e-9, state[1]], [1e3 * state[0], state[1]], [state[0], -state[1]]] {
            let (p, t, h) = virial.p_t_h(&gas, wild, V);
            assert!(p.is_finite() && t.is_finite() && h.is_finite(), "{wild:?}: {p} {t} {h}");
        }
        assert!(virial.density(&gas, 1e9, 200.0).is_finite());
    }
}
