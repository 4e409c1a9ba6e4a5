//! The figures as a table for people.

use super::measure::Measurement;
use super::{Figures, Machine};

/// Head and rows.
pub(super) fn table(figures: &Figures) -> String {
    let rows = figures.measurements.iter().map(|row| [row.name.clone(), value(row), spread(row), repeats(row)]);
    head(figures) + &aligned(&rows.collect::<Vec<_>>())
}

/// Which machine and which picture.
pub(super) fn head(figures: &Figures) -> String {
    let Machine { os, architecture, cpu_count, threads, device, driver } = &figures.machine;
    let driver = driver.as_ref().map(|driver| format!(" ({driver})")).unwrap_or_default();
    format!(
        "smalti {} on {device}{driver}, {threads} threads on {cpu_count} CPUs, {os} {architecture}; {} picture\n",
        figures.version,
        if figures.picture == "built-in" { "built-in" } else { "own" },
    )
}

/// A value with its unit, to four significant digits.
pub(super) fn value(row: &Measurement) -> String {
    format!("{} {}", rounded(row.value), row.unit.name())
}

fn spread(row: &Measurement) -> String {
    format!("{} to {}", rounded(row.low), rounded(row.high))
}

fn repeats(row: &Measurement) -> String {
    if row.repeats == 1 { "once".to_owned() } else { format!("{} times", row.repeats) }
}

fn rounded(value: f64) -> String {
    let decimals = if value >= 1_000.0 { 0 } else { (3.0 - value.max(1e-3).log10().floor()) as usize };
    let text = format!("{value:.decimals$}");
    let (whole, fraction) = text.split_once('.').unwrap_or((&text, ""));
    let mut grouped = String::new();
    for (place, digit) in whole.chars().enumerate() {
        if place > 0 && (whole.len() - place).is_multiple_of(3) {
            grouped.push(',');
        }
        grouped.push(digit);
    }
    if fraction.is_empty() { grouped } else { format!("{grouped}.{fraction}") }
}

/// Rows with the first column to the left and the others to the right.
pub(super) fn aligned<const COLUMNS: usize>(rows: &[[String; COLUMNS]]) -> String {
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or_default();
    let widths: [usize; COLUMNS] = std::array::from_fn(width);
    let line = |row: &[String; COLUMNS]| {
        let cells = row.iter().zip(widths).enumerate().map(|(column, (cell, width))| match column {
            0 => format!("{cell:<width$}"),
            _ => format!("  {cell:>width$}"),
        });
        cells.collect::<String>().trim_end().to_owned() + "\n"
    };
    rows.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_have_four_digits_that_count_and_thousands_apart() {
        let told = [1_234_567.8, 1_000.0, 999.94, 12.344, 1.0, 0.012_346, 0.0].map(rounded);
        assert_eq!(told, ["1,234,568", "1,000", "999.9", "12.34", "1.000", "0.01235", "0.000000"]);
    }
}
