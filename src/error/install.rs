//! What to install where a piece of Vulkan is missing, in the words of the system that this program runs on.

use std::fs;
use std::sync::OnceLock;

/// A system, by how Vulkan is installed there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum System {
    Windows,
    MacOs,
    /// Debian, Ubuntu and those that follow them.
    Debian,
    /// Fedora, Red Hat Enterprise Linux and those that follow them.
    Fedora,
    /// Arch and those that follow it.
    Arch,
    Other,
}

/// A piece of Vulkan that may be missing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Piece {
    /// The loader, and so perhaps a driver.
    Loader,
    /// A loader for Vulkan 1.3.
    NewerLoader,
    /// Any driver.
    Driver,
    /// A driver that finds something to drive.
    FittingDriver,
    /// The validation layer.
    ValidationLayer,
}

/// What brings the piece on this system, to follow the word "install".
pub(super) fn what_brings(piece: Piece) -> &'static str {
    words(System::here(), piece)
}

fn words(system: System, piece: Piece) -> &'static str {
    match (system, piece) {
        (System::Windows, Piece::Loader | Piece::Driver | Piece::FittingDriver) => {
            "the driver of the graphics card from its maker, which brings Vulkan"
        }
        (System::Windows, Piece::NewerLoader) => {
            "the newest driver of the graphics card from its maker, which brings Vulkan"
        }
        (System::Windows, Piece::ValidationLayer) => "the Vulkan SDK, which brings it",

        (System::MacOs, Piece::Loader) => "it and a driver with brew install molten-vk vulkan-loader",
        (System::MacOs, Piece::NewerLoader) => "a newer one with brew upgrade molten-vk vulkan-loader",
        (System::MacOs, Piece::Driver) => "one with brew install molten-vk",
        (System::MacOs, Piece::FittingDriver) => "a newer one with brew upgrade molten-vk",
        (System::MacOs, Piece::ValidationLayer) => "it with brew install vulkan-validationlayers",

        (System::Debian, Piece::Loader) => "it and a driver with apt-get install libvulkan1 mesa-vulkan-drivers",
        (System::Debian, Piece::NewerLoader) => "a newer one with apt-get install libvulkan1",
        (System::Debian, Piece::Driver) => {
            "one with apt-get install mesa-vulkan-drivers, or the driver of the GPU's vendor"
        }
        (System::Debian, Piece::FittingDriver) => "software Vulkan with apt-get install mesa-vulkan-drivers",
        (System::Debian, Piece::ValidationLayer) => "it with apt-get install vulkan-validationlayers",

        (System::Fedora, Piece::Loader) => "it and a driver with dnf install vulkan-loader mesa-vulkan-drivers",
        (System::Fedora, Piece::NewerLoader) => "a newer one with dnf upgrade vulkan-loader",
        (System::Fedora, Piece::Driver) => {
            "one with dnf install mesa-vulkan-drivers, or the driver of the GPU's vendor"
        }
        (System::Fedora, Piece::FittingDriver) => "software Vulkan with dnf install mesa-vulkan-drivers",
        (System::Fedora, Piece::ValidationLayer) => "it with dnf install vulkan-validation-layers",

        (System::Arch, Piece::Loader) => {
            "it with pacman -S vulkan-icd-loader, and a driver: vulkan-radeon, vulkan-intel, nvidia-utils, or \
             vulkan-swrast for software Vulkan"
        }
        (System::Arch, Piece::NewerLoader) => "a newer one with pacman -Syu vulkan-icd-loader",
        (System::Arch, Piece::Driver) => {
            "one with pacman -S: vulkan-radeon, vulkan-intel, nvidia-utils, or vulkan-swrast for software Vulkan"
        }
        (System::Arch, Piece::FittingDriver) => "software Vulkan with pacman -S vulkan-swrast",
        (System::Arch, Piece::ValidationLayer) => "it with pacman -S vulkan-validation-layers",

        (System::Other, Piece::Loader) => {
            "it and a driver, which are called libvulkan1 and mesa-vulkan-drivers on Debian, vulkan-loader and \
             mesa-vulkan-drivers on Fedora, vulkan-icd-loader and vulkan-swrast on Arch"
        }
        (System::Other, Piece::NewerLoader) => {
            "a newer one, which is called libvulkan1 on Debian, vulkan-loader on Fedora, vulkan-icd-loader on Arch"
        }
        (System::Other, Piece::Driver) => {
            "the driver of the GPU's vendor, or what is called mesa-vulkan-drivers on Debian and Fedora, \
             vulkan-swrast on Arch"
        }
        (System::Other, Piece::FittingDriver) => {
            "software Vulkan, which is called mesa-vulkan-drivers on Debian and Fedora, vulkan-swrast on Arch"
        }
        (System::Other, Piece::ValidationLayer) => {
            "it, which is called vulkan-validationlayers on Debian, vulkan-validation-layers on Fedora and Arch"
        }
    }
}

