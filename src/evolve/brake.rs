//! What ends the work between two looks of its observers: in the middle of a round, from any thread.

use std::fmt;
use std::sync::Arc;

use super::evolution::StopReason;

type Question = Arc<dyn Fn() -> Option<StopReason> + Send + Sync>;

/// Asks whether the work is to end at once, and why. By default it never is.
///
/// It is asked thousands of times a second, as often as it happens to be. So an answer must not depend on how often:
/// once there is a reason, it stays.
#[derive(Clone, Default)]
pub struct Brake(Vec<Question>);

impl Brake {
    /// A brake that asks this.
    pub fn new(question: impl Fn() -> Option<StopReason> + Send + Sync + 'static) -> Self {
        Self(vec![Arc::new(question)])
    }

    /// This brake and another one. If both know a reason, that of this one counts.
    #[must_use]
    pub fn and(mut self, other: Self) -> Self {
        self.0.extend(other.0);
        self
    }

    /// Whether it never ends anything.
    #[must_use]
    pub fn is_absent(&self) -> bool {
        self.0.is_empty()
    }

    /// Why the work is to end, if it is.
    #[must_use]
    pub fn reason(&self) -> Option<StopReason> {
        self.0.iter().find_map(|question| question())
    }
}

impl fmt::Debug for Brake {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_tuple("Brake").field(&self.0.len()).finish()
    }
}
