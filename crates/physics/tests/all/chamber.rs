//! Energy of a chamber: what flows in as enthalpy, work of the piston and heat are in the gas
//! afterwards, and pressure and temperature follow as in the textbook. The equations as printed in
//! the source paper are solved as printed, and lose or create half of the piston's work.

use math::Dual;
use physics::IdealGas;
use physics::chamber::{AsPrinted, EnergyBalance, Exchange, GasState};

fn gas() -> IdealGas<f64> {
    IdealGas::new(K, R)
}

const K: f64 = 1.4;
const R: f64 = 287.05;
const P: f64 = 5e5;
const T: f64 = 310.0;
const V: f64 = 2e-4;

const NOTHING: Exchange<f64> = Exchange { m_dot: 0.0, h_dot: 0.0, volume: V, volume_rate: 0.0, heat: 0.0 };

/// cp T of a flow.
fn enthalpy(m_dot: f64, t: f64) -> f64 {
    m_dot * K * R / (K - 1.0) * t
}

/// (dp/dt, dT/dt) of the energy balance: the chain rule from (m, U, V) by duals.
fn balance(x: &Exchange<f64>) -> [f64; 2] {
    let state = EnergyBalance::initial(&gas(), P, T, V);
    let rate = EnergyBalance::rate(P, x);
    let along = |re: f64, eps: f64| Dual::<f64, 1> { re, eps: [eps] };
    let dual = [along(state[0], rate[0]), along(state[1], rate[1])];
    let GasState { p, t, .. } = EnergyBalance::state(&gas(), dual, along(V, x.volume_rate));
    assert!((p.re / P - 1.0).abs() < 1e-14 && (t.re / T - 1.0).abs() < 1e-14);
    [p.eps[0], t.eps[0]]
}

fn printed(x: &Exchange<f64>) -> [f64; 2] {
    AsPrinted::rate(&gas(), P, T, x)
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-12 * a.abs().max(b.abs())
}

/// dU/dt of an ideal gas in volume V from its pressure, W.
fn energy_rate(p_dot: f64, x: &Exchange<f64>) -> f64 {
    (p_dot * V + P * x.volume_rate) / (K - 1.0)
}

#[test]
fn compression_without_heat_is_adiabatic() {
    let x = Exchange { volume_rate: -3e-4, ..NOTHING };
    let [p_dot, t_dot] = balance(&x);
    // p V^k and T V^(k-1) are constant: compression heats.
    assert!(close(p_dot, K * P * 3e-4 / V));
    assert!(close(t_dot, (K - 1.0) * T * 3e-4 / V));
}

#[test]
fn gas_that_enters_brings_its_enthalpy() {
    for t_in in [250.0, 310.0, 400.0] {
        let x = Exchange { m_dot: 0.01, h_dot: enthalpy(0.01, t_in), ..NOTHING };
        let [p_dot, t_dot] = balance(&x);
        assert!(close(p_dot, K * R * t_in * 0.01 / V));
        // m cv dT/dt = m_dot (cp T_in - cv T): it heats even at equal temperature.
        let m = P * V / (R * T);
        assert!(close(t_dot, 0.01 * (K * t_in - T) / m));
    }
}

#[test]
fn gas_that_leaves_cools_what_stays() {
    let x = Exchange { m_dot: -0.01, h_dot: enthalpy(-0.01, T), ..NOTHING };
    let [p_dot, t_dot] = balance(&x);
    assert!(close(p_dot / P, -K * 0.01 * R * T / (P * V)));
    // T p^((1-k)/k) is constant.
    assert!(close(t_dot / T, (K - 1.0) / K * p_dot / P));
}

#[test]
fn heat_goes_into_the_gas() {
    let x = Exchange { heat: 50.0, ..NOTHING };
    let [p_dot, t_dot] = balance(&x);
    assert!(close(p_dot, (K - 1.0) * 50.0 / V));
    assert!(close(t_dot, 50.0 / (P * V / (R * T) * R / (K - 1.0))));
}

#[test]
fn the_wall_heats_colder_gas() {
    assert!(close(physics::heat::newton(30.0, 0.02, 293.15, 253.15), 24.0));
    assert!(physics::heat::newton(30.0, 0.02, 293.15, 333.15) < 0.0);
}

#[test]
fn as_printed_solves_both_printed_equations_at_once() {
    let (m_in, t_in, m_out, v_dot, q) = (0.012, 290.0, 0.004, -2e-4, 35.0);
    let x = Exchange {
        m_dot: m_in - m_out,
        h_dot: enthalpy(m_in, t_in) - enthalpy(m_out, T),
        volume: V,
        volume_rate: v_dot,
        heat: q,
    };
    let [p_dot, t_dot] = printed(&x);
    let second = K * R * (t_in * m_in - T * m_out) - K * P * v_dot - P * V / T * t_dot + (K - 1.0) * q;
    assert!(close(V * p_dot, second), "equation (2): {} {second}", V * p_dot);
    let third = T * (p_dot / P + v_dot / V - (m_in - m_out) * R * T / (P * V));
    assert!(close(t_dot, third), "equation (3): {t_dot} {third}");
}

#[test]
fn as_printed_is_a_polytrope_of_1_2_with_half_the_heat() {
    let x = Exchange { volume_rate: -3e-4, ..NOTHING };
    assert!(close(printed(&x)[0], 0.5 * (K + 1.0) * P * 3e-4 / V));
    let x = Exchange { heat: 50.0, ..NOTHING };
    assert!(close(printed(&x)[0], 0.5 * balance(&x)[0]));
}

#[test]
fn energy_is_conserved_but_not_as_printed() {
    let x =
        Exchange { m_dot: 0.01, h_dot: enthalpy(0.01, 280.0), volume_rate: -3e-4, heat: -20.0, ..NOTHING };
    let supplied = x.h_dot - P * x.volume_rate + x.heat;
    assert!(close(energy_rate(balance(&x)[0], &x), supplied));
    // A closed compression as printed: half of the piston's work is lost.
    let x = Exchange { volume_rate: -3e-4, ..NOTHING };
    let lost = -P * x.volume_rate - energy_rate(printed(&x)[0], &x);
    assert!(close(lost, 0.5 * P * 3e-4), "{lost}");
}

#[test]
fn specific_heats_are_those_of_the_gas() {
    assert!(close(gas().cp - gas().cv, R) && close(gas().cp / gas().cv, K));
}
