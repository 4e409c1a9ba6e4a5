//! Every command that README and docs print is run, in the order of the text, in a folder with the files that the text
//! supposes; and every flag and command that they name exists.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Command, Stdio};

use image::{ImageFormat, Rgba, RgbaImage};
use serde_json::Value;

use crate::workshop::Workshop;

const DOCUMENTS: [&str; 13] = [
    "README.md",
    "docs/batch.md",
    "docs/cluster.md",
    "docs/gallery/README.md",
    "docs/paper.md",
    "docs/plugins.md",
    "docs/recipes.md",
    "docs/reference.md",
    "docs/security.md",
    "docs/seeing-inside.md",
    "docs/styles.md",
    "docs/video.md",
    "docs/window.md",
];

/// What is replaced in every command, manifest and preset, so that all takes seconds.
const SMALLER: [(&str, &str); 20] = [
    // A window needs a display; it is opened in `window.rs`.
    ("smalti view ", "smalti view --help "),
    // GIMP's compiler may not be there, and no other host; `tests/doors` has them.
    ("smalti plugins install gimp2", "smalti plugins status gimp2"),
    ("smalti plugins install", "smalti plugins install krita"),
    ("--output-size 1080", "--output-size 64"),
    ("--output-size 4096", "--output-size 64"),
    ("--output-size 4134", "--output-size 64"),
    ("\"tiles\": 4000", "\"tiles\": 40"),
    ("--births 5000", "--births 1"),
    ("tiles = 3000", "tiles = 30"),
    ("--evals 10M", "--evals 10k"),
    ("--evals 150k", "--evals 5k"),
    ("--births 4k", "--births 20"),
    ("--time 10s", "--time 100ms"),
    ("-n 1500", "-n 15"),
    ("-n 2500", "-n 25"),
    ("-n 3000", "-n 30"),
    ("-n 4000", "-n 40"),
    ("-n 300", "-n 13"),
    ("-n 800", "-n 18"),
    ("-n 10k", "-n 60"),
];

/// The flags of `SMALTI_CONFIG` while commands run.
const CONFIGURATION: &str = "[gallery]\nbirths = 1\n[paper]\nbirths = 20\n";

/// What the window would have written beside a mosaic.
const STEPS: &str = r#"{"smalti": "script", "version": 1, "input-sha256": "", "steps": [
    {"evals": 0, "recipe": {"style": "mosaic", "tiles": 40, "evals": 4000}}]}"#;

/// Pictures have this size, which makes everything else small, too.
const SIZE_PX: (u32, u32) = (24, 18);

/// Programs that a test machine lacks: why, and the script that stands in for each.
const STAND_INS: [(&str, &str, &str); 9] = [
    ("sbatch", "needs a cluster; here every task of the script's array runs at once", SBATCH),
    ("kubectl", "needs a cluster; here the file must be there", "test -s \"${@: -1}\""),
    ("cargo", "builds this program", ""),
    ("docker", "needs images from elsewhere", ""),
    (
        "ssh",
        "needs other machines; here they are this one",
        "until [ \"$1\" = -- ]; do shift; done\nshift\nsh -c \"$*\"",
    ),
    (
        "gmic",
        "tests/doors has it; here it hands on what it gets",
        "if [ \"$1\" = -.png ]; then cat > \"${@: -1}\"; else cat \"$1\"; fi",
    ),
    ("nvidia-smi", "needs a GPU of NVIDIA", "echo GPU-00000000-0000-0000-0000-000000000000"),
    ("renderdoccmd", "tools/capture tests it; here smalti runs without it", RENDERDOCCMD),
    ("tools/read_capture.py", "needs RenderDoc's Python; tools/capture tests it", ""),
];

/// All of the command that follows but `--capture FIRST+COUNT` at its end.
const RENDERDOCCMD: &str = r#"until [ "$1" = smalti ]; do shift; done
"${@:1:$#-2}""#;

const SBATCH: &str = r#"
script=${@: -1}
case $script in
*.slurm)
    for task in $(seq "$(sed -n 's/^#SBATCH --array=1-//p' "$script")"); do
        SLURM_ARRAY_TASK_ID=$task bash "$script" || exit
    done ;;
*) bash -n -c "$script" ;;
esac"#;

/// Code in the text that names a command with some of its arguments. So does all that has a word in capitals, such as
/// DIR, or a choice with `|`.
const ONLY_NAMED: [&str; 2] = ["smalti merge --manifest", "smalti score --flicker"];

