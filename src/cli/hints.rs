//! What to say about a command line that makes no sense, but looks like one that does: the right flag, or the command
//! to type instead. What has no hint here is told in clap's words.

use std::ffi::{OsStr, OsString};
use std::path::Path;

use clap::Command;
use clap::error::{ContextKind, ContextValue, ErrorKind};

use self::Right::{Flag, Words};
use crate::evolve::style::Style;
use crate::studio::quoted;

/// Endings of pictures, in lower case.
const PICTURES: [&str; 11] = ["png", "jpg", "jpeg", "webp", "tif", "tiff", "bmp", "gif", "heic", "avif", "jxl"];
/// Endings of videos.
const VIDEOS: [&str; 6] = ["mp4", "mov", "mkv", "webm", "avi", "m4v"];

/// What is right instead of a flag that does not exist.
enum Right {
    /// A flag, which the command must have, and what to say of it.
    Flag(&'static str, &'static str),
    /// A sentence for every command.
    Words(&'static str),
}

/// Flags that people try, and what they mean.
const WRONG_FLAGS: [(&[&str], Right); 43] = [
    (
        &["--width", "--height", "--w", "--h", "--resize", "--resolution", "--scale", "--dimensions", "--long-side"],
        Flag(
            "output-size",
            "write --output-size PX for the longer side of what is written, and the other side follows",
        ),
    ),
    (
        &["--dpi", "--ppi"],
        Flag("output-size", "write --output-size PX for the longer side, which is centimetres / 2.54 * dpi"),
    ),
    (&["--transparent"], Flag("background", "write --background none")),
    (
        &["--crop", "--aspect", "--aspect-ratio", "--ratio", "--fill"],
        Words("a mosaic keeps the proportions of its picture; crop the picture first"),
    ),
    (
        &["--quality", "--jpeg-quality", "--jpg-quality"],
        Words("a .jpg is written at quality 92; for a smaller file write .webp, or a smaller --output-size"),
    ),
    (
        &["--frame", "--page"],
        Words("the first frame or page of a picture is read; for all frames of an animation there is smalti video"),
    ),
    (&["-s"], Flag("style", "write --style NAME for the look, --size PX for how large it evolves, or --seed S")),
    (
        &["--max-size", "--input-size", "--working-size"],
        Flag("size", "write --size PX for the longer side at which the picture evolves"),
    ),
    (
        &[
            "--count",
            "--number",
            "--num",
            "--num-tiles",
            "--tile-count",
            "--n",
            "--pieces",
            "--flies",
            "--triangles",
            "--strokes",
        ],
        Flag("tiles", "write -n N for the number of tiles"),
    ),
    (
        &["--iterations", "--iters", "--iter", "--steps", "--generations", "--epochs", "--rounds", "--iteration"],
        Flag("evals", "write --evals E for the number of children to try, or --time TIME for how long"),
    ),
    (
        &["--duration", "--timeout", "--time-limit", "--max-time", "--seconds", "--minutes"],
        Flag("time", "write --time TIME, such as --time 30s"),
    ),
    (
        &["--colours", "--num-colors", "--num-colours", "--palette-size"],
        Flag("colors", "write --colors K for the number of colours"),
    ),
    (
        &["--tile-size", "--block-size", "--cell-size", "--pixel-size", "--radius"],
        Flag("tiles", "write -n N for the number of tiles: the more there are, the smaller they are"),
    ),
    (&["--mosaic", "--paint", "--spray"], Flag("style", "write --style mosaic, --style paint or --style spray")),
    (&["--colour-mode"], Flag("color-mode", "write --color-mode MODE")),
    (
        &["--color", "--colour"],
        Flag("grout", "write --grout COLOR, --background COLOR, or --colors K for the number of colours"),
    ),
    (&["--color", "--colour"], Flag("background", "write --background COLOR for what lies behind the tiles")),
    (
        &["--bg", "--background-color", "--background-colour", "--bg-color"],
        Flag("background", "write --background COLOR"),
    ),
    (&["--grout-color", "--grout-colour", "--border-color", "--line-color"], Flag("grout", "write --grout COLOR")),
    (&["--gap", "--grout-size", "--border-width", "--line-width"], Flag("grout-width", "write --grout-width PX")),
    (
        &["--shape", "--shapes", "--masks", "--tile-shape", "--stencil"],
        Flag("mask", "write --mask NAME, such as --mask hexagon"),
    ),
    (&["--alpha", "--transparency"], Flag("opacity", "write --opacity A, a number up to 1")),
    (&["--look", "--theme", "--mode", "--type"], Flag("style", "write --style NAME: free, mosaic, paint or spray")),
    (&["--random-seed", "--rng", "--random"], Flag("seed", "write --seed S, a whole number")),
    (&["--algorithm", "--method"], Flag("scheme", "write --scheme cells or --scheme paper")),
    (&["--resume", "--continue"], Flag("on-exists", "run the same command again: it goes on where it ended")),
    (&["--resume", "--continue"], Flag("warm-start", "run the same command again: it goes on where it ended")),
    (
        &["--initial", "--start", "--resume", "--continue", "--from"],
        Flag("init", "write --init tiles.npz to go on from a population"),
    ),
    (
        &["--out", "--outfile", "--out-file", "--output-file", "--outputs", "--dest", "--to"],
        Flag("output", "write -o FILE"),
    ),
    (&["--out-dir", "--output-dir", "--outdir", "--dir", "--folder"], Flag("output", "write -o DIR")),
    (
        &["-i", "--input", "--in", "--file", "--image", "--picture", "--photo"],
        Words("name the input without a flag, right after the command"),
    ),
    (&["--recurse", "-r", "-R", "--subfolders"], Flag("recursive", "write --recursive")),
    (&["--overwrite", "--replace", "--yes", "-y", "-f"], Flag("force", "write --force")),
    (&["--overwrite", "--replace", "--force", "--yes", "-y", "-f"], Flag("on-exists", "write --on-exists overwrite")),
    (&["--gpu", "--cuda"], Flag("device", "write --device auto, which takes the best GPU; smalti devices lists them")),
    (&["--cpu"], Flag("device", "write --device cpu")),
    (&["--jobs", "-j", "--cores", "--workers", "--cpus", "-t", "--thread"], Flag("threads", "write --threads T")),
    (&["--silent"], Flag("quiet", "write -q")),
    (&["--debug", "--verbosity", "--log"], Flag("verbose", "write -v")),
    (&["--dryrun", "--simulate"], Flag("dry-run", "write --dry-run")),
    (
        &["--ext", "--extension", "--output-format"],
        Flag(
            "save-run",
            "the ending of -o decides the format, as in -o mosaic.jpg; for a GIF of the evolution add --save-run run, then smalti timelapse run -o mosaic.gif",
        ),
    ),
    (
        &["--format", "--ext", "--extension", "--output-format"],
        Words("the ending of -o decides the format, as in -o mosaic.jpg"),
    ),
    (
        &["--animate", "--animation", "--gif", "--timelapse", "--video", "--snapshots"],
        Flag("save-run", "write --save-run run, and then smalti timelapse run -o mosaic.gif"),
    ),
];

/// Commands that people try, and what they mean.
const WRONG_COMMANDS: [(&[&str], &str); 5] = [
    (
        &["convert", "make", "create", "run", "generate", "mosaicize"],
        "for a picture write smalti evolve photo.jpg -o mosaic.png",
    ),
    (&["compare", "diff", "measure"], "to compare pictures write smalti score photo.jpg mosaic.png --fit"),
    (&["info", "identify", "inspect"], "to see how a file was made write smalti show mosaic.png"),
    (&["resize", "scale", "enlarge"], "add --output-size PX to smalti evolve, or to smalti render for a .npz"),
    (&["list", "styles", "themes"], "the styles are free, mosaic, paint and spray, as in --style mosaic"),
];

/// The command line, with `evolve` added where a picture stands in the place of a command.
pub(super) fn with_command(mut tokens: Vec<OsString>, whole: &Command) -> Vec<OsString> {
    let first = tokens.get(1).filter(|first| !is_command(whole, first)).map(Path::new);
    if first.is_some_and(|path| has_ending(path, &PICTURES) && !path.is_dir()) {
        tokens.insert(1, "evolve".into());
    }
    tokens
}

/// What is wrong with the command line and what would be right, if it looks like one that makes sense.
pub(super) fn of(error: &clap::Error, tokens: &[OsString], whole: &Command) -> Option<String> {
    let text = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.clone()),
        Some(ContextValue::Strings(texts)) => texts.first().cloned(),
        _ => None,
    };
    let command = tokens.iter().skip(1).find_map(|token| whole.find_subcommand(token));
    match (error.kind(), command) {
        (ErrorKind::InvalidSubcommand, _) => no_command(&text(ContextKind::InvalidSubcommand)?),
        (ErrorKind::UnknownArgument, None) => Some(format!(
            "{} needs a command before it, as in smalti evolve photo.jpg -o mosaic.png; see smalti --help",
            text(ContextKind::InvalidArg)?
        )),
        (ErrorKind::UnknownArgument, Some(command)) => {
            let argument = text(ContextKind::InvalidArg)?;
            let place = |word: &str| tokens.iter().position(|token| token == word);
            if place(&argument).is_some_and(|place_of_it| Some(place_of_it) < place(command.get_name())) {
                let name = command.get_name();
                return Some(format!("{argument} stands before the command; write smalti {name} first, then the rest"));
            }
            if let Some(word) =
                tokens.iter().filter_map(|token| token.to_str()).find(|word| is_one_minus(word, &argument))
            {
                return Some(format!(
                    "{word} has one minus, so each of its letters is a flag; long flags have two, as in --colors 8; see \
                     smalti {} --help",
                    command.get_name()
                ));
            }
            let is_flag = argument.starts_with('-');
            if is_flag { no_flag(&argument, command, whole) } else { surplus(&argument, command, tokens) }
        }
        (ErrorKind::InvalidValue | ErrorKind::ValueValidation, Some(command)) => {
            no_value(&text(ContextKind::InvalidArg)?, &text(ContextKind::InvalidValue)?, command)
        }
        (ErrorKind::MissingRequiredArgument, Some(command)) => {
            no_output(&text(ContextKind::InvalidArg)?, command, tokens)
        }
        _ => None,
    }
}

