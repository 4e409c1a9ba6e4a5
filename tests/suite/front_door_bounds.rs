//! Whatever is given to a recipe or a picture, it is taken or refused by its name and range, without a panic.

use std::ops::RangeInclusive;

use proptest::collection::vec;
use proptest::prelude::*;
use smalti::{Blend, ColorMode, Device, Error, GroutColor, Mask, OnDry, Picture, Recipe, Scheme, Shader};

type SetWhole = fn(Recipe, u64) -> Recipe;
type SetReal = fn(Recipe, f64) -> Recipe;

/// The whole numbers of a recipe, with what their documentation says they may be.
const WHOLE: [(&str, RangeInclusive<u64>, SetWhole); 11] = [
    ("tiles", 1..=1_000_000, Recipe::tiles),
    ("size", 1..=65_535, Recipe::size),
    ("seed", 0..=u64::MAX, Recipe::seed),
    ("evals", 0..=u64::MAX, Recipe::evals),
    ("candidates", 1..=64, Recipe::candidates),
    ("target_sae", 0..=u64::MAX, Recipe::target_sae),
    ("patience", 1..=u64::MAX, Recipe::patience),
    ("births", 0..=u64::MAX, Recipe::births),
    ("batch_births", 1..=1_000_000, Recipe::batch_births),
    ("restarts", 0..=1_000_000, Recipe::restarts),
    ("mitosis", 0..=20, Recipe::mitosis),
];

/// The others.
const REAL: [(&str, RangeInclusive<f64>, SetReal); 7] = [
    ("grout_width", 0.02..=64.0, Recipe::grout_width),
    ("opacity", 0.01..=1.0, Recipe::opacity),
    ("cool", 0.00001..=1.0, Recipe::cool),
    ("p_mutation", 0.0..=1.0, Recipe::p_mutation),
    ("p_crossover", 0.0..=1.0, Recipe::p_crossover),
    ("new_blood", 0.0..=1.0, Recipe::new_blood),
    ("tile_scale", 0.1..=100.0, Recipe::tile_scale),
];

/// Parameters of the paper's scheme; the search in cells refuses them.
const OF_PAPER: [&str; 9] =
    ["births", "batch_births", "restarts", "cool", "p_mutation", "p_crossover", "new_blood", "mitosis", "tile_scale"];

/// A recipe that has the parameter.
fn recipe_with(name: &str) -> Recipe {
    if OF_PAPER.contains(&name) { Recipe::paper().tiles(1_000_000).restarts(20) } else { Recipe::new() }
}

/// Whether `result` is as it must be for a value that its bounds contain or not.
fn is_as_bounds_say(result: Result<(), Error>, is_inside: bool, name: &str, bounds: &[String]) -> Result<(), String> {
    match result {
        Ok(()) if is_inside => Ok(()),
        Err(Error::Parameter { name: refused, reason, .. })
            if !is_inside && refused == name && bounds.iter().all(|bound| reason.contains(bound)) =>
        {
            Ok(())
        }
        result => Err(format!("{name}, inside {is_inside}: {result:?}")),
    }
}

/// Reals of all kinds: usual ones, huge and tiny ones, infinities, NaN.
fn reals() -> impl Strategy<Value = f64> {
    prop_oneof![0.0..2.0, any::<f64>(), Just(f64::NAN), Just(f64::INFINITY), Just(-0.0), Just(64.0), Just(1.0)]
}

/// Whole numbers of all kinds: small ones, bounds, huge ones.
fn wholes() -> impl Strategy<Value = u64> {
    prop_oneof![0..70_u64, 65_530..65_540_u64, 999_990..1_000_010_u64, any::<u64>(), Just(u64::MAX)]
}

