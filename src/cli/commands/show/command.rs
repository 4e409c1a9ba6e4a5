//! The command that makes a file again, from what the file tells of itself.

use std::path::Path;

use serde_json::{Map, Value};

use crate::studio::quoted;

/// The flags that people look for first, in this order; all others follow in that of the alphabet.
const FIRST: [&str; 6] = ["scheme", "style", "preset", "tiles", "size", "output-size"];
/// What stands for the bytes of a file whose name decides nothing.
const HASH: &str = "sha256:";

/// Commands that make a file again, and what they need.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Again {
    /// One after another.
    pub commands: Vec<String>,
    /// The words in capitals in the commands, and what each of them is.
    pub needs: Vec<(String, String)>,
    /// Why the commands do not make the same bytes, if they do not.
    pub differs: Option<&'static str>,
}

/// How the file at `path`, which tells `told` of itself, is made again. `input` is the picture, if that is known.
pub(super) fn again(path: &Path, told: &Map<String, Value>, input: Option<&Path>) -> Option<Again> {
    let mut again = Again::default();
    let recipe = told.get("recipe")?.as_object()?;
    let output = quoted(&path.display().to_string());
    let content = told.get("content").and_then(Value::as_str).unwrap_or_default();
    let input = input.map(|path| quoted(&path.display().to_string()));
    let picture = || input.clone().unwrap_or_else(|| "PICTURE".to_owned());
    let evolved = |again: &mut Again| {
        if input.is_none() {
            let hash = told.get("input_sha256").and_then(Value::as_str).unwrap_or("unknown");
            again.needs.push(("PICTURE".to_owned(), format!("the picture with the SHA-256 {hash}")));
        }
        if is_cut_short(told) {
            again.differs = Some(match evals_until_cut(told) {
                Some(_) => "It was ended early. With these --evals the tiles are the same; the metadata are not.",
                None => "It was ended early, and the command may end elsewhere.",
            });
        }
    };
    match content {
        "mosaic" | "painting" if is_of_script(told) => {
            evolved(&mut again);
            let kept = recipe.iter().filter(|(name, _)| ["output-size", "lenient"].contains(&name.as_str()));
            let flags = again.flags(&kept.map(|(name, value)| (name.clone(), value.clone())).collect(), &Map::new());
            again.commands.push(format!("smalti evolve {} --replay SCRIPT -o {output}{flags}", picture()));
            again.needs.push(("SCRIPT".to_owned(), script_told(told)));
        }
        "mosaic" | "painting" => {
            evolved(&mut again);
            let flags = again.flags(recipe, told);
            again.commands.push(format!("smalti evolve {} -o {output}{flags}", picture()));
        }
        "timelapse" => {
            evolved(&mut again);
            let flags = again.flags(recipe, told);
            again.commands.push(format!("smalti evolve {} -o MOSAIC.png --save-run RUN{flags}", picture()));
            let flags = again.flags(&object(told, "animation"), &Map::new());
            again.commands.push(format!("smalti timelapse RUN -o {output}{flags}"));
            again.needs.push(("RUN".to_owned(), "a new folder; --save-every is as it was given then".to_owned()));
        }
        "video" => {
            let flags = again.flags(recipe, &Map::new()) + &again.flags(&object(told, "animation"), &Map::new());
            again.commands.push(format!("smalti video FRAMES -o {output}{flags}"));
            again.needs.push(("FRAMES".to_owned(), "the frames or the video that it was made of".to_owned()));
        }
        "render" => {
            let flags = again.flags(recipe, &Map::new());
            again.commands.push(format!("smalti render POPULATION.npz -o {output}{flags}"));
            let origin = told.get("origin_key").and_then(Value::as_str);
            let of = origin.map_or_else(String::new, |key| format!(" of the result with the key {key}"));
            again.needs.push(("POPULATION.npz".to_owned(), format!("the population{of}")));
        }
        _ => return None,
    }
    if told.contains_key("video_algorithm") {
        again.differs =
            Some("It is a frame of a sequence that goes on from the frame before, as smalti video makes it.");
    }
    Some(again)
}