/// Whether a word is of several letters behind one minus, of which one is the flag that is not known. `-n500` is not.
fn is_one_minus(word: &str, flag: &str) -> bool {
    let letters = word.strip_prefix('-').filter(|letters| letters.len() > 1);
    let letter = flag.strip_prefix('-').filter(|letter| letter.chars().count() == 1);
    let is_word = |letters: &str| letters.bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'-');
    letters.zip(letter).is_some_and(|(letters, letter)| is_word(letters) && letters.contains(letter))
}

/// What stands in the place of a command is none.
fn no_command(word: &str) -> Option<String> {
    let path = Path::new(word);
    let typed = quoted(word);
    let right = if path.is_dir() {
        format!("is a folder; for all pictures in it write smalti batch {typed} -o mosaics")
    } else if has_ending(path, &["npz"]) {
        format!("is no command; to draw the population write smalti render {typed} -o mosaic.png")
    } else if has_ending(path, &VIDEOS) {
        format!("is no command; for a video write smalti video {typed} -o mosaic.mp4")
    } else if path.is_file() {
        format!("is no command; for a picture write smalti evolve {typed} -o mosaic.png")
    } else if let Some((_, right)) = WRONG_COMMANDS.iter().find(|(wrong, _)| wrong.contains(&word)) {
        format!("is no command; {right}")
    } else if let Some(style) = Style::NAMES.into_iter().find(|name| word.eq_ignore_ascii_case(name)) {
        format!("is a style and no command; write smalti evolve photo.jpg -o mosaic.png --style {style}")
    } else {
        return None;
    };
    Some(format!("{word} {right}"))
}