/// A random change of a recipe, small enough to be made at once where it is right.
fn changes() -> impl Strategy<Value = fn(Recipe) -> Recipe> {
    let changes: [fn(Recipe) -> Recipe; 24] = [
        |recipe| recipe.scheme(Scheme::Paper),
        |recipe| recipe.scheme(Scheme::Cells),
        |recipe| recipe.color_mode(ColorMode::Mean),
        |recipe| recipe.color_mode(ColorMode::Evolved),
        |recipe| recipe.grout(GroutColor::Auto),
        |recipe| recipe.grout(GroutColor::None),
        |recipe| recipe.grout(GroutColor::This([1, 2, 3])),
        |recipe| recipe.grout_width(2.0),
        |recipe| recipe.blend(Blend::Translucent),
        |recipe| recipe.blend(Blend::Opaque),
        |recipe| recipe.opacity(0.5),
        |recipe| recipe.shader(Shader::Soft),
        |recipe| recipe.masks([Mask::named("flower").unwrap(), Mask::named("disc").unwrap()]),
        |recipe| recipe.restart_masks([Mask::named("lines").unwrap()]),
        |recipe| recipe.restarts(2),
        |recipe| recipe.mitosis(2),
        |recipe| recipe.no_rotation(),
        |recipe| recipe.on_dry(OnDry::Restart),
        |recipe| recipe.batch_births(7),
        |recipe| recipe.colors(3),
        |recipe| recipe.palette(&[[9; 3]]),
        |recipe| recipe.background([200; 3]),
        |recipe| recipe.weight(vec![7; 24]),
        |recipe| recipe.candidates(3),
    ];
    prop::sample::select(changes.to_vec())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(400) })]

    #[test]
    fn a_whole_number_is_taken_within_its_range_and_else_refused_with_it(value in wholes()) {
        for (name, bounds, set) in WHOLE {
            let recipe = set(recipe_with(name), value);
            let ends = [*bounds.start(), *bounds.end()];
            let told: Vec<String> = ends.iter().filter(|&&end| end < u64::MAX).map(u64::to_string).collect();
            let told = is_as_bounds_say(recipe.check(), bounds.contains(&value), name, &told);
            prop_assert!(told.is_ok(), "{told:?}");
        }
    }

    #[test]
    fn a_real_number_is_taken_within_its_range_and_else_refused_with_it(value in reals()) {
        for (name, bounds, set) in REAL {
            let recipe = set(recipe_with(name), value);
            let told = [bounds.start().to_string(), bounds.end().to_string()];
            let told = is_as_bounds_say(recipe.check(), bounds.contains(&value), name, &told);
            prop_assert!(told.is_ok(), "{told:?}");
        }
    }

    #[test]
    fn pixels_are_taken_if_there_are_as_many_as_the_size_says(
        width_px in prop_oneof![0..9_u32, any::<u32>()],
        height_px in prop_oneof![0..9_u32, any::<u32>()],
        bytes in vec(any::<u8>(), 0..200),
    ) {
        let of_rgb = Picture::from_rgb8(width_px, height_px, &bytes);
        let of_rgba = Picture::from_rgba8(width_px, height_px, &bytes);
        for (channels, picture) in [(3, of_rgb), (4, of_rgba)] {
            let pixel_count = u64::from(width_px) * u64::from(height_px);
            let fits = pixel_count > 0 && pixel_count.checked_mul(channels) == Some(bytes.len() as u64);
            match picture {
                Ok(picture) => prop_assert!(fits && picture.size_px() == (width_px, height_px)),
                Err(Error::Parameter { name, .. }) => prop_assert!(!fits && name == "picture"),
                Err(error) => prop_assert!(false, "{error}"),
            }
        }
    }

    #[test]
    fn broken_files_are_refused(
        place in any::<prop::sample::Index>(),
        byte in any::<u8>(),
        cut in any::<prop::sample::Index>(),
    ) {
        for file in [&include_bytes!("../photos/rgb.png")[..], include_bytes!("../photos/plain.jpg")] {
            let mut bytes = file.to_vec();
            let place = place.index(bytes.len());
            bytes[place] = byte;
            bytes.truncate(cut.index(bytes.len() + 1));
            if let Err(error) = Picture::from_encoded(&bytes) {
                prop_assert!(matches!(&error, Error::Parameter { name, .. } if name == "picture"), "{error}");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(300) })]

    #[test]
    fn whatever_is_combined_becomes_a_mosaic_or_a_refusal_by_name(
        named in prop::sample::select(vec!["free", "mosaic", "paint", "spray", "paper-1", "paper-7", "paper-12"]),
        changes in vec(changes(), 0..6),
        tiles in prop_oneof![4 => 1..40_u64, 1 => Just(0)],
        alpha in prop_oneof![4 => Just(255_u8), 1 => Just(0)],
    ) {
        let pixels: Vec<u8> = (0..24).flat_map(|i| [i * 10, 255 - i, i % 7 * 30, alpha]).collect();
        let picture = Picture::from_rgba8(6, 4, &pixels).unwrap();
        let mut recipe = Recipe::named(named).unwrap().tiles(tiles);
        for change in changes {
            recipe = change(recipe);
        }
        recipe = match recipe.scheme_chosen() {
            Scheme::Paper => recipe.births(40),
            Scheme::Cells => recipe.evals(60),
        };
        match recipe.make_quietly(&picture, &Device::cpu()) {
            Ok(mosaic) => prop_assert!(tiles > 0 && mosaic.png().is_ok() && mosaic.svg().is_ok()),
            Err(Error::Parameter { name, reason, .. }) => prop_assert!(!name.is_empty() && !reason.is_empty()),
            Err(error) => prop_assert!(false, "{error}"),
        }
    }
}
