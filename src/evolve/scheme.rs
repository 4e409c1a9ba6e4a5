//! The paper's scheme and its parameters (section 4, Table 2).

/// What happens when no fly with marginal fitness <= 0 is found to die.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum OnDry {
    /// The lower of two random flies dies (the author's later code).
    #[default]
    Fallback,
    /// The run ends; the next restart begins from the best population.
    Restart,
    /// The evolution ends.
    Stop,
}

/// Births of a run unless asked otherwise (Table 2).
pub const PAPER_BIRTHS: u64 = 40_000;

/// Parameters of the paper's scheme: mutation 100 %, no crossover, one death and one birth a generation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PaperScheme {
    /// Names every random number.
    pub seed: u64,
    /// Births of each run.
    pub births: u64,
    /// Runs after the first, each from the best population so far.
    pub restarts: u32,
    /// Factor of the mutation amplitudes at each restart, in 1/65536.
    pub cool_q16: u32,
    /// What to do when no bad fly is left.
    pub on_dry: OnDry,
    /// Ends a run after this many births without a better population.
    pub patience: Option<u64>,
    /// Ends the evolution when the global fitness is at most this.
    pub target_sae: Option<u64>,
    /// Births evaluated together in one generation; 1 is the paper.
    pub batch_births: u32,
}

impl Default for PaperScheme {
    fn default() -> Self {
        Self {
            seed: 0,
            births: PAPER_BIRTHS,
            restarts: 0,
            cool_q16: 1 << 16,
            on_dry: OnDry::default(),
            patience: None,
            target_sae: None,
            batch_births: 1,
        }
    }
}
