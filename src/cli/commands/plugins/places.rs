//! Where the hosts look for plug-ins of a user: installed by themselves, as a Flatpak, or as a Snap.

use std::env;
use std::path::{Path, PathBuf};

use super::hosts::Host;

/// What a variable names, if it is a folder.
type Variables = dyn Fn(&str) -> Option<PathBuf>;

/// What decides where plug-ins lie.
pub(super) struct Surroundings {
    home: Option<PathBuf>,
    /// Variables of the environment that name a folder.
    variable: Box<Variables>,
    /// Folders of programs.
    path: Vec<PathBuf>,
    system: System,
    /// Where Flatpaks of all users lie.
    flatpaks: PathBuf,
    /// The program that is running, if its path is text.
    pub program: Option<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum System {
    Unix,
    Mac,
    Windows,
}

/// A folder in which a host looks for plug-ins.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub folder: PathBuf,
    way: Way,
    /// Whether the host seems to be there.
    pub is_found: bool,
}

/// How a host is installed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    ByItself,
    Flatpak,
    Snap,
}

impl Place {
    /// How the host is installed, in a word; empty if by itself.
    pub fn way(&self) -> &'static str {
        match self.way {
            Way::ByItself => "",
            Way::Flatpak => "Flatpak",
            Way::Snap => "Snap",
        }
    }
}

/// What a host is called by others.
struct Names {
    /// Its folder below that of the user's settings or data, with slashes, for Unix, macOS and Windows.
    folders: [&'static str; 3],
    /// Where it keeps plug-ins in that folder; empty if in several places.
    plugins: &'static str,
    /// The variable that names that folder.
    variable: Option<&'static str>,
    /// Programs that only it brings.
    programs: &'static [&'static str],
    /// Whether its folder alone does not show that it is there: an upgrade leaves it behind.
    needs_program: bool,
    flatpak: Option<&'static str>,
    snap: Option<&'static str>,
    /// Whether it lies with the user's data and not with the settings, where these differ.
    is_data: bool,
}

impl Host {
    fn names(self) -> Names {
        match self {
            Self::Gimp3 => Names {
                folders: ["GIMP/3.0"; 3],
                plugins: "plug-ins",
                variable: Some("GIMP3_DIRECTORY"),
                programs: &["gimp-3.0", "gimp-3"],
                needs_program: false,
                flatpak: Some("org.gimp.GIMP"),
                snap: Some("gimp"),
                is_data: false,
            },
            // It is compiled for the libraries of this machine, which a Flatpak or Snap does not have.
            Self::Gimp2 => Names {
                folders: ["GIMP/2.10"; 3],
                plugins: "plug-ins",
                variable: Some("GIMP2_DIRECTORY"),
                programs: &["gimp-2.10"],
                needs_program: true,
                flatpak: None,
                snap: None,
                is_data: false,
            },
            Self::Krita => Names {
                folders: ["krita"; 3],
                plugins: "",
                variable: None,
                programs: &["krita"],
                needs_program: false,
                flatpak: Some("org.kde.krita"),
                snap: Some("krita"),
                is_data: true,
            },
            Self::Inkscape => Names {
                folders: ["inkscape", "org.inkscape.Inkscape/config/inkscape", "inkscape"],
                plugins: "extensions",
                variable: Some("INKSCAPE_PROFILE_DIR"),
                programs: &["inkscape"],
                needs_program: false,
                flatpak: Some("org.inkscape.Inkscape"),
                snap: Some("inkscape"),
                is_data: false,
            },
        }
    }
}

