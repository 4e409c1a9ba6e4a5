//! The `cells` search: a steady-state Fly algorithm in many cells side by side, in integers that the CPU twin and every
//! device share.
//!
//! What is decided here: which cell holds a fly ([`Grid`]), what children are like ([`operators`]), what their colours are
//! ([`color`]) and what they cost ([`pixel`], [`Penalties`]). Who goes through the steps is for an evaluator to say.

pub mod color;
pub mod depths;
pub mod footprint;
pub mod glaze;
pub mod grid;
pub mod leash;
pub mod operators;
pub mod pixel;
pub mod random;
pub mod rules;
pub mod search;
pub mod suit;

pub use footprint::Footprint;
pub use grid::{Grid, NO_CELL};
pub use random::{Chain, Draw};
pub use rules::{Penalties, Rules};
pub use search::{Course, OneLane, Search, SearchLanes, SearchState, Stacks, Standing};
