//! Whether the work fits into the memory that is free.

use crate::error::{Error, Remedy, Result};
use crate::memory::free_bytes;

/// The bytes that a batch may use: four fifths of what is free now, or any number if that is unknown.
pub(crate) fn share_of_free() -> u64 {
    free_bytes().map_or(u64::MAX, |bytes| bytes / 5 * 4)
}

/// Refuses work that needs more memory than is free. Where the free memory is unknown, it allows everything.
///
/// # Errors
/// [`Error::TooLarge`].
pub(crate) fn check(needed_bytes: u64) -> Result<()> {
    check_against(needed_bytes, free_bytes())
}

fn check_against(needed_bytes: u64, available_bytes: Option<u64>) -> Result<()> {
    match available_bytes {
        Some(available_bytes) if needed_bytes > available_bytes => Err(Error::TooLarge {
            what: format!(
                "this needs about {} MiB of memory and {} MiB are free",
                needed_bytes >> 20,
                available_bytes >> 20
            ),
            remedies: &[Remedy::SmallerPicture, Remedy::SmallerOutput, Remedy::FewerTiles],
        }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_than_the_free_memory_is_refused_with_both_numbers() {
        assert!(check_against(1 << 30, Some(1 << 30)).is_ok());
        assert!(check_against(1 << 60, None).is_ok());
        let refusal = check_against(3 << 30, Some(1 << 30)).expect_err("there is not enough").to_string();
        assert!(refusal.contains("3072 MiB") && refusal.contains("1024 MiB"), "{refusal}");
    }
}