impl Surroundings {
    pub fn of_this_process() -> Self {
        let program = env::current_exe().ok().and_then(|path| path.to_str().map(str::to_owned));
        let system = if cfg!(windows) {
            System::Windows
        } else if cfg!(target_os = "macos") {
            System::Mac
        } else {
            System::Unix
        };
        Self {
            home: env::home_dir().filter(|home| home.is_absolute()),
            variable: Box::new(|name| env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute())),
            path: env::var_os("PATH").map(|path| env::split_paths(&path).collect()).unwrap_or_default(),
            system,
            flatpaks: PathBuf::from("/var/lib/flatpak/app"),
            program,
        }
    }

    pub fn has_home(&self) -> bool {
        self.home.is_some()
    }

    /// Where a host looks: first where it does when it is installed by itself. Empty if this user has no home.
    pub fn places(&self, host: Host) -> Vec<Place> {
        let names = host.names();
        let has_program = names.programs.iter().any(|name| self.has_program(name));
        let named = names.variable.and_then(|name| (self.variable)(name));
        let folders = match (named, self.by_itself(&names)) {
            (Some(named), _) => vec![named],
            (None, Some(usual)) => of_versions(&usual),
            (None, None) => Vec::new(),
        };
        let mut places: Vec<Place> = folders
            .into_iter()
            .map(|folder| {
                let is_found = has_program || !names.needs_program && folder.is_dir();
                Place { folder: below(&folder, names.plugins), way: Way::ByItself, is_found }
            })
            .collect();
        let Some(home) = self.home.as_ref().filter(|_| self.system == System::Unix) else { return places };
        let relative = names.folders[0];
        if let Some(name) = names.flatpak {
            let app = home.join(".var/app").join(name);
            let is_found = app.is_dir() || self.flatpaks.join(name).is_dir();
            let base = app.join(if names.is_data { "data" } else { "config" }).join(relative);
            places.extend(of_versions(&base).into_iter().map(|folder| Place {
                folder: below(&folder, names.plugins),
                way: Way::Flatpak,
                is_found,
            }));
        }
        if let Some(name) = names.snap {
            let app = home.join("snap").join(name);
            let base = app.join("current").join(if names.is_data { ".local/share" } else { ".config" }).join(relative);
            places.extend(of_versions(&base).into_iter().map(|folder| Place {
                folder: below(&folder, names.plugins),
                way: Way::Snap,
                is_found: app.is_dir(),
            }));
        }
        places
    }

    /// The folder of a host that is installed by itself.
    fn by_itself(&self, names: &Names) -> Option<PathBuf> {
        let home = |below: &str| self.home.as_ref().map(|home| home.join(below));
        let (base, relative) = match (self.system, names.is_data) {
            (System::Windows, _) => ((self.variable)("APPDATA"), names.folders[2]),
            (System::Mac, _) => (home("Library/Application Support"), names.folders[1]),
            (System::Unix, true) => {
                ((self.variable)("XDG_DATA_HOME").or_else(|| home(".local/share")), names.folders[0])
            }
            (System::Unix, false) => ((self.variable)("XDG_CONFIG_HOME").or_else(|| home(".config")), names.folders[0]),
        };
        base.map(|base| base.join(relative))
    }

    fn has_program(&self, name: &str) -> bool {
        let ending = if self.system == System::Windows { ".exe" } else { "" };
        self.path.iter().any(|folder| folder.join(format!("{name}{ending}")).is_file())
    }
}

/// A folder in another, or that one itself.
fn below(folder: &Path, name: &str) -> PathBuf {
    if name.is_empty() { folder.to_owned() } else { folder.join(name) }
}

