//! Tables of a radar's plots: range and azimuth, own ship, turns of the antenna.

pub(crate) mod antenna;
pub(crate) mod columns;
pub(crate) mod options;
pub(crate) mod own_ship;
pub(crate) mod picture;
pub(crate) mod read;
mod turns;
