//! `--name`: what the outputs of a batch are called.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// What a placeholder stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    /// The input's name without its ending.
    Stem,
    /// The input's ending.
    Suffix,
    /// The input's folder, relative to the named one.
    Dir,
    /// The id of the picture.
    Id,
    /// Its group, or nothing.
    Group,
    /// Its number in the batch, from 1.
    Index,
    Seed,
    /// The ending of the output's format.
    Ext,
}

const PARTS: [(&str, Part); 8] = [
    ("stem", Part::Stem),
    ("suffix", Part::Suffix),
    ("dir", Part::Dir),
    ("id", Part::Id),
    ("group", Part::Group),
    ("index", Part::Index),
    ("seed", Part::Seed),
    ("ext", Part::Ext),
];

/// A name with placeholders.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct NameTemplate {
    pieces: Vec<Piece>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Piece {
    Text(String),
    Part(Part),
}

/// What is known about a picture when its outputs get their names.
pub(crate) struct Known<'a> {
    /// The input, relative to the named folder.
    pub relative: &'a Path,
    pub id: &'a str,
    pub group: Option<&'a str>,
    /// The number of the picture in the batch, from 0.
    pub index: usize,
    pub seed: u64,
}

/// A name such as `{dir}/{stem}-{seed}.{ext}`.
pub(crate) fn parse(text: &str) -> Result<NameTemplate, String> {
    let all = || PARTS.map(|(name, _)| format!("{{{name}}}")).join(" ");
    let mut pieces = Vec::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once('{') {
        pieces.push(Piece::Text(before.to_owned()));
        let (name, after) = after.split_once('}').ok_or_else(|| format!("a {{ without its }}; there are {}", all()))?;
        let part = PARTS.iter().find(|(known, _)| *known == name);
        let (_, part) = part.ok_or_else(|| format!("no placeholder is called {{{name}}}; there are {}", all()))?;
        pieces.push(Piece::Part(*part));
        rest = after;
    }
    pieces.push(Piece::Text(rest.to_owned()));
    pieces.retain(|piece| *piece != Piece::Text(String::new()));
    let ends_in_format = pieces.last() == Some(&Piece::Part(Part::Ext));
    if !ends_in_format || !matches!(pieces.iter().rev().nth(1), Some(Piece::Text(text)) if text.ends_with('.')) {
        return Err("expected a name that ends in .{ext}, such as {stem}.{ext}".to_owned());
    }
    Ok(NameTemplate { pieces })
}

impl NameTemplate {
    /// The name of the output that ends in `ext`, relative to the output folder.
    pub(crate) fn path(&self, known: &Known<'_>, ext: &str) -> PathBuf {
        let text = |name: Option<&OsStr>| spelt(name.unwrap_or_default());
        let spelt = self.pieces.iter().map(|piece| match piece {
            Piece::Text(text) => text.clone(),
            Piece::Part(Part::Stem) => text(known.relative.file_stem()),
            Piece::Part(Part::Suffix) => text(known.relative.extension()),
            Piece::Part(Part::Dir) => {
                let folder = text(known.relative.parent().map(Path::as_os_str));
                if folder.is_empty() { ".".to_owned() } else { folder }
            }
            Piece::Part(Part::Id) => known.id.to_owned(),
            Piece::Part(Part::Group) => known.group.unwrap_or_default().to_owned(),
            Piece::Part(Part::Index) => (known.index + 1).to_string(),
            Piece::Part(Part::Seed) => known.seed.to_string(),
            Piece::Part(Part::Ext) => ext.to_owned(),
        });
        // Collecting the components drops `.` folders.
        Path::new(&spelt.collect::<String>()).components().filter(|part| part.as_os_str() != ".").collect()
    }
}

/// A name as text. Each byte that is not text becomes `%` and two digits.
pub(crate) fn spelt(name: &OsStr) -> String {
    let mut text = String::new();
    for chunk in name.as_encoded_bytes().utf8_chunks() {
        text.push_str(chunk.valid());
        chunk.invalid().iter().for_each(|byte| text.push_str(&format!("%{byte:02X}")));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn placeholders_are_filled_in() {
        let known = Known { relative: Path::new("trip/p 1.JPG"), id: "trip/p 1", group: Some("g"), index: 4, seed: 9 };
        let name = |text: &str| parse(text).expect("it is a name").path(&known, "svg");
        assert_eq!(name("{dir}/{stem}.{ext}"), Path::new("trip/p 1.svg"));
        assert_eq!(name("{group}/{index}-{stem}-{suffix}-{seed}.{ext}"), Path::new("g/5-p 1-JPG-9.svg"));
        assert_eq!(name("{id}.{ext}"), Path::new("trip/p 1.svg"));
        let flat = Known { relative: Path::new("a.png"), id: "a", group: None, index: 0, seed: 0 };
        assert_eq!(parse("{dir}/{stem}.{ext}").expect("it is a name").path(&flat, "png"), Path::new("a.png"));
    }

    #[test]
    fn a_name_must_end_in_its_format_and_know_its_placeholders() {
        for text in ["{stem}", "{stem}.png", "{stem}{ext}", "{name}.{ext}", "{stem.{ext}", ""] {
            assert!(parse(text).is_err(), "{text}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn names_that_are_no_text_stay_apart() {
        use std::os::unix::ffi::OsStrExt;
        let name = |bytes: &[u8]| {
            let known = Known { relative: Path::new(OsStr::from_bytes(bytes)), id: "", group: None, index: 0, seed: 0 };
            parse("{dir}/{stem}.{ext}").expect("it is a name").path(&known, "png").display().to_string()
        };
        assert_eq!(name(b"caf\xE9/a\xFF.jpg"), "caf%E9/a%FF.png");
        assert_eq!(name("caf\u{e9}.jpg".as_bytes()), "caf\u{e9}.png");
    }
}