impl System {
    /// The system that this program runs on.
    fn here() -> Self {
        static HERE: OnceLock<System> = OnceLock::new();
        *HERE.get_or_init(|| {
            if cfg!(target_os = "windows") {
                return Self::Windows;
            }
            if cfg!(target_os = "macos") {
                return Self::MacOs;
            }
            // os-release(5) names both places, in this order.
            let places = ["/etc/os-release", "/usr/lib/os-release"];
            let release = places.iter().find_map(|place| fs::read_to_string(place).ok());
            Self::of_release(&release.unwrap_or_default())
        })
    }

    /// The Linux that a text as in `/etc/os-release` tells of: by its own name, or else by those that it follows, which
    /// stand nearest first.
    fn of_release(text: &str) -> Self {
        let value = |name: &str| text.lines().find_map(|line| line.trim().strip_prefix(name)?.strip_prefix('='));
        let values = [value("ID"), value("ID_LIKE")].into_iter().flatten();
        let mut names = values.flat_map(|value| value.trim_matches(['"', '\'']).split_whitespace());
        names.find_map(Self::of_name).unwrap_or(Self::Other)
    }

    fn of_name(name: &str) -> Option<Self> {
        match name {
            "debian" | "ubuntu" => Some(Self::Debian),
            "fedora" | "rhel" | "centos" => Some(Self::Fedora),
            "arch" => Some(Self::Arch),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PIECES: [Piece; 5] =
        [Piece::Loader, Piece::NewerLoader, Piece::Driver, Piece::FittingDriver, Piece::ValidationLayer];

    #[test]
    fn a_linux_is_known_by_its_own_name_or_by_those_that_it_follows() {
        for (text, system) in [
            ("PRETTY_NAME=\"Debian GNU/Linux 12 (bookworm)\"\nVERSION_ID=\"12\"\nID=debian\n", System::Debian),
            ("NAME=\"Ubuntu\"\nID=ubuntu\nID_LIKE=debian\n", System::Debian),
            ("ID=linuxmint\nID_LIKE=\"ubuntu debian\"\n", System::Debian),
            ("ID_LIKE='debian'\nID='raspbian'\r\n", System::Debian),
            ("NAME=\"Fedora Linux\"\nID=fedora\n", System::Fedora),
            ("ID=\"rocky\"\nID_LIKE=\"rhel centos fedora\"\n", System::Fedora),
            ("ID=arch\n", System::Arch),
            ("ID=manjaro\nID_LIKE=arch\n", System::Arch),
            ("ID=nixos\n", System::Other),
            ("ID=\"opensuse-leap\"\nID_LIKE=\"suse opensuse\"\n", System::Other),
            ("VARIANT_ID=debian\n", System::Other),
            ("ID\nID=\n", System::Other),
            ("", System::Other),
        ] {
            assert_eq!(System::of_release(text), system, "{text}");
        }
    }

    #[test]
    fn every_system_is_told_its_own_way_to_install_each_piece() {
        for (system, way) in [
            (System::Windows, "which brings "),
            (System::MacOs, "with brew "),
            (System::Debian, "with apt-get install "),
            (System::Fedora, "with dnf "),
            (System::Arch, "with pacman -S"),
            (System::Other, "called "),
        ] {
            for piece in PIECES {
                let words = words(system, piece);
                assert!(words.contains(way), "{system:?}, {piece:?}: {words}");
            }
        }
    }

    #[test]
    fn each_piece_is_called_as_the_system_calls_it() {
        for (system, piece, name) in [
            (System::Debian, Piece::Loader, "libvulkan1 mesa-vulkan-drivers"),
            (System::Debian, Piece::Driver, "install mesa-vulkan-drivers"),
            (System::Debian, Piece::ValidationLayer, "install vulkan-validationlayers"),
            (System::Fedora, Piece::Loader, "vulkan-loader mesa-vulkan-drivers"),
            (System::Fedora, Piece::ValidationLayer, "vulkan-validation-layers"),
            (System::Arch, Piece::Loader, "vulkan-icd-loader"),
            (System::Arch, Piece::FittingDriver, "vulkan-swrast"),
            (System::Arch, Piece::ValidationLayer, "vulkan-validation-layers"),
            (System::MacOs, Piece::Loader, "brew install molten-vk vulkan-loader"),
            (System::MacOs, Piece::ValidationLayer, "brew install vulkan-validationlayers"),
            (System::Windows, Piece::Driver, "the driver of the graphics card from its maker"),
            (System::Windows, Piece::ValidationLayer, "the Vulkan SDK"),
        ] {
            let words = words(system, piece);
            assert!(words.contains(name), "{system:?}, {piece:?}: {words}");
        }
        for name in ["libvulkan1", "vulkan-loader", "vulkan-icd-loader"] {
            assert!(words(System::Other, Piece::Loader).contains(name), "an unknown system is told of {name}");
        }
    }
}