/// A flag that the command does not have.
fn no_flag(flag: &str, command: &Command, whole: &Command) -> Option<String> {
    let name = command.get_name();
    let has = |command: &Command, long: &str| command.get_arguments().any(|known| known.get_long() == Some(long));
    let fits = |right: &Right| match right {
        Flag(long, _) => has(command, long),
        Words(_) => true,
    };
    let known = WRONG_FLAGS.iter().find(|(wrong, right)| wrong.contains(&flag) && fits(right));
    if let Some((_, Flag(_, words) | Words(words))) = known {
        return Some(format!("smalti {name} has no {flag}; {words}; see smalti {name} --help"));
    }
    let long = flag.strip_prefix("--")?;
    let others: Vec<String> = whole
        .get_subcommands()
        .filter(|other| has(other, long))
        .map(|other| other.get_name().to_owned())
        .take(3)
        .collect();
    let others = match others.as_slice() {
        [] => return None,
        [only] => only.clone(),
        [most @ .., last] => format!("{} and {last}", most.join(", ")),
    };
    Some(format!("smalti {name} has no {flag}, which is a flag of smalti {others}; see smalti {name} --help"))
}

/// One argument more than the command takes.
fn surplus(argument: &str, command: &Command, tokens: &[OsString]) -> Option<String> {
    let input = first_argument(command, tokens)?;
    let [first, second] = [&input, argument].map(quoted);
    let is_after_quiet = tokens.windows(2).any(|pair| pair[0] == "-q" && pair[1] == argument);
    if is_after_quiet && argument.parse::<f64>().is_ok() {
        return Some(format!("-q is --quiet and takes no {argument}; a .jpg is written at quality 92"));
    }
    let spaced = format!("{input} {argument}");
    if Path::new(&spaced).is_file() {
        return Some(format!("a name with spaces needs quotation marks: {}", quoted(&spaced)));
    }
    if command.get_name() == "show" {
        return Some(format!(
            "smalti show tells of one file; whether it was made of {argument} tells smalti show {first} --input {second}"
        ));
    }
    let (name, takes) = match command.get_name() {
        "evolve" => ("evolve", "picture"),
        "render" => ("render", "population"),
        "timelapse" => ("timelapse", "folder"),
        _ => return None,
    };
    let mut told = format!("smalti {name} takes one {takes}, and {argument} is a second one");
    if !has_output(tokens) {
        told.push_str(&format!("; to write there, say smalti {name} {first} -o {second}"));
    }
    if name == "evolve" {
        told.push_str(&format!("; for several pictures, say smalti batch {first} {second} -o mosaics"));
    }
    Some(told)
}