/// Flags of other programs.
const FOREIGN_FLAGS: [(&str, &[&str]); 8] = [
    ("cargo", &["--locked", "--path", "--open"]),
    ("sbatch", &["--gres", "--cpus-per-task", "--mem", "--partition", "--array", "--requeue", "--wrap", "--signal"]),
    ("parallel", &["--jobs", "--sshlogin"]),
    ("nvidia-smi", &["--id", "--query-gpu"]),
    ("renderdoccmd", &["--wait-for-exit", "--working-dir"]),
    ("tools/fuzz", &[]),
    ("ulimit", &[]),
    ("tools/torture", &[]),
];

/// What a document has to be run or read.
enum Piece {
    /// A fenced block: its language, its text, and the text before it.
    Block { language: String, text: String, before: String },
    /// Code within the text.
    Span(String),
}

fn read(document: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(document);
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{document}: {error}"))
}

fn pieces(document: &str) -> Vec<Piece> {
    let mut pieces = Vec::new();
    let (mut before, mut paragraph) = (String::new(), String::new());
    let text = read(document);
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        let fence = line.trim_start().strip_prefix("```");
        if fence.is_none() && !line.trim().is_empty() {
            paragraph += line;
            paragraph.push('\n');
            continue;
        }
        spans(document, &paragraph, &mut pieces);
        before += &std::mem::take(&mut paragraph);
        if let Some(language) = fence {
            let block: Vec<&str> = lines.by_ref().take_while(|line| line.trim_start() != "```").collect();
            let (language, before) = (language.to_owned(), before.clone());
            pieces.push(Piece::Block { language, text: block.join("\n"), before });
        }
    }
    spans(document, &paragraph, &mut pieces);
    pieces
}

/// Adds the code of a paragraph.
fn spans(document: &str, paragraph: &str, pieces: &mut Vec<Piece>) {
    let parts: Vec<&str> = paragraph.split('`').collect();
    assert!(parts.len() % 2 == 1, "{document}: a backtick is alone in {paragraph}");
    for span in parts.into_iter().skip(1).step_by(2) {
        let words: Vec<&str> = span.split_whitespace().collect();
        pieces.push(Piece::Span(words.join(" ").replace("\\|", "|")));
    }
}

/// The commands of a piece, each on one line.
fn commands(piece: &Piece) -> Vec<String> {
    match piece {
        Piece::Block { language, text, .. } if language == "sh" => {
            let joined = text.replace("\\\n", "");
            joined.lines().filter(|line| !line.trim().is_empty() && !line.starts_with('#')).map(str::to_owned).collect()
        }
        Piece::Block { language, text, .. } if language == "console" => {
            text.lines().filter_map(|line| line.strip_prefix("$ ")).map(str::to_owned).collect()
        }
        Piece::Span(span) if is_whole(span) => vec![span.clone()],
        _ => Vec::new(),
    }
}

/// Whether code within the text is a command of smalti with all its arguments.
fn is_whole(span: &str) -> bool {
    let stands_for_another =
        |word: &str| word.len() > 1 && word.chars().all(|char| char.is_ascii_uppercase() || char == '.');
    let is_open = span.contains('|') || span.split(' ').any(stands_for_another) || ONLY_NAMED.contains(&span);
    span.starts_with("smalti ") && span.split(' ').count() > 2 && !is_open
}

/// The text with [`SMALLER`] numbers.
fn smaller(text: &str) -> String {
    SMALLER.iter().fold(text.to_owned(), |text, (from, to)| text.replace(from, to))
}

/// The block of a document in `language` that has `word`.
fn block(document: &str, language: &str, word: &str) -> String {
    let blocks = pieces(document).into_iter().find_map(|piece| match piece {
        Piece::Block { language: found, text, .. } if found == language && text.contains(word) => Some(text),
        _ => None,
    });
    smaller(&blocks.unwrap_or_else(|| panic!("{document}: no {language} with {word}")))
}

/// A folder with the files that the texts suppose.
struct Scratch {
    workshop: Workshop,
    /// The programs that are found first.
    programs: tempfile::TempDir,
    failures: Vec<String>,
}

