//! Tables of what was measured beside what is wanted.

/// What a figure is to be.
#[derive(Clone, Copy)]
pub enum Wanted {
    AtMost(f64),
    AtLeast(f64),
    /// Only told.
    Anything,
}

/// Collects what was missed.
#[derive(Default)]
pub struct Report {
    checked: usize,
    missed: Vec<String>,
    section: String,
}

impl Report {
    /// Begins a table.
    pub fn section(&mut self, title: &str) {
        self.section = title.to_owned();
        println!("\n## {title}\n\n| what | measured | wanted | |\n|---|---|---|---|");
    }

    /// A row of the table. Figures are shown with so many decimals.
    pub fn row(&mut self, what: &str, measured: f64, wanted: Wanted, decimals: usize) {
        let (is_reached, told) = match wanted {
            Wanted::AtMost(limit) => (measured <= limit, format!("at most {limit:.decimals$}")),
            Wanted::AtLeast(limit) => (measured >= limit, format!("at least {limit:.decimals$}")),
            Wanted::Anything => {
                println!("| {what} | {measured:.decimals$} | | |");
                return;
            }
        };
        self.checked += 1;
        if !is_reached {
            self.missed.push(format!("{}: {what} is {measured:.decimals$}, wanted {told}", self.section));
        }
        println!("| {what} | {measured:.decimals$} | {told} | {} |", if is_reached { "reached" } else { "**missed**" });
    }

    /// What was missed, in all.
    pub fn finish(&self) {
        println!("\n{} of {} targets reached", self.checked - self.missed.len(), self.checked);
        self.missed.iter().for_each(|missed| println!("- {missed}"));
    }
}
