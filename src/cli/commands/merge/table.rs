//! Merged rows as CSV, and the summary table.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Map, Value};

use crate::cli::list::rows::ResultRow;
use crate::cli::values::table_cell;
use crate::error::{Error, Result};

/// The fields of a row, in order.
const COLUMNS: [&str; 28] = [
    "id",
    "input",
    "status",
    "stop",
    "output",
    "key",
    "seed",
    "scheme",
    "sae",
    "objective",
    "psnr",
    "spread",
    "tiles",
    "living",
    "births",
    "births_in_last_run",
    "evals",
    "fallback_kills",
    "restarts",
    "load_ms",
    "evolve_ms",
    "save_ms",
    "ended_at",
    "device",
    "shard",
    "host",
    "version",
    "error",
];

/// The rows as a table with a heading. A null stays empty, and several outputs are separated by `;`.
pub(super) fn csv(rows: &[ResultRow]) -> Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let mut write = || -> Result<(), csv::Error> {
        writer.write_record(COLUMNS)?;
        for row in rows {
            let fields: Map<String, Value> = serde_json::from_str(&row.line).unwrap_or_default();
            writer.write_record(COLUMNS.map(|column| fields.get(column).map(cell).unwrap_or_default()))?;
        }
        Ok(())
    };
    write().map_err(|error| Error::Internal(format!("no CSV: {error}")))?;
    writer.into_inner().map_err(|error| Error::Internal(format!("no CSV: {error}")))
}

/// Whether a line is the heading of a table of rows.
pub(super) fn is_heading(line: &str) -> bool {
    line == COLUMNS.join(",")
}

fn cell(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::String(text) => table_cell(text).into_owned(),
        Value::Array(parts) => table_cell(&parts.iter().map(part).collect::<Vec<_>>().join(";")).into_owned(),
        other => other.to_string(),
    }
}

/// One of several values in a cell.
fn part(value: &Value) -> String {
    value.as_str().map_or_else(|| cell(value), str::to_owned)
}

/// What one shard did.
#[derive(Default)]
struct Part<'a> {
    row_count: usize,
    count_by_status: BTreeMap<&'a str, usize>,
    evolve_ms: f64,
}

impl<'a> Part<'a> {
    fn add(&mut self, row: &'a ResultRow) {
        self.row_count += 1;
        *self.count_by_status.entry(&row.told.status).or_default() += 1;
        self.evolve_ms += row.told.evolve_ms;
    }

    fn cells(&self, name: &str, statuses: &BTreeSet<&str>) -> Vec<String> {
        let counts = statuses.iter().map(|status| self.count_by_status.get(status).copied().unwrap_or(0).to_string());
        let time = format!("{:.1}", self.evolve_ms / 1e3);
        [name.to_owned(), self.row_count.to_string()].into_iter().chain(counts).chain([time]).collect()
    }
}

/// A line for each shard and one for all of them: how many pictures it had, what became of them, and how long they took
/// to evolve. Rows that name no shard are counted by their file.
pub(super) fn summary(rows: &[ResultRow]) -> Vec<String> {
    let statuses: BTreeSet<&str> = rows.iter().map(|row| row.told.status.as_str()).collect();
    let mut parts: BTreeMap<&str, Part<'_>> = BTreeMap::new();
    let mut all = Part::default();
    for row in rows {
        let name = row.told.shard.as_deref().unwrap_or(&row.file_name);
        parts.entry(name).or_default().add(row);
        all.add(row);
    }
    let mut parts: Vec<(&str, Part<'_>)> = parts.into_iter().collect();
    parts.sort_by(|a, b| natord::compare(a.0, b.0));
    let headings = ["shard", "pictures"].into_iter().chain(statuses.iter().copied()).chain(["evolved s"]);
    let mut lines = vec![headings.map(str::to_owned).collect::<Vec<_>>()];
    lines.extend(parts.iter().map(|(name, part)| part.cells(name, &statuses)));
    lines.push(all.cells("all", &statuses));
    let width = |column: usize| lines.iter().map(|cells| cells[column].chars().count()).max().unwrap_or_default();
    let widths: Vec<usize> = (0..lines[0].len()).map(width).collect();
    let aligned = |cells: &Vec<String>| {
        let figures: String =
            cells.iter().zip(&widths).skip(1).map(|(cell, &width)| format!("  {cell:>width$}")).collect();
        format!("{:<width$}{figures}", cells[0], width = widths[0])
    };
    lines.iter().map(aligned).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::cli::jobs::row::Row;
    use crate::studio::Scheme;

    fn row(line: &str, file_name: &str) -> ResultRow {
        let told = serde_json::from_str(line).expect("it is a row");
        ResultRow { told, line: line.to_owned(), file_name: file_name.to_owned() }
    }

    #[test]
    fn the_columns_are_the_fields_of_a_row_in_its_order() {
        let json = serde_json::to_string(&Row::new(Path::new("a.png"), 0, Scheme::Cells)).expect("a row is JSON");
        let mut place = 0;
        for column in COLUMNS {
            let found = json[place..].find(&format!("\"{column}\":"));
            place += found.unwrap_or_else(|| panic!("{column} is not in {json}, or not in this order"));
        }
        let fields: Map<String, Value> = serde_json::from_str(&json).expect("it is an object");
        assert_eq!(fields.len(), COLUMNS.len(), "{json}");
    }

    #[test]
    fn a_cell_of_the_csv_is_quoted_where_it_must_be_and_empty_for_null() {
        let line =
            r#"{"id":"a, b","status":"complete","output":["x.png","x.npz"],"key":null,"psnr":34.5,"error":"no \"x\""}"#;
        let csv = String::from_utf8(csv(&[row(line, "r.jsonl")]).expect("rows are CSV")).expect("and text");
        let lines: Vec<&str> = csv.lines().collect();
        assert_eq!(lines[0], COLUMNS.join(","));
        assert_eq!(lines[1], r#""a, b",,complete,,x.png;x.npz,,,,,,34.5,,,,,,,,,,,,,,,,,"no ""x""""#);
    }

    #[test]
    fn a_cell_that_would_be_a_formula_is_text_and_a_number_stays_one() {
        let line =
            r#"{"id":"=HYPERLINK(\"x\")","status":"complete","output":["@x.png","=y"],"objective":-5,"error":"+1;a"}"#;
        let csv = String::from_utf8(csv(&[row(line, "r.jsonl")]).expect("rows are CSV")).expect("and text");
        let cells = csv.lines().nth(1).expect("there is a row");
        assert!(cells.starts_with(r#""'=HYPERLINK(""x"")",,complete,,'@x.png;=y,"#), "{cells}");
        assert!(cells.contains(",-5,") && cells.ends_with(",'+1;a"), "{cells}");
    }

    #[test]
    fn the_summary_counts_by_shard_and_status_and_adds_up() {
        let rows = [
            row(r#"{"id":"a","status":"complete","shard":"2/10","evolve_ms":61000}"#, "r.jsonl"),
            row(r#"{"id":"b","status":"failed","shard":"10/10"}"#, "r.jsonl"),
            row(r#"{"id":"c","status":"complete","shard":"2/10","evolve_ms":2000.5}"#, "r.jsonl"),
            row(r#"{"id":"d","status":"unchanged","shard":null}"#, "r.jsonl"),
        ];
        let expected = [
            "shard    pictures  complete  failed  unchanged  evolved s",
            "2/10            2         2       0          0       63.0",
            "10/10           1         0       1          0        0.0",
            "r.jsonl         1         0       0          1        0.0",
            "all             4         2       1          1       63.0",
        ];
        assert_eq!(summary(&rows), expected);
    }
}