impl Scratch {
    fn new() -> Self {
        let programs = tempfile::tempdir().unwrap();
        let scratch = Self { workshop: Workshop::new(), programs, failures: Vec::new() };
        let pixel = |x: u32, y: u32| {
            Rgba([(x * 10) as u8, (y * 14) as u8, ((x * y) % 251) as u8, if x < 8 && y < 8 { 0 } else { 255 }])
        };
        let clear = RgbaImage::from_fn(SIZE_PX.0, SIZE_PX.1, pixel);
        let opaque = image::DynamicImage::from(clear.clone()).to_rgb8();
        for folder in ["photos", "trip", "frames", "tests/photos", "tools"] {
            std::fs::create_dir_all(scratch.workshop.path(folder)).unwrap();
        }
        clear.save(scratch.workshop.path("logo.png")).unwrap();
        let photos = ["star", "yin_yang", "hats", "parrots", "woman"].map(|name| format!("photos/{name}.png"));
        let frames = ["frames/1.png", "frames/2.png", "frames/3.png"].map(str::to_owned);
        let others =
            "photo.jpg faces.png one.png trip/1.jpg a.jpg b.jpg c.jpg tests/photos/parrots.png tests/photos/woman.jpg";
        for name in others.split(' ').map(str::to_owned).chain(photos).chain(frames) {
            opaque.save_with_format(scratch.workshop.path(&name), ImageFormat::from_path(&name).unwrap()).unwrap();
        }
        std::fs::remove_file(scratch.workshop.path("photo.png")).unwrap();
        scratch.workshop.write("mine.toml", block("docs/styles.md", "toml", "style").as_bytes());
        scratch.workshop.write("work.jsonl", block("docs/batch.md", "json", "\"input\"").as_bytes());
        scratch.workshop.write("tiles.hex", b"102030\nd0c0b0\n806040\n");
        scratch.workshop.write("small.toml", CONFIGURATION.as_bytes());
        scratch.workshop.write("mosaic.png.steps.json", STEPS.as_bytes());
        std::os::unix::fs::symlink(env!("CARGO_BIN_EXE_smalti"), scratch.programs.path().join("smalti")).unwrap();
        for (program, _, script) in STAND_INS {
            let of_ours = scratch.workshop.path(program);
            let path = if program.contains('/') { of_ours } else { scratch.programs.path().join(program) };
            write_program(&path, script);
        }
        scratch
    }

    /// Runs a command line of the shell.
    fn run(&mut self, line: &str) {
        let line = smaller(line);
        if line.contains("clip.mp4") && !self.workshop.path("clip.mp4").exists() {
            self.shell("ffmpeg -v error -i frames/%d.png -c:v mpeg4 clip.mp4");
        }
        self.shell(&line);
    }

    fn shell(&mut self, line: &str) {
        let mut command = Command::new("bash");
        for (name, _) in std::env::vars_os().filter(|(name, _)| name.to_string_lossy().starts_with("SMALTI_")) {
            command.env_remove(name);
        }
        let paths = std::env::split_paths(&std::env::var_os("PATH").unwrap()).collect::<Vec<_>>();
        let paths = std::iter::once(self.programs.path().to_owned()).chain(paths);
        command.env("PATH", std::env::join_paths(paths).unwrap());
        command.env("SMALTI_DEVICE", "cpu").env("SMALTI_CONFIG", self.workshop.path("small.toml"));
        command.env("HOME", self.programs.path()).env_remove("XDG_DATA_HOME").stdin(Stdio::null());
        command.args(["-o", "pipefail", "-c", line]).current_dir(self.workshop.path("."));
        let output = command.output().expect("bash is there");
        if !output.status.success() {
            let told = String::from_utf8_lossy(&output.stderr).into_owned();
            self.failures.push(format!("{line}\n    {}: {}", output.status, told.trim_end()));
        }
    }
}

fn write_program(path: &Path, script: &str) {
    use std::os::unix::fs::PermissionsExt;
    std::fs::write(path, format!("#!/bin/bash\n{script}\n")).unwrap();
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o755)).unwrap();
}

/// Does all that a document says.
fn follow(document: &str) {
    let mut scratch = Scratch::new();
    for piece in pieces(document) {
        commands(&piece).iter().for_each(|command| scratch.run(command));
        let Piece::Block { language, text, before } = piece else { continue };
        match language.as_str() {
            "json" if text.contains("\"input\"") => {
                scratch.workshop.write("printed.jsonl", smaller(&text).as_bytes());
                scratch.run("smalti batch --manifest printed.jsonl -o of-manifest");
            }
            "json" => drop(serde_json::from_str::<Value>(&text).unwrap_or_else(|error| panic!("{text}: {error}"))),
            "toml" => {
                scratch.workshop.write("printed.toml", smaller(&text).as_bytes());
                // Which one a block is, the text before it says.
                scratch.run(if before.rfind("--config") > before.rfind("--preset") {
                    "smalti batch photos -o of-config --config printed.toml"
                } else {
                    "smalti evolve photo.jpg -o of-preset.png --preset printed.toml"
                });
            }
            "sh" | "console" | "rust" | "python" => {}
            _ => panic!(
                "{document}: a block says {language:?} instead of sh, console, json, toml, rust or python:\n{text}"
            ),
        }
    }
    assert!(scratch.failures.is_empty(), "{document}:\n{}", scratch.failures.join("\n"));
}

#[test]
fn readme() {
    follow("README.md");
}

#[test]
fn batch() {
    follow("docs/batch.md");
}

#[test]
fn cluster() {
    follow("docs/cluster.md");
}

#[test]
fn gallery() {
    follow("docs/gallery/README.md");
}

#[test]
fn paper() {
    follow("docs/paper.md");
}

