//! Scenes and populations that stress exactness: ties, borders, giants, hidden tiles, holes, odd sizes.

use std::num::NonZeroU8;
use std::sync::Arc;

use rand::RngExt;
use smalti::model::fly::{SIDE_MAX, SIDE_MIN, Z_MAX, position_max};
use smalti::model::mask::{MASK_SIDE, Mask, MaskSet, Texel};
use smalti::model::rng::{Purpose, Stream};
use smalti::model::{Blend, Fly, Scene, Target};
use smalti::shapes::{BuiltIn, Outfit, Shader, Wardrobe};

/// A scene with a population, and a name for messages.
pub struct Scenario {
    pub name: &'static str,
    pub scene: Scene,
    pub flies: Vec<Fly>,
}

/// A stream of random numbers for tests.
pub fn stream(seed: u64) -> Stream {
    Stream::new(seed, Purpose::FirstPopulation, u32::MAX, 0)
}

/// A scene of random pixels, black behind, with the square only.
pub fn random_scene(width_px: u32, height_px: u32, fly_count: usize, random: &mut Stream) -> Scene {
    let pixels = (0..width_px * height_px).map(|_| random.random()).collect();
    scene(width_px, height_px, fly_count, pixels)
}

fn scene(width_px: u32, height_px: u32, fly_count: usize, pixels: Vec<[u8; 3]>) -> Scene {
    let target = Target::new(width_px, height_px, pixels).expect("the test's size is right");
    Scene { target: Arc::new(target), masks: Arc::default(), background: [0; 3], fly_count }
}

/// A fly with any genes that the bounds allow, with sides of `side_px` px.
pub fn any_fly(scene: &Scene, side_px: std::ops::Range<f32>, random: &mut Stream) -> Fly {
    let mut side = || ((random.random_range(side_px.clone()) * 64.0) as u32).clamp(SIDE_MIN, SIDE_MAX);
    let (w, h) = (side(), side());
    Fly {
        x: random.random_range(0..=position_max(scene.target.width_px())),
        y: random.random_range(0..=position_max(scene.target.height_px())),
        z: random.random_range(0..=Z_MAX),
        r: random.random(),
        g: random.random(),
        b: random.random(),
        angle: random.random(),
        w,
        h,
        mask: random.random_range(0..scene.masks.layers().len() as u16),
        alive: true,
    }
}

fn flies(scene: &Scene, side_px: std::ops::Range<f32>, random: &mut Stream) -> Vec<Fly> {
    (0..scene.fly_count).map(|_| any_fly(scene, side_px.clone(), random)).collect()
}

/// A mask with a round hole whose shade falls off to the right, and one that is a hole altogether.
pub fn holed_masks() -> MaskSet {
    let texel = |index: usize| {
        let (column, row) = ((index % MASK_SIDE) as i32 - 128, (index / MASK_SIDE) as i32 - 128);
        let coverage = if column * column + row * row < 60 * 60 { 127 } else { 128 };
        Texel { coverage, shade: 255 - (index % MASK_SIDE) as u8 }
    };
    let ring = Mask::new((0..MASK_SIDE * MASK_SIDE).map(texel).collect()).expect("a full layer");
    let nothing = Mask::new(vec![Texel { coverage: 0, shade: 255 }; MASK_SIDE * MASK_SIDE]).expect("a full layer");
    MaskSet::with_layers(vec![ring, nothing]).expect("few layers")
}

/// Translucent masks: noise in coverage and shade, a soft disc with nothing around it, and the faintest veil.
pub fn translucent_masks(random: &mut Stream) -> MaskSet {
    let mut mask = |texel: &mut dyn FnMut(i32, i32, &mut Stream) -> Texel| {
        let places = (0..MASK_SIDE * MASK_SIDE).map(|index| ((index % MASK_SIDE) as i32, (index / MASK_SIDE) as i32));
        Mask::new(places.map(|(column, row)| texel(column, row, random)).collect()).expect("a full layer")
    };
    let noise = mask(&mut |_, _, random| Texel { coverage: random.random(), shade: random.random() });
    let disc = mask(&mut |column, row, _| {
        let distance = (column - 128).pow(2) + (row - 128).pow(2);
        Texel { coverage: (200 - distance / 60).max(0) as u8, shade: 255 }
    });
    let veil = mask(&mut |column, _, _| Texel { coverage: 1, shade: column as u8 });
    MaskSet::with_layers(vec![noise, disc, veil]).expect("few layers").with_blend(Blend::Translucent)
}

/// Every scenario once more with translucent masks.
pub fn translucent_scenarios() -> Vec<Scenario> {
    let mut random = stream(255);
    let masks = Arc::new(translucent_masks(&mut random));
    let mut all = scenarios();
    for scenario in &mut all {
        scenario.scene.masks = Arc::clone(&masks);
        for fly in &mut scenario.flies {
            fly.mask = random.random_range(0..masks.layers().len() as u16);
        }
    }
    all
}

/// Tiles in every built-in mask under every shader, opaque and translucent.
pub fn dressed_scenarios() -> [Scenario; 2] {
    let shapes = || BuiltIn::ALL.into_iter().map(BuiltIn::template);
    let outfits: Vec<Outfit> =
        shapes().flat_map(|template| Shader::ALL.map(|shader| Outfit { template: template.clone(), shader })).collect();
    [("every mask and shader, opaque", Blend::Opaque), ("every mask and shader, translucent", Blend::Translucent)].map(
        |(name, blend)| {
            let Wardrobe { masks, layers } = Wardrobe::new(&outfits, blend, NonZeroU8::MAX).expect("all are seen");
            let mut random = stream(72);
            let plain = random_scene(80, 60, 4 * layers.len(), &mut random);
            let scene = Scene { masks: Arc::new(masks), ..plain };
            let mut flies = flies(&scene, 2.0..24.0, &mut random);
            flies.iter_mut().zip(layers.iter().cycle()).for_each(|(fly, &layer)| fly.mask = layer);
            Scenario { name, scene, flies }
        },
    )
}

