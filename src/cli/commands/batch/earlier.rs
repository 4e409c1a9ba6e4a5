//! What the rows of earlier runs tell of results that are up to date: the figures that their files do not tell.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use serde::Deserialize;

use crate::cli::jobs::row::Figures;
use crate::cli::list::rows::ROW_BYTES_MAX;

/// The figures of earlier results, by id; each with the key of its result.
#[derive(Debug, Default)]
pub(super) struct Earlier {
    by_id: HashMap<String, (String, Figures)>,
}

/// A row as far as it is looked at.
#[derive(Deserialize)]
struct EarlierRow {
    id: String,
    status: String,
    key: Option<String>,
    #[serde(flatten)]
    figures: Figures,
}

impl Earlier {
    /// Reads the rows of a file. What cannot be read is not known.
    pub(super) fn read(path: &Path) -> Self {
        let mut earlier = Self::default();
        // Rows may also go into a pipe, from which nothing comes back.
        let Some(file) = File::open(path).ok().filter(|_| path.is_file()) else { return earlier };
        let mut reader = BufReader::new(file);
        let mut line = Vec::new();
        while let Ok(1..) = reader.by_ref().take(ROW_BYTES_MAX).read_until(b'\n', &mut line) {
            let row = serde_json::from_slice::<EarlierRow>(&line);
            line.clear();
            let Ok(EarlierRow { id, status, key: Some(key), figures }) = row else { continue };
            if ["complete", "unchanged"].contains(&status.as_str()) {
                earlier.by_id.insert(id, (key, figures));
            }
        }
        earlier
    }

    /// The figures of the result with this key, if an earlier row of the picture has them.
    pub(super) fn figures(&self, id: &str, key: Option<&str>) -> Option<Figures> {
        self.by_id.get(id).filter(|(known, _)| Some(known.as_str()) == key).map(|(_, figures)| figures.clone())
    }
}