#[test]
fn plugins() {
    follow("docs/plugins.md");
}

#[test]
fn security() {
    follow("docs/security.md");
}

#[test]
fn seeing_inside() {
    follow("docs/seeing-inside.md");
}

#[test]
fn recipes() {
    follow("docs/recipes.md");
}

#[test]
fn reference() {
    follow("docs/reference.md");
}

#[test]
fn styles() {
    follow("docs/styles.md");
}

#[test]
fn video() {
    follow("docs/video.md");
}

#[test]
fn window() {
    follow("docs/window.md");
}

#[test]
fn no_document_and_no_rule_is_left_over() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    let names = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    for name in names.filter(|name| name.ends_with(".md")) {
        assert!(DOCUMENTS.contains(&format!("docs/{name}").as_str()), "docs/{name} has no test");
    }
    let texts = DOCUMENTS.map(read).concat();
    let pieces: Vec<Piece> = DOCUMENTS.iter().flat_map(|document| pieces(document)).collect();
    let commands = pieces.iter().flat_map(commands).collect::<Vec<_>>().join("\n");
    for (from, _) in SMALLER {
        assert!(texts.contains(from), "nobody says {from} any more");
    }
    for (program, ..) in STAND_INS {
        assert!(commands.contains(program), "nobody runs {program} any more");
    }
    for span in ONLY_NAMED {
        assert!(pieces.iter().any(|piece| matches!(piece, Piece::Span(found) if found == span)), "nobody says {span}");
    }
    for (program, flags) in FOREIGN_FLAGS {
        assert!(texts.contains(program), "nobody names {program} any more");
        for flag in flags {
            assert!(flags_of(&texts).contains(*flag), "nobody says {flag} of {program} any more");
        }
    }
}

/// All that looks like a long flag.
fn flags_of(text: &str) -> BTreeSet<&str> {
    let is_of_word = |char: char| char.is_ascii_lowercase() || char.is_ascii_digit() || char == '-';
    let starts = text.match_indices("--").map(|(start, _)| start).filter(|&start| {
        let before = text[..start].chars().next_back();
        let after = text[start + 2..].chars().next();
        !before.is_some_and(|char| char.is_alphanumeric() || char == '-')
            && after.is_some_and(|char| char.is_ascii_lowercase())
    });
    starts
        .map(|start| &text[start..start + text[start..].find(|char| !is_of_word(char)).unwrap_or(text.len() - start)])
        .collect()
}

/// What smalti says of itself.
fn help(of: &str) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_smalti")).args(of.split_whitespace()).output().unwrap();
    assert!(output.status.success(), "{of}");
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn every_command_and_flag_that_is_named_exists() {
    let of_all = help("--help");
    let listed = of_all.split("Commands:").nth(1).unwrap().split("Options:").next().unwrap();
    let names: BTreeSet<&str> = listed
        .lines()
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    assert!(names.contains("evolve") && names.contains("man") && names.len() < 30, "{names:?}");
    let helps: Vec<(&str, String)> =
        names.iter().filter(|name| **name != "help").map(|&name| (name, help(&format!("{name} --help")))).collect();
    let of_any: String = helps.iter().map(|(_, help)| help.as_str()).collect();
    let foreign: BTreeSet<&str> = FOREIGN_FLAGS.iter().flat_map(|(_, flags)| flags.iter().copied()).collect();
    let known: BTreeSet<&str> = flags_of(&of_any).into_iter().chain(foreign).chain(["--version"]).collect();
    for document in DOCUMENTS {
        let text = read(document);
        let unknown: Vec<_> = flags_of(&text).into_iter().filter(|flag| !known.contains(flag)).collect();
        assert!(unknown.is_empty(), "{document}: {unknown:?}");
        for piece in pieces(document) {
            let (Piece::Span(code) | Piece::Block { text: code, .. }) = piece;
            for command in code.split("smalti ").skip(1) {
                let word = command.split(|char: char| !char.is_ascii_alphabetic()).next().unwrap_or_default();
                let stands_for_one = word.chars().all(|char| char.is_ascii_uppercase());
                assert!(stands_for_one || names.contains(word), "{document}: smalti {word}");
            }
        }
        for span in
            pieces(document).iter().filter_map(|piece| if let Piece::Span(span) = piece { Some(span) } else { None })
        {
            let Some((name, rest)) = span.strip_prefix("smalti ").and_then(|rest| rest.split_once(' ')) else {
                continue;
            };
            let Some((_, of_command)) = helps.iter().find(|(found, _)| *found == name) else { continue };
            let unknown: Vec<_> = flags_of(rest).difference(&flags_of(of_command)).copied().collect();
            assert!(unknown.is_empty(), "{document}: {span}: {unknown:?}");
        }
    }
}
