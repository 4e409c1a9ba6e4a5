//! One function for each kind of file. It reads the bytes as smalti does, by all ways that lead to them, goes on to a
//! small mosaic if they are accepted, and returns whether they were.

use std::ffi::OsString;
use std::path::Path;
use std::sync::LazyLock;

use smalti::model::Canvas;
use smalti::photo::{self, Background, CutShort, ReadOptions};
use smalti::shapes::{self, Outfit, Wardrobe};
use smalti::{Blend, Device, Mask, Mosaic, Picture, Recipe, Script, Shader, archive, cli, vector};

use crate::scratch::{folder, with_file};

/// A kind of file.
pub struct Target {
    /// Its name, and that of the folder of its examples in `fuzz/corpus/`.
    pub name: &'static str,
    /// Reads the file; true if it is accepted.
    pub read: fn(&[u8]) -> bool,
    /// Whether the photos of the tests are examples, too.
    pub reads_photos: bool,
}

/// All targets.
pub const TARGETS: [Target; 10] = [
    Target { name: "picture", read: picture, reads_photos: true },
    Target { name: "mask", read: mask, reads_photos: true },
    Target { name: "palette", read: palette, reads_photos: false },
    Target { name: "weight", read: weight, reads_photos: true },
    Target { name: "npz", read: npz, reads_photos: false },
    Target { name: "preset", read: preset, reads_photos: false },
    Target { name: "script", read: script, reads_photos: false },
    Target { name: "manifest", read: manifest, reads_photos: false },
    Target { name: "config", read: config, reads_photos: false },
    Target { name: "svg", read: svg, reads_photos: false },
];

/// Pictures that would take more bytes to decode are left out: they take their time, and that is no fault.
const DECODING_BYTES_MAX: u64 = 1 << 26;
/// Populations of pictures with more pixels are not drawn.
const SIDE_MAX_PX: u32 = 512;

static PICTURE: LazyLock<Picture> = LazyLock::new(|| {
    let pixels: Vec<u8> = (0..12 * 12 * 3_u32).map(|i| (i * i % 251) as u8).collect();
    Picture::from_rgb8(12, 12, &pixels).expect("as many bytes as the size says")
});
static DEVICE: LazyLock<Device> = LazyLock::new(Device::cpu);

/// The recipe, made so small that it takes no time.
fn small(recipe: Recipe) -> Recipe {
    recipe.tiles(8).size(12).evals(40)
}

fn made(recipe: Recipe, picture: &Picture) -> Option<Mosaic> {
    small(recipe).make_quietly(picture, &DEVICE).ok()
}

/// A picture that is evolved, measured, or taken apart.
pub fn picture(data: &[u8]) -> bool {
    with_file("picture", data, |path| {
        let _ =
            (photo::kind_of_file(path), photo::is_whole(path), photo::read_metadata(path), photo::frame_count(path));
        if photo::decoding_bytes(path) > DECODING_BYTES_MAX {
            return false;
        }
        let _ = photo::take_apart(path, |_| Ok(()));
        let over = Background::Color([200, 100, 7]);
        let small = ReadOptions { background: over, long_side_px: Some(24), cut_short: CutShort::Take };
        let _ = photo::read(path, &small);
        let cut = ReadOptions { background: Background::Transparent, ..ReadOptions::default() };
        let is_read = photo::read(path, &cut).is_ok();
        let mosaic = Picture::from_encoded(data).ok().and_then(|picture| made(Recipe::mosaic(), &picture));
        assert!(is_read || mosaic.is_none(), "the file is refused, and its bytes are accepted");
        is_read
    })
}

fn mask_of(data: &[u8], name: &str) -> bool {
    with_file(name, data, |path| {
        // A mask is stretched at any size, so a large one takes its time as a picture does.
        if photo::decoding_bytes(path) > DECODING_BYTES_MAX {
            return false;
        }
        let Ok(template) = shapes::read(path) else { return false };
        // One shader for each blend: all of them take longer than everything else together.
        for (blend, place) in [(Blend::Opaque, data.len()), (Blend::Translucent, data.len() / 7)] {
            let shader = Shader::ALL[place % Shader::ALL.len()];
            let _ = Wardrobe::new(&[Outfit { template: template.clone(), shader }], blend, std::num::NonZeroU8::MAX);
        }
        if let Ok(mask) = Mask::from_encoded(data) {
            made(Recipe::paint().masks([mask]), &PICTURE);
        }
        true
    })
}

/// A tile's shape as a picture.
pub fn mask(data: &[u8]) -> bool {
    mask_of(data, "mask")
}