/// 20,000 tiles that all cover the whole of a small picture, with `masks`: no pixel may lose a layer.
pub fn deep_stack(name: &'static str, masks: MaskSet, random: &mut Stream) -> Scenario {
    let scene = Scene { masks: Arc::new(masks), background: [255, 3, 99], ..random_scene(3, 2, 20_000, random) };
    let fly = |fly: Fly| Fly { x: 64, y: 32, w: 640, h: 640, mask: 1, ..fly };
    let flies = flies(&scene, 1.0..2.0, random).into_iter().map(fly).collect();
    Scenario { name, scene, flies }
}

/// The two ways to be deep: every layer as faint as can be, and layers from faint to a quarter.
pub fn deep_stacks() -> [Scenario; 2] {
    let mut random = stream(20_000);
    let faint = Mask::new(vec![Texel { coverage: 1, shade: 255 }; MASK_SIDE * MASK_SIDE]).expect("a full layer");
    let texels = (0..MASK_SIDE * MASK_SIDE)
        .map(|_| Texel { coverage: random.random_range(0..64) / random.random_range(1..64), shade: random.random() });
    let mixed = Mask::new(texels.collect()).expect("a full layer");
    let set = |mask| MaskSet::with_layers(vec![mask]).expect("few layers").with_blend(Blend::Translucent);
    [
        deep_stack("20,000 of the faintest tiles", set(faint), &mut random),
        deep_stack("20,000 tiles of mixed coverage", set(mixed), &mut random),
    ]
}

/// All scenarios that both evaluators must answer exactly.
pub fn scenarios() -> Vec<Scenario> {
    let mut random = stream(2017);
    let random = &mut random;
    let mut all = Vec::new();
    let mut add = |name, scene: Scene, flies: Vec<Fly>| all.push(Scenario { name, scene, flies });

    let plain = random_scene(64, 48, 300, random);
    let tiles = flies(&plain, 0.25..12.0, random);
    add("random tiles over the border", plain.clone(), tiles.clone());
    add("ties in z", plain.clone(), tiles.iter().map(|fly| Fly { z: fly.z & 1, ..*fly }).collect());
    let absent = |(index, fly): (usize, &Fly)| if index % 3 == 0 { Fly::ABSENT } else { *fly };
    add("absent flies", plain.clone(), tiles.iter().enumerate().map(absent).collect());
    let upright = |fly: &Fly| Fly { angle: fly.angle & 0xC000, x: fly.x & !63, y: fly.y & !63, w: 256, h: 256, ..*fly };
    add("tiles at quarter turns with edges on pixel centres", plain.clone(), tiles.iter().map(upright).collect());
    let hidden = |fly: &Fly| Fly { x: 32 * 64, y: 24 * 64, angle: 0, w: 640, h: 640, ..*fly };
    add("tiles hidden behind each other", plain, tiles.iter().map(hidden).collect());

    let giants = random_scene(40, 30, 50, random);
    let tiles = flies(&giants, 10.0..4096.0, random);
    add("tiles larger than the picture", Scene { background: [9, 200, 77], ..giants }, tiles);

    let masked = Scene { masks: Arc::new(holed_masks()), background: [255; 3], ..random_scene(61, 67, 200, random) };
    let tiles = flies(&masked, 1.0..30.0, random);
    add("masks with holes", masked, tiles);

    for (name, width_px, height_px, fly_count) in
        [("a single fly", 33, 17, 1), ("1x1", 1, 1, 9), ("3x5", 3, 5, 40), ("4097x31", 4097, 31, 900)]
    {
        let scene = random_scene(width_px, height_px, fly_count, random);
        let tiles = flies(&scene, 0.25..20.0, random);
        add(name, scene, tiles);
    }

    let many = random_scene(256, 200, 70_000, random);
    let tiles = flies(&many, 0.25..3.0, random);
    add("more than 65,535 flies", many, tiles);

    add_deep_block(&mut add, random);

    // White over black: the sums of this one tile do not fit 32 bits.
    let side = 2048;
    let black = scene(side, side, 1, vec![[0; 3]; (side * side) as usize]);
    let (x, w) = (position_max(side) / 2, SIDE_MAX);
    let white = Fly { x, y: x, w, h: w, r: 65_535, g: 65_535, b: 65_535, alive: true, ..Fly::ABSENT };
    add("one tile of the opposite colour over 2048x2048", black, vec![white]);
    all
}

/// 70,000 flies in the list of one block of which only the farthest two cover anything there: no early exit helps.
fn add_deep_block(add: &mut impl FnMut(&'static str, Scene, Vec<Fly>), random: &mut Stream) {
    let deep = random_scene(24, 24, 70_000, random);
    let needle = |index: u32| Fly {
        x: 12 * 64,
        y: 12 * 64,
        z: index,
        angle: 1 << 13,
        w: 24 * 64,
        h: SIDE_MIN,
        r: index as u16,
        alive: true,
        ..Fly::ABSENT
    };
    let mut tiles: Vec<Fly> = (0..70_000).map(needle).collect();
    for fly in tiles.iter_mut().rev().take(2) {
        *fly = Fly { w: 30 * 64, h: 30 * 64, ..*fly };
    }
    add("a block with more tiles than a loop may turn", deep, tiles);
}
