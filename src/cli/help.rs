//! How help is arranged: which flags `-h` shows, and in which groups `--help` lists them all.
//!
//! What a flag means is told where it is defined.

use clap::{Arg, Command};

use crate::cli::args::paper;

/// The groups of flags in the order of `--help`. The flags of [`SHORT`] come before all of them.
const GROUPS: [&str; 12] = [
    "Plan",
    "Output",
    "Picture",
    "Time",
    "Sequence",
    "Tiles",
    "Search",
    "Computing",
    "Seeing inside",
    "Messages",
    paper::HEADING,
    "Options",
];

/// What `-h` shows of a command.
struct Short {
    command: &'static str,
    /// Its flags, most used first.
    flags: &'static [&'static str],
    example: &'static str,
}

const SHORT: [Short; 9] = [
    Short {
        command: "evolve",
        flags: &[
            "output",
            "style",
            "tiles",
            "output-size",
            "size",
            "grout",
            "seed",
            "time",
            "colors",
            "background",
            "force",
        ],
        example: "photo.jpg -o mosaic.png --style mosaic -n 4000 --output-size 2048",
    },
    Short {
        command: "batch",
        flags: &["output", "format", "recursive", "style", "tiles", "output-size", "size", "grout", "seed", "shard"],
        example: "photos -o mosaics --style mosaic -n 4000",
    },
    Short {
        command: "video",
        flags: &["output", "style", "tiles", "output-size", "size", "grout", "seed", "fps", "max-tile-move"],
        example: "clip.mp4 -o mosaic.mp4 --style mosaic",
    },
    Short {
        command: "render",
        flags: &["output", "output-size", "background", "mask", "shader", "force"],
        example: "tiles.npz -o poster.png --output-size 8192",
    },
    Short {
        command: "timelapse",
        flags: &["output", "output-size", "fps", "frames", "hold", "loop", "force"],
        example: "run -o mosaic.gif --output-size 512",
    },
    Short {
        command: "plan",
        flags: &["output", "shards", "per-shard", "minutes", "picture-time", "into", "style", "tiles", "size"],
        example: "photos -o mosaics --minutes 30",
    },
    Short {
        command: "paper",
        flags: &["images", "output", "births", "seed", "force"],
        example: "fig4 --images photos -o figures",
    },
    Short { command: "gallery", flags: &["output", "births", "seed", "force"], example: "photo.jpg -o gallery" },
    Short {
        command: "bench",
        flags: &["time", "device", "threads", "json", "compare"],
        example: "--device cpu --time 500ms",
    },
];

/// The flags of `smalti batch` that a plan decides for each of its shards, and refuses.
const NOT_OF_A_PLAN: [&str; 3] = ["shard", "results", "trace"];

/// The command line with its help arranged. Words that stand for something built in are known in any case.
pub(super) fn arranged(whole: Command) -> Command {
    whole.mut_subcommands(arranged_command)
}

fn arranged_command(command: Command) -> Command {
    let short = SHORT.iter().find(|short| short.command == command.get_name());
    let is_plan = command.get_name() == "plan";
    let flags = command.get_arguments().cloned().map(|flag| {
        let is_refused = is_plan && flag.get_long().is_some_and(|name| NOT_OF_A_PLAN.contains(&name));
        let is_word = flag.get_action().takes_values() && !flag.get_possible_values().is_empty();
        let flag = if is_refused { flag.hide(true) } else { flag };
        placed(if is_word { flag.ignore_case(true) } else { flag }, short)
    });
    let mut flags: Vec<Arg> = flags.collect();
    flags.sort_by_key(|flag| flag.get_help_heading().map(rank));
    let mut flags = flags.into_iter();
    // Help lists groups in the order of their first flags, and nothing else changes the order of flags.
    let command = command.mut_args(|flag| flags.next().unwrap_or(flag));
    let Some(Short { command: name, example, .. }) = short else { return command };
    command.after_help(format!(
        "Example: smalti {name} {example}\n\nsmalti {name} --help explains all flags and shows more examples."
    ))
}

/// The flag in its place: among those that `-h` shows, or in its group.
fn placed(flag: Arg, short: Option<&Short>) -> Arg {
    let (Some(short), Some(name)) = (short, flag.get_long()) else { return flag };
    match short.flags.iter().position(|known| *known == name) {
        Some(place) => flag.help_heading(None::<&str>).display_order(place),
        None => flag.hide_short_help(true),
    }
}

fn rank(group: &str) -> usize {
    GROUPS.iter().position(|known| *known == group).unwrap_or(GROUPS.len())
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::cli::Cli;

    #[test]
    fn every_flag_and_group_that_is_named_here_exists() {
        let whole = Cli::command();
        for short in &SHORT {
            let command = whole.find_subcommand(short.command).expect(short.command);
            for flag in short.flags {
                assert!(
                    command.get_arguments().any(|known| known.get_long() == Some(flag)),
                    "{} {flag}",
                    short.command
                );
            }
        }
        let commands = || whole.get_subcommands().flat_map(Command::get_arguments);
        let groups: Vec<&str> = commands().filter_map(Arg::get_help_heading).collect();
        assert!(GROUPS.iter().all(|group| groups.contains(group) || *group == "Options"));
        assert!(groups.iter().all(|group| GROUPS.contains(group)), "{groups:?}");
    }
}
