//! The air that a run draws, from the accounts of its circuit.

use circuit::{Kind, Session};

/// Mass from the reservoirs since the start, kg: of each path over the boundary that which came in, so that what leaves
/// through an exhaust does not count. The circuit must keep its accounts.
pub fn drawn(session: &Session) -> f64 {
    let channels = session.circuit().channels();
    let accounts = &session.state()[session.state().len() - channels.len()..];
    let masses = channels.iter().zip(accounts).filter(|(channel, _)| channel.kind == Kind::Mass);
    masses.map(|(_, mass)| mass.max(0.0)).sum()
}
