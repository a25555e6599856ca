//! Contracts of the laws, in one program: their generic code is compiled once.

mod chamber;
mod contact;
mod curve;
mod film_lugre;
mod flow;
mod friction;
mod friction_energy;
mod friction_motion;
mod heat;
mod maxwell_slip;
mod published_hysteresis;
mod rate_and_state;
mod support;
mod virial;
