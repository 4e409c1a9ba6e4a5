//! `smalti plugins`: puts the plug-ins that the program carries where GIMP, Krita and Inkscape look, tells which are
//! there, and takes them away.

mod built;
mod hosts;
mod kept;
mod places;

use std::fmt::Write as _;
use std::process::ExitCode;

use clap::{Args, Subcommand};
use serde_json::{Value, json};

use self::hosts::Host;
use self::kept::{Kept, State};
use self::places::{Place, Surroundings};
use crate::cli::terminal;
use crate::error::{Error, Result};

const AFTER_HELP: &str = "\
Without HOST, install takes every program that it finds, and remove and status take all.

Examples:
  smalti plugins status
  smalti plugins install
  smalti plugins install krita
  smalti plugins remove";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct PluginsArgs {
    /// What to do.
    #[command(subcommand)]
    work: Work,
}

#[derive(Debug, Subcommand)]
enum Work {
    /// Put the plug-in where each program looks, for this user
    ///
    /// What is there of another version is replaced. A file that smalti did not put there, or that was changed since,
    /// is refused.
    Install(InstallArgs),
    /// Take away what `smalti plugins install` put there, and nothing else
    Remove(RemoveArgs),
    /// Tell which programs are found, and which plug-ins they have
    Status(StatusArgs),
}

#[derive(Debug, Args)]
struct InstallArgs {
    /// Program to put it into; repeat it for more
    #[arg(value_enum, value_name = "HOST")]
    hosts: Vec<Host>,
    /// Also replace files that were changed since, or that smalti did not put there
    #[arg(long)]
    force: bool,
    /// Say nothing but errors
    #[arg(short, long)]
    quiet: bool,
}

#[derive(Debug, Args)]
struct RemoveArgs {
    /// Program to take it from; repeat it for more
    #[arg(value_enum, value_name = "HOST")]
    hosts: Vec<Host>,
    /// Also remove files that were changed since smalti put them there
    #[arg(long)]
    force: bool,
    /// Say nothing but errors
    #[arg(short, long)]
    quiet: bool,
}

#[derive(Debug, Args)]
struct StatusArgs {
    /// Program to tell about; repeat it for more
    #[arg(value_enum, value_name = "HOST")]
    hosts: Vec<Host>,
    /// Print JSON to stdout instead of a table
    #[arg(long)]
    json: bool,
}

/// What to do about files that are not as smalti put them there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Others {
    Leave,
    Force,
}

/// Does the work; returns the exit code of the process.
pub(crate) fn plugins(args: &PluginsArgs) -> ExitCode {
    let around = Surroundings::of_this_process();
    let failures = match &args.work {
        Work::Install(args) => install(args, &around),
        Work::Remove(args) => remove(args, &around),
        Work::Status(args) => tell(args, &around).err().into_iter().collect(),
    };
    // A failure in one place stops none of the others, so there may be several.
    failures.into_iter().fold(ExitCode::SUCCESS, |_, failure| terminal::exit_code(Err(failure)))
}

impl Others {
    fn of_flag(is_forced: bool) -> Self {
        if is_forced { Self::Force } else { Self::Leave }
    }
}

fn say(is_quiet: bool, line: &str) {
    if !is_quiet {
        terminal::say(&format!("smalti: {line}"));
    }
}

/// The hosts that were named, or else all.
fn chosen(named: &[Host]) -> Vec<Host> {
    let all = Host::ALL.into_iter();
    all.filter(|host| named.is_empty() || named.contains(host)).collect()
}

/// Where to install: every place of a host that is found, and of one that was named the usual place at least.
fn targets(args: &InstallArgs, around: &Surroundings) -> Vec<(Host, Place)> {
    let mut targets = Vec::new();
    for host in chosen(&args.hosts) {
        let mut places = around.places(host);
        let is_found = places.iter().any(|place| place.is_found);
        match (is_found, args.hosts.is_empty()) {
            (true, _) => places.retain(|place| place.is_found),
            // Somebody knows better than we do.
            (false, false) => places.truncate(1),
            (false, true) => places.clear(),
        }
        targets.extend(places.into_iter().map(|place| (host, place)));
    }
    targets
}