/// A tile's shape as SVG.
pub fn svg(data: &[u8]) -> bool {
    mask_of(data, "mask.svg")
}

/// The colours that tiles are held to.
pub fn palette(data: &[u8]) -> bool {
    with_file("palette", data, |path| {
        if photo::decoding_bytes(path) > DECODING_BYTES_MAX || photo::read_palette(path).is_err() {
            return false;
        }
        made(Recipe::mosaic().palette_file(path), &PICTURE).is_some()
    })
}

/// A map of what matters in a picture, which may be square or as the photos of the tests are.
pub fn weight(data: &[u8]) -> bool {
    with_file("weight", data, |path| {
        if photo::decoding_bytes(path) > DECODING_BYTES_MAX {
            return false;
        }
        let is_map_of = |(width_px, height_px)| {
            let _ = photo::read_weights(path, (width_px, height_px), CutShort::Take);
            photo::decode_weights(data, width_px, height_px).is_ok()
        };
        let is_photo = is_map_of((63, 48));
        let is_square = is_map_of((12, 12));
        let mosaic = made(Recipe::mosaic().weight_file(path), &PICTURE);
        assert_eq!(is_square, mosaic.is_some(), "the bytes and the file are a map, or neither is");
        is_photo || is_square
    })
}

/// A population that is drawn again, or evolved further.
pub fn npz(data: &[u8]) -> bool {
    with_file("flies.npz", data, |path| {
        let _ = (archive::read_meta(path), archive::is_cut_short(path));
        let read = archive::read(path);
        let Ok(archive::Archive { population, fitness, meta }) = archive::decode(data) else {
            assert!(read.is_err(), "the file is accepted, and its bytes are refused");
            return false;
        };
        let again = archive::encode(&population, &fitness, &meta).map(|bytes| archive::decode(&bytes));
        assert!(!matches!(again, Ok(Err(_))), "what was read and written again is refused");
        if population.width_px.max(population.height_px) <= SIDE_MAX_PX {
            let canvas = Canvas::scaled(population.width_px, population.height_px, 99);
            let _ = vector::encode(&population, &canvas, &meta);
        }
        // The population says how many tiles there are.
        let _ = Recipe::mosaic().init(population).size(12).evals(40).make_quietly(&PICTURE, &DEVICE);
        true
    })
}

/// Settings for a mosaic, with paths of masks.
pub fn preset(data: &[u8]) -> bool {
    let from_file = with_file("preset.toml", data, |path| Recipe::from_preset_file(path));
    let Ok(recipe) = std::str::from_utf8(data)
        .map_or_else(|_| Err(String::new()), |text| Recipe::from_toml(text).map_err(|error| error.to_string()))
    else {
        assert!(from_file.is_err(), "the file is accepted, and its text is refused");
        return false;
    };
    made(recipe, &PICTURE);
    from_file.is_ok()
}

/// A script that is read, written again, and followed as far as its first recipe goes.
pub fn script(data: &[u8]) -> bool {
    let Ok(script) = Script::read(data) else { return false };
    let written = script.write().expect("what is read can be written");
    assert_eq!(Script::read(&written).expect("what is written can be read"), script);
    if let Some(recipe) = script.steps.first().and_then(|step| step.recipe.recipe().ok()) {
        made(recipe, &PICTURE);
    }
    true
}

fn checked(words: &[&str], path: &Path) -> bool {
    let output = folder().join("out");
    let tokens = words.iter().map(|&word| match word {
        "FILE" => path.as_os_str().to_owned(),
        "OUT" => output.as_os_str().to_owned(),
        word => OsString::from(word),
    });
    cli::Cli::checked(tokens.collect()).is_ok()
}

/// The pictures of a batch, with flags, names and places of outputs.
pub fn manifest(data: &[u8]) -> bool {
    with_file("manifest.jsonl", data, |path| {
        let _ = checked(&["smalti", "batch", "-q", "--manifest", "FILE", "-o", "OUT", "--allow-outside"], path);
        checked(&["smalti", "batch", "-q", "--manifest", "FILE", "-o", "OUT"], path)
    })
}

/// Flags for all commands.
pub fn config(data: &[u8]) -> bool {
    with_file("config.toml", data, |path| {
        let for_batch = checked(&["smalti", "batch", "FILE", "-q", "-o", "OUT", "--config", "FILE"], path);
        let for_evolve = checked(&["smalti", "--config", "FILE", "evolve", "a.png", "-o", "OUT/a.png"], path);
        for_batch || for_evolve
    })
}
