//! Whether the work fits into memory, found out before it begins.

use std::path::{Path, PathBuf};

use crate::error::{Error, Remedy, Result};
use crate::model::{Backdrop, Blend, Canvas, Population, Tile};

// The first two are about twice what the CPU twin takes for a random population of 50,000 flies at 4096x4096, and of
// 1,000,000 at 512x512, since lists grow while tiles gather.
/// Bytes per pixel of the evolved picture: its layers, its share of block lists, target and mosaic.
const BYTES_PER_PIXEL: u64 = 40;
/// Bytes per pixel of a picture that is searched: two layers, errors, and a stack of 16 flies with theirs.
const BYTES_PER_SEARCHED_PIXEL: u64 = 176;
/// The same with translucent tiles, of which every pixel keeps more, with what they let through.
const BYTES_PER_GLAZED_PIXEL: u64 = 301;
/// Bytes per fly: genes in the current and best population, tile, fitness, and its entries in block lists.
const BYTES_PER_FLY: u64 = 512;
/// Bytes per pixel of the written picture: the mosaic, the encoder's copy, and the encoded file.
const BYTES_PER_OUTPUT_PIXEL: u64 = 10;
/// What alpha adds to that: its byte, pixels of four channels for the encoder, and the file's fourth channel.
const BYTES_PER_ALPHA: u64 = 6;

/// Bytes per block that a tile touches: an entry of 8 in a list that grows by doubling.
const BYTES_PER_ENTRY: u64 = 16;
/// Least side in px of a block.
const BLOCK_SIDE_PX: i32 = 8;
/// Least side in samples of a patch that is drawn at once.
const PATCH_SIDE_PX: i32 = 240;

/// About how many bytes the block lists of a population take. The estimate per fly knows tiles of the usual size only,
/// and a population from a file may hold others.
pub(super) fn list_bytes(population: &Population) -> u64 {
    let canvas = Canvas::evaluation(population.width_px, population.height_px);
    let blocks = |first: i32, last: i32| (last / BLOCK_SIDE_PX - first / BLOCK_SIDE_PX + 1) as u64;
    let tiles = population.flies.iter().map(|fly| Tile::bake(fly, &canvas)).filter(|tile| tile.x0 <= tile.x1);
    tiles.map(|tile| blocks(tile.x0, tile.x1) * blocks(tile.y0, tile.y1)).sum::<u64>() * BYTES_PER_ENTRY
}

/// About how many bytes it takes to draw a population: the list of each patch of `samples`, the flies, and the picture of
/// `pixel_count` pixels.
pub(super) fn drawing_bytes(population: &Population, samples: &Canvas, pixel_count: u64) -> u64 {
    let patches = |first: i32, last: i32| (last / PATCH_SIDE_PX - first / PATCH_SIDE_PX + 1) as u64;
    let tiles = population.flies.iter().map(|fly| Tile::bake(fly, samples)).filter(|tile| !tile.is_empty());
    let entries: u64 = tiles.map(|tile| patches(tile.x0, tile.x1) * patches(tile.y0, tile.y1)).sum();
    let fly_bytes = population.flies.len() as u64 * BYTES_PER_FLY;
    let alpha_bytes = if population.background == Backdrop::Transparent { BYTES_PER_ALPHA } else { 0 };
    entries * BYTES_PER_ENTRY + fly_bytes + pixel_count.saturating_mul(BYTES_PER_OUTPUT_PIXEL + alpha_bytes)
}

/// About how many bytes an evolution needs.
pub(super) fn estimate_bytes(pixel_count: u64, fly_count: usize, output_pixel_count: u64) -> u64 {
    pixel_count * BYTES_PER_PIXEL
        + fly_count as u64 * BYTES_PER_FLY
        + output_pixel_count.saturating_mul(BYTES_PER_OUTPUT_PIXEL)
}

/// About how many bytes a search in cells keeps of so many pixels, besides what an evolution does.
pub(super) fn search_bytes(pixel_count: u64, blend: Blend) -> u64 {
    pixel_count.saturating_mul(match blend {
        Blend::Opaque => BYTES_PER_SEARCHED_PIXEL,
        Blend::Translucent => BYTES_PER_GLAZED_PIXEL,
    })
}

/// The bytes that a batch may take: four fifths of what is free now, or all if that is not known.
pub(super) fn share_of_free() -> u64 {
    free_bytes().map_or(u64::MAX, |bytes| bytes / 5 * 4)
}

/// Refuses what needs more memory than there is; passes where that is not known.
///
/// # Errors
/// [`Error::TooLarge`].
pub(super) fn check(needed_bytes: u64) -> Result<()> {
    check_against(needed_bytes, free_bytes())
}

fn check_against(needed_bytes: u64, available_bytes: Option<u64>) -> Result<()> {
    match available_bytes {
        Some(available_bytes) if needed_bytes > available_bytes => Err(Error::TooLarge {
            what: format!(
                "this needs about {} MiB of memory and {} MiB are free",
                needed_bytes >> 20,
                available_bytes >> 20
            ),
            remedies: &[Remedy::SmallerPicture, Remedy::SmallerOutput, Remedy::FewerTiles],
        }),
        _ => Ok(()),
    }
}

/// The memory that is free: of the machine, or less if a scheduler or a container grants less.
fn free_bytes() -> Option<u64> {
    let of_machine = std::fs::read_to_string("/proc/meminfo").ok().and_then(|told| available_bytes(&told));
    let groups = std::fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    of_machine.into_iter().chain(granted_bytes(&groups, Path::new("/sys/fs/cgroup"))).min()
}

