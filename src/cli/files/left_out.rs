//! The files of folders that are not taken for pictures, by what they are.

use std::collections::BTreeMap;
use std::path::Path;

use crate::photo::{self, Kind};

/// What pictures are called whose names do not say so.
const MISNAMED: (&str, &str) = ("pictures without the ending of one", "give their names an ending such as .png");
/// What everything else is called.
const NO_PICTURES: &str = "that are no pictures";

/// How many files of which kind were left out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct LeftOut {
    /// By the name of the kind, with what to do about it.
    of_kinds: BTreeMap<&'static str, (usize, &'static str)>,
    others: usize,
}

impl LeftOut {
    /// Counts a file, told by its content.
    pub(crate) fn note(&mut self, path: &Path) {
        // A pipe would be waited for.
        let is_file = path.metadata().is_ok_and(|found| found.is_file());
        let (name, advice) = match photo::kind_of_file(path).ok().filter(|_| is_file) {
            Some(Kind::Foreign(foreign)) => (foreign.name, foreign.advice),
            Some(Kind::Read(_)) => MISNAMED,
            Some(Kind::Other) | None => {
                self.others += 1;
                return;
            }
        };
        self.of_kinds.entry(name).or_insert((0, advice)).0 += 1;
    }

    /// How many files there are of which kind, and what to do about them; `None` if there are none.
    pub(crate) fn told(&self) -> Option<String> {
        let of_kind = |(name, (count, advice)): (&&str, &(usize, &str))| {
            let name = name.strip_prefix("a ").or(name.strip_prefix("an ")).unwrap_or(name);
            format!("{count} {name} ({advice})")
        };
        let others = (self.others > 0).then(|| format!("{} {NO_PICTURES}", self.others));
        let parts: Vec<String> = self.of_kinds.iter().map(of_kind).chain(others).collect();
        (!parts.is_empty()).then(|| parts.join(", "))
    }

    /// The sentence about files that were left out beside others that were not.
    pub(crate) fn sentence(&self) -> Option<String> {
        let count = self.of_kinds.values().map(|(count, _)| count).sum::<usize>() + self.others;
        let files = if count == 1 { "file is" } else { "files are" };
        self.told().map(|told| format!("{count} {files} left out: {told}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_counted_by_what_they_are_and_not_by_their_names() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut left_out = LeftOut::default();
        assert_eq!(left_out.sentence(), None);
        for (name, bytes) in [
            ("a.heic", &b"\0\0\0\x18ftypheic\0\0\0\0mif1heic"[..]),
            ("b", b"\0\0\0\x18ftypheic\0\0\0\0mif1heic"),
            ("c.txt", b"\x89PNG\r\n\x1a\n"),
            ("d.heic", b"hello"),
            ("e.mp4", b"\0\0\0\x10ftypisom\0\0\0\0"),
        ] {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).expect("the folder is ours");
            left_out.note(&path);
        }
        let sentence = left_out.sentence().expect("there are some");
        assert!(sentence.starts_with("5 files are left out: 2 HEIC (convert it first"), "{sentence}");
        assert!(sentence.contains("1 video (MP4 or QuickTime)"), "{sentence}");
        assert!(sentence.contains("1 pictures without the ending of one (give"), "{sentence}");
        assert!(sentence.ends_with("1 that are no pictures"), "{sentence}");
    }
}
