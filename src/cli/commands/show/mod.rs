//! `smalti show`: what a file tells of how it was made, as the command that makes it again.

mod command;
mod told;

use std::fmt::Write;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use indicatif::HumanCount;
use serde_json::{Map, Value, json};
use sha2::{Digest, Sha256};

use self::command::Again;
use crate::cli::terminal::{self, words};
use crate::error::{Error, Result};
use crate::photo;
use crate::studio::hexadecimal;

/// Bytes of a file that are read at a time.
const READ_BYTES: usize = 1 << 16;

const EXAMPLES: &str = "\
Examples:
  smalti show mosaic.png                      # how it was made, and the command that makes it again
  smalti show mosaic.png --input photo.jpg    # whether it was made of this photo
  smalti show mosaic.png --json";

#[derive(Clone, Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct ShowArgs {
    /// A file that smalti wrote: a picture, an animation, an .svg, .ora, .npz or .json
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Tell whether it was made of this picture; the exit code is 1 if it was not
    #[arg(long, value_name = "PICTURE")]
    pub input: Option<PathBuf>,
    /// Print one line of JSON to stdout, with all that the file tells
    #[arg(long)]
    pub json: bool,
}

/// Shows a file; returns the exit code of the process.
pub(crate) fn show(args: &ShowArgs) -> ExitCode {
    match show_file(args) {
        Ok(false) => ExitCode::FAILURE,
        done => terminal::exit_code(done.map(|_| ())),
    }
}

/// Prints what a file tells; returns whether it is of the picture that was named, if one was.
fn show_file(args: &ShowArgs) -> Result<bool> {
    let told = told::told_by(&args.file)?.ok_or_else(|| {
        let reason = "tells nothing of how it was made: smalti did not write it, or another program wrote it anew";
        Error::input(&args.file, reason)
    })?;
    let is_of_input = args.input.as_deref().map(|input| is_of(&told, &args.file, input)).transpose()?;
    let input = args.input.as_deref().filter(|_| is_of_input == Some(true));
    let again = command::again(&args.file, &told, input);
    if args.json {
        let needs = again.iter().flat_map(|again| &again.needs).map(|(word, what)| (word.clone(), what.clone().into()));
        terminal::print_json(&json!({
            "file": args.file.display().to_string(),
            "commands": again.as_ref().map(|again| &again.commands),
            "needs": needs.collect::<Map<String, Value>>(),
            "differs": again.as_ref().and_then(|again| again.differs),
            "input_matches": is_of_input,
            "told": told,
        }))?;
    } else {
        let text = text(&args.file, &told, again.as_ref(), args.input.as_deref().zip(is_of_input));
        terminal::write_stdout(text.as_bytes())?;
    }
    Ok(is_of_input != Some(false))
}

/// Whether a file that tells `told` was made of the picture at `input`.
fn is_of(told: &Map<String, Value>, file: &Path, input: &Path) -> Result<bool> {
    let Some(hash) = told.get("input_sha256").and_then(Value::as_str) else {
        let reason = if told.get("content").and_then(Value::as_str) == Some("render") {
            "was drawn of a population; ask the .npz file whether it is of that picture"
        } else {
            "does not tell of which picture it was made; drop --input"
        };
        return Err(Error::input(file, reason));
    };
    let unreadable = |error: io::Error| Error::input(input, photo::why_unreadable(&error));
    Ok(hash_of(File::open(input).map_err(unreadable)?).map_err(unreadable)? == hash)
}

/// The SHA-256 of all bytes, hexadecimal.
fn hash_of(mut file: File) -> io::Result<String> {
    let mut hash = Sha256::new();
    let mut bytes = vec![0; READ_BYTES];
    loop {
        match file.read(&mut bytes)? {
            0 => return Ok(hexadecimal(&hash.finalize())),
            count => hash.update(&bytes[..count]),
        }
    }
}

/// What a file tells, for people.
fn text(file: &Path, told: &Map<String, Value>, again: Option<&Again>, input: Option<(&Path, bool)>) -> String {
    let word = |name: &str| told.get(name).and_then(Value::as_str);
    let number = |name: &str| told.get(name).and_then(Value::as_u64);
    let mut text = format!("{}: {}", file.display(), kind(word("content")));
    if word("status") == Some("partial") {
        text += ", interrupted before its end";
    }
    text.push('\n');
    let mut row = |title: &str, value: String| _ = writeln!(text, "  {title:<9} {value}");
    let size = number("width_px").zip(number("height_px"));
    if let Some((width_px, height_px)) = size {
        let drawn = number("output_size_px").filter(|&px| px != width_px.max(height_px));
        let drawn = drawn.map_or_else(String::new, |px| format!(", drawn with a longer side of {px} px"));
        row("picture", format!("{width_px}x{height_px} px{drawn}"));
    }
    if let Some(tiles) = number("tiles") {
        row("tiles", HumanCount(tiles).to_string());
    }
    if let Some(sae) = number("sae") {
        let mean = size.map(|(width_px, height_px)| sae as f64 / (width_px as f64 * height_px as f64 * 3.0).max(1.0));
        let mean = mean.filter(|_| word("transparent_sha256").is_none());
        let mean = mean.map_or_else(String::new, |mean| format!(", mean error {mean:.2} of 255 per channel"));
        row("score", format!("SAE {}{mean}", HumanCount(sae)));
    }
    if let Some(stop) = word("stop") {
        let spent = number("evals").map(|evals| words::counted(evals, "eval"));
        let spent = spent.or_else(|| number("births").map(|births| words::counted(births, "birth")));
        row("search", format!("{}, ended {}", spent.unwrap_or_default(), words::why_ended(stop)));
    }
    if let Some(version) = word("version") {
        row("made by", format!("smalti {version}"));
    }
    if let Some(key) = word("key") {
        row("key", key.to_owned());
    }
    if let Some((input, is_of_input)) = input {
        let whether =
            if is_of_input { "is the picture that it was made of" } else { "is not the picture that it was made of" };
        row("input", format!("{} {whether}", input.display()));
    }
    match again {
        Some(again) => text += &told_again(again),
        None => text += "\nIt does not tell the command that made it; another output of the same command may.\n",
    }
    text
}

fn told_again(again: &Again) -> String {
    let mut text = "\nTo make it again:\n".to_owned();
    again.commands.iter().for_each(|command| _ = writeln!(text, "  {command}"));
    for (word, what) in &again.needs {
        let mut lines = what.lines();
        _ = writeln!(text, "{word} is {}", lines.next().unwrap_or_default());
        lines.for_each(|line| _ = writeln!(text, "  {line}"));
    }
    again.differs.iter().for_each(|sentence| _ = writeln!(text, "{sentence}"));
    text
}

fn kind(content: Option<&str>) -> &'static str {
    match content {
        Some("mosaic") => "a mosaic",
        Some("painting") => "a painting",
        Some("target") => "the picture as it was evolved towards",
        Some("timelapse") => "how a mosaic evolved",
        Some("video") => "a sequence of mosaics",
        Some("render") => "a population, drawn again",
        _ => "a result of smalti",
    }
}
