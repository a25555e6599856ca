//! Flow paths: what passes them, and the accounts of that.

use super::{
    Common,
    volume::{log, specific_entropy},
};
use crate::circuit::GasId;
use crate::ledger::Kind;
use crate::net::Net;
use math::{Over, Real};

/// The ends of a flow path. Gas passes it without a change of enthalpy, and arrives with the temperature of where it
/// comes from.
#[derive(Clone, Copy, Debug)]
pub struct Between {
    pub from: GasId,
    pub to: GasId,
    /// An end is a reservoir: what passes it crosses the boundary.
    pub(crate) boundary: [bool; 2],
}

/// Takes mass, kg/s, with the enthalpy of where it comes from, and gives it to the other end; a boundary keeps no account.
#[inline(always)]
pub(crate) fn post<S: Real>(net: &mut Net<S>, path: Between, (m_dot, backward): (S, S::Mask)) {
    let Between { from, to, boundary } = path;
    let (one, two) = (&net.gas[from.0], &net.gas[to.0]);
    let h_dot = m_dot * (net.cp * S::select(backward, two.t, one.t));
    if !boundary[0] {
        let one = &mut net.gas[from.0];
        one.m_dot -= m_dot;
        one.h_dot -= h_dot;
    }
    if !boundary[1] {
        let two = &mut net.gas[to.0];
        two.m_dot += m_dot;
        two.h_dot += h_dot;
    }
}

/// Accounts of a flow path.
pub(super) const CHANNELS: [(&str, Kind); 5] = [
    ("mass over the boundary", Kind::Mass),
    ("enthalpy over the boundary", Kind::Energy),
    ("entropy over the boundary", Kind::EntropyIn),
    ("throttling", Kind::EntropyOfGas),
    ("mixing", Kind::EntropyOfGas),
];

/// Rates of the accounts of a flow path with a mass flow, and where it goes backward.
pub(super) fn throttling<P: Real, S: Over<P>>(
    net: &Net<S>,
    path: Between,
    (m_dot, backward): (S, S::Mask),
    common: &Common<P>,
    out: &mut [S],
) {
    let Between { from, to, boundary: [from_boundary, to_boundary] } = path;
    let (one, two) = (&net[from], &net[to]);
    let t_up = S::select(backward, two.t, one.t);
    let h_dot = m_dot * S::from(common.gas.cp) * t_up;
    let zero = S::zero();
    let sign = |boundary: bool, s: S| if boundary { s } else { zero };
    // Into the circuit: out of a reservoir at `from`, or back from one at `to`.
    let one_in = |flow: S| sign(from_boundary, flow) - sign(to_boundary, flow);
    let carried =
        |boundary: bool, p: S| if boundary { m_dot * specific_entropy(t_up, p, common) } else { zero };
    out[0] = one_in(m_dot);
    out[1] = one_in(h_dot);
    out[2] = carried(from_boundary, one.p) - carried(to_boundary, two.p);
    out[3] = m_dot * S::from(common.gas.gas_constant) * log(one.p / two.p);
    let receiver = S::select(backward, one.t, two.t);
    let ratio = t_up / receiver;
    let mixing = m_dot.abs() * S::from(common.gas.cp) * (ratio - S::one() - log(ratio));
    let into_forward = if to_boundary { zero } else { mixing };
    let into_backward = if from_boundary { zero } else { mixing };
    out[4] = S::select(backward, into_backward, into_forward);
}

/// A part of circuits: numbers, one in each lane; laws with numbers of their own; and what is the same in all lanes.
macro_rules! gathered {
    ($(#[$attribute:meta])* pub struct $name:ident {
        numbers { $($(#[$number_attribute:meta])* $number:ident),* $(,)? }
        laws { $($law:ident: $law_type:ident),* $(,)? }
        same { $($(#[$same_attribute:meta])* $same:ident: $same_type:ty),* $(,)? }
    }) => {
        $(#[$attribute])*
        #[derive(Clone, Debug)]
        pub struct $name<P> {
            $($(#[$number_attribute])* pub $number: P,)*
            $(pub $law: $law_type<P>,)*
            $($(#[$same_attribute])* pub $same: $same_type,)*
        }

        impl<R: math::Lane> $name<R> {
            /// Lane `i` takes the numbers of `each[i]`.
            pub fn gather(each: &[&$name<f64>]) -> Self {
                $name {
                    $($number: R::from_lanes(|lane| each[lane].$number),)*
                    $($law: $law_type::gather(&each.iter().map(|part| &part.$law).collect::<Vec<_>>()),)*
                    $($same: each[0].$same.clone(),)*
                }
            }
        }
    };
}
pub(super) use gathered;

/// How far beyond it an event at a pressure may be taken, Pa: far below what any step resolves.
pub(super) const PRESSURE_TOLERANCE: f64 = 1e-3;

/// A share between zero and one.
#[inline(always)]
pub(super) fn clip<S: Real>(share: S) -> S {
    share.max(S::zero()).min(S::one())
}