/// GIMP 3 has a folder for each of its versions, 3.0, 3.2 and so on: those that are there, or else the one given.
fn of_versions(folder: &Path) -> Vec<PathBuf> {
    let (Some(name), Some(parent)) = (folder.file_name().and_then(|name| name.to_str()), folder.parent()) else {
        return vec![folder.to_owned()];
    };
    if name != "3.0" {
        return vec![folder.to_owned()];
    }
    let is_version = |name: &str| name.strip_prefix("3.").is_some_and(|minor| minor.parse::<u32>().is_ok());
    let names = std::fs::read_dir(parent).into_iter().flatten().flatten();
    let mut found: Vec<PathBuf> = names
        .filter(|entry| entry.file_name().to_str().is_some_and(is_version) && entry.path().is_dir())
        .map(|entry| entry.path())
        .collect();
    found.sort();
    if found.is_empty() { vec![folder.to_owned()] } else { found }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn around(home: &Path, system: System) -> Surroundings {
        let roaming = home.join("Roaming");
        let variable = move |name: &str| (name == "APPDATA").then(|| roaming.clone());
        let (flatpaks, home) = (home.join("flatpaks"), Some(home.to_owned()));
        Surroundings { home, variable: Box::new(variable), path: Vec::new(), system, flatpaks, program: None }
    }

    fn folders(around: &Surroundings, host: Host) -> Vec<String> {
        let home = around.home.clone().expect("it was given one");
        let below =
            |place: &Place| place.folder.strip_prefix(&home).map(|path| path.display().to_string().replace('\\', "/"));
        around.places(host).iter().map(|place| below(place).expect("it is below the home")).collect()
    }

    #[test]
    fn every_host_has_its_folder_on_every_system() {
        let home = tempfile::tempdir().expect("a temporary folder");
        let unix = around(home.path(), System::Unix);
        assert_eq!(
            folders(&unix, Host::Gimp3),
            [
                ".config/GIMP/3.0/plug-ins",
                ".var/app/org.gimp.GIMP/config/GIMP/3.0/plug-ins",
                "snap/gimp/current/.config/GIMP/3.0/plug-ins"
            ]
        );
        assert_eq!(folders(&unix, Host::Gimp2), [".config/GIMP/2.10/plug-ins"]);
        assert_eq!(
            folders(&unix, Host::Krita),
            [".local/share/krita", ".var/app/org.kde.krita/data/krita", "snap/krita/current/.local/share/krita"]
        );
        assert_eq!(
            folders(&unix, Host::Inkscape)[..2],
            [".config/inkscape/extensions", ".var/app/org.inkscape.Inkscape/config/inkscape/extensions"]
        );
        let mac = around(home.path(), System::Mac);
        assert_eq!(folders(&mac, Host::Krita), ["Library/Application Support/krita"]);
        let inkscape = "Library/Application Support/org.inkscape.Inkscape/config/inkscape/extensions";
        assert_eq!(folders(&mac, Host::Inkscape), [inkscape]);
        let windows = around(home.path(), System::Windows);
        assert_eq!(folders(&windows, Host::Gimp3), ["Roaming/GIMP/3.0/plug-ins"]);
    }

    #[test]
    fn a_host_is_found_by_its_folder_its_program_or_its_package_and_each_version_of_gimp_3_counts() {
        let home = tempfile::tempdir().expect("a temporary folder");
        let make = |folder: &str| std::fs::create_dir_all(home.path().join(folder)).expect("the folder is ours");
        let mut around = around(home.path(), System::Unix);
        let found = |around: &Surroundings, host| {
            around
                .places(host)
                .iter()
                .filter(|place| place.is_found)
                .map(|place| place.folder.clone())
                .collect::<Vec<_>>()
        };
        for host in Host::ALL {
            assert_eq!(found(&around, host), Vec::<PathBuf>::new(), "{host:?}");
        }
        for folder in [".config/GIMP/3.0", ".config/GIMP/3.2", ".config/GIMP/2.10", ".var/app/org.kde.krita", "bin"] {
            make(folder);
        }
        let plugins = |version: &str| home.path().join(".config/GIMP").join(version).join("plug-ins");
        assert_eq!(found(&around, Host::Gimp3), [plugins("3.0"), plugins("3.2")]);
        assert_eq!(found(&around, Host::Gimp2), Vec::<PathBuf>::new(), "GIMP 3 leaves that folder when it takes over");
        assert_eq!(found(&around, Host::Krita), [home.path().join(".var/app/org.kde.krita/data/krita")]);
        assert_eq!(found(&around, Host::Inkscape), Vec::<PathBuf>::new());
        for program in ["bin/inkscape", "bin/gimp-2.10"] {
            std::fs::write(home.path().join(program), "").expect("the folder is ours");
        }
        around.path.push(home.path().join("bin"));
        assert_eq!(found(&around, Host::Inkscape), [home.path().join(".config/inkscape/extensions")]);
        assert_eq!(found(&around, Host::Gimp2), [plugins("2.10")]);
    }
}
