//! The `cells` search: a steady-state Fly algorithm in many cells side by side. It uses only integers, so the CPU twin
//! and every device agree.
//!
//! Here are the decisions: which cell holds a fly ([`Grid`]), what children are like ([`operators`]), which colours
//! they take ([`color`]) and what they cost ([`pixel`], [`Penalties`]). The steps themselves are up to each
//! implementation of [`Search`].

pub mod color;
pub mod depths;
pub mod footprint;
pub mod glaze;
pub mod grid;
pub mod leash;
pub mod numbers;
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
pub use search::{Ask, Course, OneLane, Only, Search, SearchLanes, SearchState, Stacks, Standing};
