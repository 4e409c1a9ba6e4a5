//! The flags about messages.

use clap::Args;

use crate::cli::terminal::Verbosity;
use crate::cli::terminal::progress::ProgressKind;

/// How much to say on stderr, and how.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Messages")]
pub(crate) struct MessageArgs {
    /// How to show progress on stderr
    ///
    /// A bar needs a terminal; elsewhere it becomes plain lines.
    #[arg(
        long,
        value_enum,
        value_name = "KIND",
        env = "SMALTI_PROGRESS",
        hide_env_values = true,
        default_value = "auto"
    )]
    pub progress: ProgressKind,
    /// Say more
    #[arg(short, long, conflicts_with = "quiet")]
    pub verbose: bool,
    /// Say nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
}

impl MessageArgs {
    /// How much to say.
    pub(crate) fn verbosity(&self) -> Verbosity {
        match (self.quiet, self.verbose) {
            (true, _) => Verbosity::Quiet,
            (false, true) => Verbosity::Verbose,
            (false, false) => Verbosity::Normal,
        }
    }
}