/// What is left of the memory that the control groups of a process grant it, as `groups`, its `/proc/self/cgroup`, names them
/// below `root`; none if they set no limit.
fn granted_bytes(groups: &str, root: &Path) -> Option<u64> {
    let left = |(folder, limit, used): (PathBuf, &str, &str)| {
        let number = |name: &str| std::fs::read_to_string(folder.join(name)).ok()?.trim().parse::<u64>().ok();
        let stat = std::fs::read_to_string(folder.join("memory.stat")).unwrap_or_default();
        // Files that were read a while ago make room by themselves.
        let cached = stat.lines().find_map(|line| line.strip_prefix("inactive_file ")?.parse().ok()).unwrap_or(0);
        Some(number(limit)?.saturating_sub(number(used)?.saturating_sub(cached)))
    };
    let of_line = |line: &str| {
        let mut parts = line.splitn(3, ':').skip(1);
        let (controllers, path) = (parts.next()?, parts.next()?.trim_start_matches('/'));
        // Of version 2 is the group without controllers; inside a container its files lie at the root.
        let (root, limit, used) = match controllers {
            "" => (root.to_owned(), "memory.max", "memory.current"),
            "memory" => (root.join("memory"), "memory.limit_in_bytes", "memory.usage_in_bytes"),
            _ => return None,
        };
        let within = |folder: &&Path| folder.starts_with(&root);
        let group = root.join(path);
        let folders = group.ancestors().take_while(within).map(|folder| (folder.to_owned(), limit, used));
        folders.filter_map(left).min()
    };
    groups.lines().filter_map(of_line).min()
}

/// The memory that Linux could give out without swapping.
fn available_bytes(meminfo: &str) -> Option<u64> {
    let kibibytes = meminfo.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    kibibytes.trim().strip_suffix(" kB")?.parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::fly::Genes;
    use crate::model::{Fly, MaskSet};

    #[test]
    fn the_free_memory_is_found_in_what_linux_tells() {
        let meminfo = "MemTotal:       24689124 kB\nMemFree:  1 kB\nMemAvailable:   23000000 kB\nBuffers: 2 kB\n";
        assert_eq!(available_bytes(meminfo), Some(23_000_000 * 1024));
        assert_eq!(available_bytes("MemTotal: 1 kB\n"), None);
    }

    #[test]
    fn the_tightest_control_group_counts_and_none_without_a_limit() {
        let root = tempfile::tempdir().expect("a temporary folder");
        let write = |name: &str, text: &str| {
            let path = root.path().join(name);
            std::fs::create_dir_all(path.parent().expect("it is below the root")).expect("the folder is ours");
            std::fs::write(path, text).expect("the folder is ours");
        };
        write("job/step/memory.max", "max\n");
        write("job/step/memory.current", "7\n");
        assert_eq!(granted_bytes("0::/job/step\n", root.path()), None);
        write("job/memory.max", "1000\n");
        write("job/memory.current", "400\n");
        write("job/memory.stat", "anon 300\ninactive_file 60\n");
        assert_eq!(granted_bytes("0::/job/step\n", root.path()), Some(660));
        write("memory/old/memory.limit_in_bytes", "500\n");
        write("memory/old/memory.usage_in_bytes", "600\n");
        assert_eq!(granted_bytes("4:cpu:/x\n3:memory:/old\n0::/job/step\n", root.path()), Some(0));
    }

    #[test]
    fn more_than_the_free_memory_is_refused_with_both_numbers() {
        assert!(check_against(1 << 30, Some(1 << 30)).is_ok());
        assert!(check_against(1 << 60, None).is_ok());
        let refusal = check_against(3 << 30, Some(1 << 30)).expect_err("there is not enough").to_string();
        assert!(refusal.contains("3072 MiB") && refusal.contains("1024 MiB"), "{refusal}");
    }

    #[test]
    fn flies_as_large_as_the_picture_are_counted_in_every_block() {
        let genes =
            Genes { x: 1024.0, y: 1024.0, z: 0.0, r: 0.0, g: 0.0, b: 0.0, w: 4096.0, h: 4096.0, angle_deg: 0.0 };
        let flies = vec![Fly::from_genes(&genes, 0); 3000];
        let population = Population {
            width_px: 2048,
            height_px: 2048,
            background: [0; 3].into(),
            grout: None,
            masks: MaskSet::default(),
            flies,
        };
        assert_eq!(list_bytes(&population), 3000 * 256 * 256 * 16);
    }

    #[test]
    fn a_transparent_picture_takes_six_bytes_a_pixel_more() {
        let population = |background| {
            let (masks, flies) = (MaskSet::default(), vec![Fly::ABSENT; 2]);
            Population { width_px: 9, height_px: 9, background, grout: None, masks, flies }
        };
        let bytes = |background| drawing_bytes(&population(background), &Canvas::evaluation(9, 9), 81);
        assert_eq!(bytes(Backdrop::Transparent) - bytes(Backdrop::Color([0; 3])), 6 * 81);
    }

    #[test]
    fn absurd_sizes_do_not_overflow_the_estimate() {
        assert!(estimate_bytes(1 << 28, 1_000_000, 65_535 * 65_535) > 40 << 30);
    }
}
