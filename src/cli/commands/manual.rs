//! `smalti completions` and `smalti man`: shell completions and manual pages, made from the definition of the command
//! line.

use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::{ExitCode, Stdio};

use clap::{Args, Command};
use clap_complete::Shell;

use crate::cli::files::destination;
use crate::cli::terminal;
use crate::cli::terminal::interrupt::Interrupt;
use crate::error::{Error, Result, in_words};
use crate::output;

#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  smalti completions bash > ~/.local/share/bash-completion/completions/smalti\n  \
                        smalti completions zsh > ~/.zfunc/_smalti\n  \
                        smalti completions fish > ~/.config/fish/completions/smalti.fish")]
pub(crate) struct CompletionsArgs {
    /// Shell that will read them
    #[arg(value_enum, value_name = "SHELL")]
    pub shell: Shell,
}

#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Examples:\n  smalti man\n  smalti man evolve\n  smalti man evolve > smalti-evolve.1\n  smalti man -o ~/.local/share/man/man1"
)]
pub(crate) struct ManArgs {
    /// Command whose page is shown on a terminal, or else printed as troff [default: that of smalti itself]
    #[arg(value_name = "COMMAND", conflicts_with = "output")]
    pub command: Option<String>,
    /// Folder that all pages are written to instead; made if it is not there
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
}

/// Prints the completions of a shell; returns the exit code of the process.
pub(crate) fn completions(args: &CompletionsArgs, mut definition: Command) -> ExitCode {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut definition, "smalti", &mut script);
    terminal::exit_code(print(&script))
}

/// Shows or prints a page or writes all of them; returns the exit code of the process.
pub(crate) fn man(args: &ManArgs, definition: Command) -> ExitCode {
    let pages = pages(definition);
    let done = match &args.output {
        Some(folder) => write(&pages, folder),
        None => {
            let name = args.command.as_ref().map_or("smalti".to_owned(), |command| format!("smalti-{command}"));
            let page = pages.iter().find(|command| command.get_name() == name);
            let unknown = || Error::Usage(format!("{name}: there is no such command; see smalti --help"));
            page.ok_or_else(unknown).and_then(show)
        }
    };
    terminal::exit_code(done)
}

/// The command line and each of its commands, named as their pages are.
fn pages(mut all: Command) -> Vec<Command> {
    all.build();
    let of_commands = all.get_subcommands().filter(|command| command.get_name() != "help").map(|command| {
        let name: &'static str = format!("smalti-{}", command.get_name()).leak();
        command.clone().name(name).bin_name(name.replacen('-', " ", 1)).display_name(name)
    });
    let of_commands: Vec<Command> = of_commands.collect();
    std::iter::once(all).chain(of_commands).collect()
}

fn rendered(command: &Command) -> Result<Vec<u8>> {
    let mut page = Vec::new();
    clap_mangen::Man::new(command.clone())
        .render(&mut page)
        .map_err(|error| Error::Internal(format!("no manual page: {error}")))?;
    Ok(page)
}

/// Shows a page on a terminal; prints its troff where there is none.
fn show(command: &Command) -> Result<()> {
    let page = rendered(command)?;
    if !io::stdout().is_terminal() {
        return print(&page);
    }
    if is_shown_by_man(&page).unwrap_or(false) {
        return Ok(());
    }
    print(command.clone().render_long_help().to_string().as_bytes())
}

/// Whether `man` is there, knows what it is to do, and has shown the page.
fn is_shown_by_man(page: &[u8]) -> io::Result<bool> {
    let mut man = std::process::Command::new("man");
    // No stderr: its complaints would stand above the help that comes in its stead.
    let mut man = man.args(["-l", "-"]).stdin(Stdio::piped()).stderr(Stdio::null()).spawn()?;
    // A pager that is left early, or a man that refuses `-l`, does not read it all: how it ends tells which it was.
    let _ = man.stdin.take().map(|mut stdin| stdin.write_all(page));
    Ok(man.wait()?.success())
}

fn write(pages: &[Command], folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|error| {
        Error::output(folder, format!("the folder cannot be created, since {}; name another one", in_words(&error)))
    })?;
    destination::sweep(folder)?;
    let interrupt = Interrupt::listen()?;
    for command in pages {
        interrupt.check()?;
        let (path, page) = (folder.join(format!("{}.1", command.get_name())), rendered(command)?);
        interrupt.while_writing(|| output::write_atomically(&path, &page))?;
    }
    terminal::say(&format!("wrote {} pages to {}", pages.len(), folder.display()));
    Ok(())
}

/// Prints bytes. If the reader stops reading, that is no failure.
fn print(bytes: &[u8]) -> Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(Error::output(
            Path::new("stdout"),
            format!("cannot be written, since {}; redirect it to a file", in_words(&error)),
        )),
        _ => Ok(()),
    }
}