/// Whether it was steered on its way, or ended before its budget was spent, as scripts tell.
fn is_of_script(told: &Map<String, Value>) -> bool {
    told.contains_key("changes") || told.contains_key("until")
}

/// Which script it was.
fn script_told(told: &Map<String, Value>) -> String {
    let number = |value: Option<&Value>| value.and_then(Value::as_u64);
    let changes = number(told.get("changes").and_then(|changes| changes.get("count")));
    let changes = changes.map(|count| if count == 1 { "1 change".to_owned() } else { format!("{count} changes") });
    let until = number(told.get("until")).map(|evals| format!("ends after {evals} evals"));
    let told = match (changes, until) {
        (Some(changes), Some(until)) => format!(": it has {changes} and {until}"),
        (Some(changes), None) => format!(": it has {changes}"),
        (None, Some(until)) => format!(": it {until}"),
        (None, None) => String::new(),
    };
    format!("the script that was saved with it{told}")
}

/// Whether the clock or a signal ended it.
fn is_cut_short(told: &Map<String, Value>) -> bool {
    told.get("stop").and_then(Value::as_str).is_some_and(|stop| ["time", "interrupted"].contains(&stop))
}

/// The evals after which a search in cells was ended early.
fn evals_until_cut(told: &Map<String, Value>) -> Option<u64> {
    told.get("evals").and_then(Value::as_u64).filter(|_| is_cut_short(told) && told.contains_key("objective"))
}

/// The object of this name, or one without entries.
fn object(told: &Map<String, Value>, word: &str) -> Map<String, Value> {
    told.get(word).and_then(Value::as_object).cloned().unwrap_or_default()
}

impl Again {
    /// The flags of a recipe, each with a space before it.
    fn flags(&mut self, recipe: &Map<String, Value>, told: &Map<String, Value>) -> String {
        let first = FIRST.iter().filter_map(|name| recipe.get_key_value(*name));
        let others = recipe.iter().filter(|(name, _)| !FIRST.contains(&name.as_str()));
        let cut = evals_until_cut(told);
        let mut text = String::new();
        for (name, value) in first.chain(others).filter(|(name, _)| is_flag(name)) {
            if cut.is_none() || !["time", "evals"].contains(&name.as_str()) {
                text += &self.flag(name, value);
            }
        }
        if let Some(evals) = cut {
            text += &format!(" --evals {evals}");
        }
        text
    }

    fn flag(&mut self, name: &str, value: &Value) -> String {
        let typed = match (name, value) {
            ("tiles", count) => return format!(" -n {}", quoted(&plain(count))),
            ("preset", Value::Object(preset)) => self.file("PRESET.toml", format!("a file with\n{}", toml(preset))),
            ("palette", Value::Array(colors)) => {
                let colors: Vec<String> = colors.iter().map(plain).collect();
                self.file("PALETTE.hex", format!("a file with\n{}", colors.join("\n")))
            }
            (_, Value::Array(masks)) => {
                let names = masks.iter().map(|mask| self.named_or_file("MASK", &plain(mask)));
                names.collect::<Vec<_>>().join(",")
            }
            ("init", value) => self.named_or_file("FLIES.npz", &plain(value)),
            ("weight", value) => self.named_or_file("WEIGHT", &plain(value)),
            (_, Value::Bool(true)) => return format!(" --{name}"),
            (_, value) => plain(value),
        };
        format!(" --{name} {}", quoted(&typed))
    }

    /// A name as it is, or for a hash a word for the file with it.
    fn named_or_file(&mut self, word: &str, name: &str) -> String {
        let Some(hash) = name.strip_prefix(HASH) else { return name.to_owned() };
        let what = match word {
            "MASK" => "the mask whose texels have",
            "WEIGHT" => "the map whose weights, fitted to the picture, have",
            _ => "the population whose tiles have",
        };
        self.file(word, format!("{what} the SHA-256 {hash}"))
    }

