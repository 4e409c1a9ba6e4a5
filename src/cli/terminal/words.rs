//! Numbers and endings in the words of people.

use indicatif::HumanCount;

/// So many things: "1 tile", "5,000 tiles".
pub(crate) fn counted(count: u64, thing: &str) -> String {
    format!("{} {thing}{}", HumanCount(count), if count == 1 { "" } else { "s" })
}

/// Why an evolution ended, as a clause after "ended", by the word for it in rows and metadata.
pub(crate) fn why_ended(stop: &str) -> &str {
    match stop {
        "evals" => "when all evals were spent",
        "births" => "when all births were made",
        "patience" => "when there was no more progress",
        "dry" => "when nothing could be changed any more",
        "target-sae" => "when the error asked for was reached",
        "time" => "when the time was up",
        "interrupted" => "early, when it was interrupted",
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evolve::StopReason;

    #[test]
    fn one_thing_is_no_plural() {
        let told = [0, 1, 2, 5_000].map(|count| counted(count, "tile"));
        assert_eq!(told, ["0 tiles", "1 tile", "2 tiles", "5,000 tiles"]);
    }

    #[test]
    fn every_ending_is_told_in_a_clause() {
        use StopReason::{Births, Dry, Evals, Interrupted, Patience, TargetSae, Time};
        for stop in [Births, Evals, Patience, Dry, TargetSae, Time, Interrupted] {
            assert!(why_ended(stop.word()).contains("when"), "{stop:?}");
        }
    }
}
