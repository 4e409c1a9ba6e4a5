//! Compares figures with older ones.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::table::{aligned, head, value};
use super::{Figures, Machine};
use crate::error::{Error, Result};
use crate::photo::why_unreadable;

/// Most bytes of a result file; real ones have a few kB.
const FILE_BYTES_MAX: u64 = 1 << 20;
/// A measurement is marked as slower if its speed is below this share of the older one.
const SLOWER: f64 = 0.95;

/// Reads an older result.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read or holds something else.
pub(super) fn read(path: &Path) -> Result<Figures> {
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(FILE_BYTES_MAX).read_to_end(&mut bytes))
        .map_err(|error| Error::input(path, why_unreadable(&error)))?;
    let foreign = "is not a result of smalti bench --json; name one for --compare";
    let figures: Figures = serde_json::from_slice(&bytes).map_err(|_| Error::input(path, foreign))?;
    if figures.schema != Figures::SCHEMA {
        return Err(Error::input(path, foreign));
    }
    if figures.schema_version != Figures::SCHEMA_VERSION {
        let version = figures.schema_version;
        return Err(Error::input(path, format!("is a result of schema {version}, which this smalti does not know")));
    }
    let Machine { os, architecture, device, driver, .. } = &figures.machine;
    let names = figures.measurements.iter().map(|row| &row.name).chain([&figures.version, os, architecture, device]);
    // A line break in a name could pass for a line of the table.
    if names.chain(driver).any(|name| name.contains(char::is_control)) {
        return Err(Error::input(path, foreign));
    }
    if figures.measurements.iter().any(|row| !(row.value.is_finite() && row.value > 0.0)) {
        return Err(Error::input(path, "holds a value that is not above 0; measure again"));
    }
    Ok(figures)
}

/// Two results.
pub(super) struct Comparison<'a> {
    pub old: &'a Figures,
    pub new: &'a Figures,
}

impl Comparison<'_> {
    /// The comparison as text: a head, what else differs, and each measurement then and now.
    pub(super) fn text(&self) -> String {
        let mut text = head(self.new);
        if self.old.machine != self.new.machine || self.old.version != self.new.version {
            text.push_str(&format!("then: {}", head(self.old)));
        }
        if self.old.picture != self.new.picture {
            text.push_str("then it was another picture: the figures cannot be compared\n");
        }
        text.push_str(&aligned(&self.rows()));
        for lost in self.old.measurements.iter().filter(|row| self.new.measurements.iter().all(|new| !new.is_like(row)))
        {
            text.push_str(&format!("then also {}: {}\n", lost.name, value(lost)));
        }
        text
    }

    fn rows(&self) -> Vec<[String; 4]> {
        let row = |new: &super::Measurement| match self.old.measurements.iter().find(|old| old.is_like(new)) {
            None => [new.name.clone(), value(new), "not then".to_owned(), String::new()],
            Some(old) => {
                let speed_up = new.unit.speed_up(old.value, new.value);
                let mark = if speed_up < SLOWER { "slower" } else { "" };
                let told = format!("{speed_up:.2} times as fast");
                [new.name.clone(), value(new), told, mark.to_owned()]
            }
        };
        self.new.measurements.iter().map(row).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::commands::bench::Machine;
    use crate::cli::commands::bench::measure::{Measurement, Unit};

    fn figures(values: &[(&str, Unit, f64)]) -> Figures {
        let row = |&(name, unit, value): &(&str, Unit, f64)| {
            let name = name.to_owned();
            Measurement { name, unit, value, low: value, high: value, repeats: 1 }
        };
        let [os, architecture, device] = ["linux", "x86_64", "CPU"].map(str::to_owned);
        Figures {
            schema: Figures::SCHEMA.to_owned(),
            schema_version: Figures::SCHEMA_VERSION,
            version: "0.1.0".to_owned(),
            picture: "built-in".to_owned(),
            time_ms: 2_000,
            machine: Machine { os, architecture, cpu_count: 2, threads: 2, device, driver: None },
            measurements: values.iter().map(row).collect(),
        }
    }

    #[test]
    fn what_is_more_than_five_per_cent_slower_is_marked() {
        let old = figures(&[("a", Unit::Ms, 10.0), ("b", Unit::EvalsPerS, 1_000.0), ("gone", Unit::Ms, 7.0)]);
        let new = figures(&[("a", Unit::Ms, 10.5), ("b", Unit::EvalsPerS, 940.0), ("new", Unit::Ms, 1.0)]);
        let expected = "\
            smalti 0.1.0 on CPU, 2 threads on 2 CPUs, linux x86_64; built-in picture\n\
            a         10.50 ms  0.95 times as fast\n\
            b    940.0 evals/s  0.94 times as fast  slower\n\
            new       1.000 ms            not then\n\
            then also gone: 7.000 ms\n";
        assert_eq!(Comparison { old: &old, new: &new }.text(), expected);
    }

    #[test]
    fn another_machine_or_picture_is_told() {
        let old = Figures { picture: "0".repeat(64), version: "0.0.9".to_owned(), ..figures(&[]) };
        let text = Comparison { old: &old, new: &figures(&[]) }.text();
        assert!(text.contains("then: smalti 0.0.9 on CPU"), "{text}");
        assert!(text.contains("another picture"), "{text}");
    }
}