/// A value that means something elsewhere.
fn no_value(flag: &str, value: &str, command: &Command) -> Option<String> {
    if value.is_empty() && (flag.starts_with("--grout <") || flag.starts_with("--background")) {
        let name = flag.split(' ').next()?;
        return Some(format!("{name} needs a colour; one that begins with # needs quotation marks: {name} '#f80'"));
    }
    let is_moving = ["gif", "apng"].iter().chain(&VIDEOS).any(|ending| value.eq_ignore_ascii_case(ending));
    let is_color = |word: &str| !word.is_empty() && crate::studio::color(word.trim()).is_ok();
    if flag.starts_with("--colors") && value.split(',').all(is_color) {
        let told = "--colors takes a number of colours; to name them, write them into a file, one a line, and that \
                    file as --palette FILE";
        return Some(told.to_owned());
    }
    if command.get_name() == "video" && flag.starts_with("--format") && is_moving {
        let ending = value.to_lowercase();
        return Some(format!(
            "--format {value} is for frames in a folder, which are png, jpg or webp; for an animation write -o mosaic.{ending}"
        ));
    }
    None
}

/// A command without an output.
fn no_output(missing: &str, command: &Command, tokens: &[OsString]) -> Option<String> {
    if command.get_name() == "score" {
        let reference = quoted(&first_argument(command, tokens).unwrap_or_else(|| "photo.jpg".to_owned()));
        return Some(format!(
            "<OUT> is missing; name what to compare with it, as in smalti score {reference} mosaic.png --fit"
        ));
    }
    let (name, output) = match command.get_name() {
        name @ ("evolve" | "render") => (name, "mosaic.png"),
        name @ ("batch" | "video") => (name, "mosaics"),
        name @ "timelapse" => (name, "mosaic.gif"),
        _ => return None,
    };
    let input = quoted(&first_argument(command, tokens).filter(|_| missing.starts_with("--output"))?);
    Some(format!("--output is missing; say where to write, as in smalti {name} {input} -o {output}"))
}

/// The first argument of the command that is no flag, as far as it can be told.
fn first_argument(command: &Command, tokens: &[OsString]) -> Option<String> {
    let of_command = tokens.iter().skip_while(|token| *token != command.get_name());
    let line = of_command.cloned();
    let matches = command.clone().ignore_errors(true).try_get_matches_from(line).ok()?;
    let positional = command.get_positionals().next()?;
    let raw = matches.get_raw(positional.get_id().as_str())?.next()?;
    Some(raw.to_string_lossy().into_owned())
}

fn has_output(tokens: &[OsString]) -> bool {
    tokens.iter().any(|token| {
        let text = token.to_string_lossy();
        text.starts_with("-o") || text == "--output" || text.starts_with("--output=")
    })
}

fn is_command(whole: &Command, word: &OsStr) -> bool {
    word == "help" || whole.find_subcommand(word).is_some()
}

fn has_ending(path: &Path, endings: &[&str]) -> bool {
    let ending = path.extension().and_then(OsStr::to_str);
    ending.is_some_and(|ending| endings.iter().any(|known| ending.eq_ignore_ascii_case(known)))
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::cli::Cli;

    #[test]
    fn every_flag_that_is_said_to_be_right_exists() {
        let whole = Cli::command();
        let has = |command: &Command, long: &str| command.get_arguments().any(|known| known.get_long() == Some(long));
        for (wrong, right) in &WRONG_FLAGS {
            if let Flag(right, words) = right {
                assert!(whole.get_subcommands().any(|command| has(command, right)), "{right}");
                assert!(!wrong.contains(&format!("--{right}").as_str()), "{right}: {words}");
            }
        }
    }
}