/// Installs all that is asked for; what failed.
fn install(args: &InstallArgs, around: &Surroundings) -> Vec<Error> {
    let targets = targets(args, around);
    if targets.is_empty() {
        let reason = if around.has_home() {
            "neither GIMP, Krita nor Inkscape is found here; name one, as in smalti plugins install krita"
        } else {
            "this user has no home folder; set HOME to one"
        };
        return vec![Error::Usage(reason.to_owned())];
    }
    let mut failures = Vec::new();
    for (host, place) in targets {
        let kept = Kept::at(&place.folder, host.own_folder());
        let files = host.files(around.program.as_deref());
        match files.and_then(|files| kept.install(&files, Others::of_flag(args.force))) {
            Ok(()) => {
                let folder = place.folder.display();
                say(args.quiet, &format!("{}: its plug-in is in {folder}; {}", host.title(), host.next()));
            }
            Err(failure) => failures.push(failure),
        }
    }
    failures
}

/// Removes all that is asked for; what failed.
fn remove(args: &RemoveArgs, around: &Surroundings) -> Vec<Error> {
    let mut failures = Vec::new();
    let mut count = 0;
    for host in chosen(&args.hosts) {
        for place in around.places(host) {
            match Kept::at(&place.folder, host.own_folder()).remove(Others::of_flag(args.force)) {
                Ok(false) => {}
                Ok(true) => {
                    count += 1;
                    let folder = place.folder.display();
                    say(args.quiet, &format!("{}: its plug-in is gone from {folder}", host.title()));
                }
                Err(failure) => failures.push(failure),
            }
        }
    }
    if count == 0 && failures.is_empty() {
        say(args.quiet, "no plug-in of smalti is there");
    }
    failures
}

fn tell(args: &StatusArgs, around: &Surroundings) -> Result<()> {
    let mut rows = Vec::new();
    for host in chosen(&args.hosts) {
        for (number, place) in around.places(host).into_iter().enumerate() {
            let state = Kept::at(&place.folder, host.own_folder()).state();
            // Where there is neither a host nor a plug-in, one line says so.
            if number == 0 || place.is_found || state != State::Absent {
                rows.push((host, place, state));
            }
        }
    }
    if args.json {
        let rows: Vec<Value> = rows.iter().map(|(host, place, state)| row(*host, place, state)).collect();
        return terminal::print_json(&rows);
    }
    let mut text = String::new();
    for (host, place, state) in &rows {
        let _ = writeln!(text, "{:<10} {:<14} {}", host.name(), place.way(), line(*host, place, state));
    }
    terminal::write_stdout(text.as_bytes())
}

fn row(host: Host, place: &Place, state: &State) -> Value {
    let (word, version) = match state {
        State::Absent => ("absent", None),
        State::Current => ("current", Some(env!("CARGO_PKG_VERSION"))),
        State::Other(version) => ("other-version", Some(version.as_str())),
        State::Changed(_) => ("changed", None),
        State::Foreign(_) => ("foreign", None),
        State::Unreadable(_) => ("unreadable", None),
    };
    json!({
        "host": host.name(), "way": place.way(), "found": place.is_found, "folder": place.folder, "state": word,
        "version": version,
    })
}

/// The state of a plug-in, and what to do about it.
fn line(host: Host, place: &Place, state: &State) -> String {
    let (folder, name) = (place.folder.display(), host.name());
    match state {
        State::Absent if place.is_found => format!("no plug-in; smalti plugins install {name} puts it into {folder}"),
        State::Absent => format!("{} is not found", host.title()),
        State::Current => format!("plug-in of this version in {folder}"),
        State::Other(version) => format!(
            "plug-in of version {version} in {folder}, and this is {}; smalti plugins install {name} replaces it",
            env!("CARGO_PKG_VERSION")
        ),
        State::Changed(path) => {
            format!("plug-in in {folder}, of which {} is not as smalti put it there", path.display())
        }
        State::Unreadable(sentence) => sentence.clone(),
        State::Foreign(path) => format!("{} is there, and smalti did not put it there", path.display()),
    }
}
