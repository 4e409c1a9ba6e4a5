//! The page of a figure: everything that belongs to it, in one HTML file that opens from disk without a network.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::cli::values::table_cell;

/// The text that marks a page as ours.
pub(super) const GENERATOR: &str = "smalti paper";

const STYLE: &str = "
:root { color-scheme: light dark; --line: #8884; }
body { font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; padding: 0 1rem; max-width: 1500px; }
h1 { font-size: 1.5rem; margin: 0 0 .25rem; } h2 { font-size: 1.1rem; margin: 2rem 0 .5rem; }
p { max-width: 60rem; margin: .5rem 0; }
table { border-collapse: collapse; margin: .5rem 0; }
td, th { padding: .25rem .6rem; vertical-align: top; text-align: left; }
table.figures td, table.figures th { text-align: right; border-bottom: 1px solid var(--line); font-variant-numeric: tabular-nums; }
table.figures td:first-child, table.figures th:first-child { text-align: left; }
table.pictures td { font-size: 13px; padding: .25rem; } table.pictures th { font-weight: 600; max-width: 13rem; }
table.pictures img { display: block; width: 256px; height: auto; }
.scroll { overflow-x: auto; }
svg { max-width: 100%; height: auto; background: #fff; }
footer { margin-top: 2rem; border-top: 1px solid var(--line); font-size: 13px; }
";

/// A page under construction.
#[derive(Clone, Debug)]
pub(super) struct Page {
    pub title: String,
    /// What the paper shows in this figure, in our words.
    pub claim: String,
    pub sections: Vec<Section>,
}

/// A part of a page, with its heading.
#[derive(Clone, Debug)]
pub(super) struct Section {
    pub heading: String,
    pub content: Content,
}

#[derive(Clone, Debug)]
pub(super) enum Content {
    /// Paragraphs.
    Text(Vec<String>),
    Pictures(PictureTable),
    Figures(FigureTable),
    /// A plot as SVG.
    Plot(String),
    /// Links to other pages: file and text.
    Links(Vec<(String, String)>),
}

/// Pictures in rows and columns.
#[derive(Clone, Debug, Default)]
pub(super) struct PictureTable {
    /// Heads of the columns, without that of the column of row heads.
    pub head: Vec<String>,
    pub rows: Vec<(String, Vec<Cell>)>,
}

/// A place in a table of pictures.
#[derive(Clone, Debug)]
pub(super) enum Cell {
    Picture {
        /// Path relative to the page.
        file: String,
        caption: String,
    },
    /// Why there is no picture.
    Missing(String),
}

/// A table of numbers; also written as CSV.
#[derive(Clone, Debug, Default)]
pub(super) struct FigureTable {
    pub head: Vec<String>,
    pub rows: Vec<Vec<String>>,
    /// The path of the CSV file, relative to the page, once it is written.
    pub file: Option<String>,
}

impl FigureTable {
    /// The table as the bytes of a CSV file.
    pub(super) fn to_csv(&self) -> Vec<u8> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        for row in std::iter::once(&self.head).chain(&self.rows) {
            writer
                .write_record(row.iter().map(|text| table_cell(text).into_owned()))
                .expect("rows are as long as the head, and memory takes all");
        }
        writer.into_inner().expect("memory takes all")
    }
}

impl Page {
    /// A page without sections.
    pub(super) fn new(title: &str, claim: &str) -> Self {
        Self { title: title.to_owned(), claim: claim.to_owned(), sections: Vec::new() }
    }

    /// Adds a section.
    pub(super) fn push(&mut self, heading: &str, content: Content) {
        self.sections.push(Section { heading: heading.to_owned(), content });
    }

    /// The page as HTML. `command` is the command line that made it.
    pub(super) fn to_html(&self, command: &str) -> String {
        html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="generator" content=(GENERATOR);
                    meta name="viewport" content="width=device-width";
                    title { (self.title) }
                    style { (PreEscaped(STYLE)) }
                }
                body {
                    h1 { (self.title) }
                    p { (self.claim) }
                    @for section in &self.sections {
                        h2 { (section.heading) }
                        (content(&section.content))
                    }
                    footer {
                        p { "Made by " code { (command) } ", smalti " (env!("CARGO_PKG_VERSION")) "." }
                    }
                }
            }
        }
        .into_string()
    }
}

/// The path of a file in the folder as a URL. Everything except letters, digits and `-._~/` is percent-encoded.
fn url(path: &str) -> String {
    let encode = |byte: u8| match byte {
        b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' | b'/' => char::from(byte).to_string(),
        _ => format!("%{byte:02X}"),
    };
    path.bytes().map(encode).collect()
}

fn content(content: &Content) -> Markup {
    match content {
        Content::Text(paragraphs) => html! { @for paragraph in paragraphs { p { (paragraph) } } },
        Content::Pictures(table) => pictures(table),
        Content::Figures(table) => figures(table),
        Content::Plot(svg) => html! { div { (PreEscaped(svg)) } },
        Content::Links(links) => html! { ul { @for (file, text) in links { li { a href=(url(file)) { (text) } } } } },
    }
}

fn pictures(table: &PictureTable) -> Markup {
    html! {
        div.scroll { table.pictures {
            @if !table.head.is_empty() {
                tr { th; @for head in &table.head { th { (head) } } }
            }
            @for (head, cells) in &table.rows {
                tr {
                    th { (head) }
                    @for cell in cells {
                        td {
                            @match cell {
                                Cell::Picture { file, caption } => {
                                    a href=(url(file)) { img src=(url(file)) alt=(format!("{head}: {caption}")) loading="lazy"; }
                                    (caption)
                                }
                                Cell::Missing(why) => (why),
                            }
                        }
                    }
                }
            }
        } }
    }
}

fn figures(table: &FigureTable) -> Markup {
    html! {
        div.scroll { table.figures {
            tr { @for head in &table.head { th { (head) } } }
            @for row in &table.rows { tr { @for value in row { td { (value) } } } }
        } }
        @if let Some(file) = &table.file { p { a href=(url(file)) { (file) } } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_mean_the_files_that_they_name() {
        assert_eq!(url("fig4/we ird#1?50%\u{e9}.png"), "fig4/we%20ird%231%3F50%25%C3%A9.png");
        assert_eq!(url("fig4/paper-1/a_b.c~.png"), "fig4/paper-1/a_b.c~.png");
    }

    #[test]
    fn what_people_name_their_files_cannot_break_a_page_or_a_table() {
        let mut page = Page::new("<script>", "a & b");
        let cell = Cell::Picture { file: "\"><b>.png".to_owned(), caption: "<i>".to_owned() };
        let table = PictureTable { head: vec!["x".to_owned()], rows: vec![("<row>".to_owned(), vec![cell])] };
        page.push("pictures", Content::Pictures(table));
        let html = page.to_html("smalti paper fig4");
        assert!(
            !html.contains("<script>") && !html.contains("<b>") && !html.contains("<i>") && !html.contains("<row>")
        );
        let table = FigureTable { head: vec!["a".to_owned()], rows: vec![vec!["1,\"2".to_owned()]], file: None };
        assert_eq!(table.to_csv(), b"a\n\"1,\"\"2\"\n");
        let rows = [["=1+1"], ["-1.5"]].map(|row| row.map(str::to_owned).to_vec()).to_vec();
        assert_eq!(FigureTable { head: vec!["@a".to_owned()], rows, file: None }.to_csv(), b"'@a\n'=1+1\n-1.5\n");
    }
}