    /// A word for a file: a second one of the same word gets a number.
    fn file(&mut self, word: &str, what: String) -> String {
        if let Some((known, _)) = self.needs.iter().find(|(_, needed)| *needed == what) {
            return known.clone();
        }
        let count = self.needs.iter().filter(|(known, _)| known.starts_with(word)).count();
        let word = if count == 0 { word.to_owned() } else { format!("{word}-{}", count + 1) };
        self.needs.push((word.clone(), what));
        word
    }
}

/// Whether a name can be that of a flag. The file may come from a stranger, and the command is there to be copied.
fn is_flag(name: &str) -> bool {
    name.bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'-')
}

/// A value without quotation marks.
fn plain(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// A style as a preset file: one line for each value, and a table for each class of tiles.
fn toml(preset: &Map<String, Value>) -> String {
    let (tables, lines): (Vec<_>, Vec<_>) = preset.iter().partition(|(word, _)| *word == "classes");
    let mut text: Vec<String> = lines.iter().map(|(word, value)| format!("{word} = {value}")).collect();
    for class in tables.iter().flat_map(|(_, list)| list.as_array().into_iter().flatten()) {
        text.push("[[classes]]".to_owned());
        text.extend(class.as_object().into_iter().flatten().map(|(word, value)| format!("{word} = {value}")));
    }
    text.join("\n")
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn told(value: Value) -> Map<String, Value> {
        if let Value::Object(told) = value { told } else { Map::new() }
    }

    #[test]
    fn the_flags_come_in_one_order_and_files_by_what_they_hold() {
        let told = told(json!({
            "content": "mosaic",
            "input_sha256": "aa",
            "recipe": {
                "mask": ["disc", "sha256:11", "sha256:22", "sha256:11"], "no-rotation": true, "seed": 7, "style": "mosaic",
                "tiles": 900, "palette": ["00ff10", "aabbcc"]
            }
        }));
        let again = again(Path::new("my mosaic.png"), &told, None).expect("it tells a recipe");
        let command = "smalti evolve PICTURE -o 'my mosaic.png' --style mosaic -n 900 --mask disc,MASK,MASK-2,MASK \
                       --no-rotation --palette PALETTE.hex --seed 7";
        assert_eq!(again.commands, [command]);
        let words: Vec<&str> = again.needs.iter().map(|(word, _)| word.as_str()).collect();
        assert_eq!(words, ["PICTURE", "MASK", "MASK-2", "PALETTE.hex"]);
    }

    #[test]
    fn a_stranger_s_file_puts_no_command_of_its_own_into_the_line() {
        let told = told(json!({
            "content": "mosaic",
            "recipe": {"tiles": "1; evil #", "seed; evil #": 1, "mask": ["$(evil)"], "grout": "`evil`"}
        }));
        let again = again(Path::new("a.png"), &told, Some(Path::new("in.jpg"))).expect("it tells a recipe");
        assert_eq!(again.commands, ["smalti evolve in.jpg -o a.png -n '1; evil #' --grout '`evil`' --mask '$(evil)'"]);
    }

    #[test]
    fn what_the_clock_ended_is_made_again_by_its_evals() {
        let told = told(json!({
            "content": "mosaic", "stop": "time", "evals": 4_096, "objective": 1,
            "recipe": {"evals": 10_000, "seed": 0, "time": "250ms"}
        }));
        let again = again(Path::new("a.png"), &told, Some(Path::new("in.jpg"))).expect("it tells a recipe");
        assert_eq!(again.commands, ["smalti evolve in.jpg -o a.png --seed 0 --evals 4096"]);
        assert!(again.differs.is_some() && again.needs.is_empty());
    }
}
