//! The built-in templates in every shader: their texels for ever, and what must be true of each.

use std::fs;
use std::path::Path;

use sha2::{Digest, Sha256};
use smalti::model::Mask;
use smalti::model::mask::{COVERAGE_THRESHOLD, shaded};
use smalti::shapes::{BuiltIn, Shader};

use super::{SIDE, mask, mean_in, pairs};

/// One line per mask: template, shader, SHA-256 of the texels, each two bytes, coverage and shade, row by row.
const GOLDEN: &str = "tests/golden/MASKS";
/// Set to anything, it lets the test write [`GOLDEN`] anew.
const UPDATE: &str = "SMALTI_UPDATE_MASKS";

#[test]
fn every_mask_has_the_texels_it_always_had() {
    let hash = |mask: &Mask| -> String {
        let bytes: Vec<u8> = mask.texels().iter().flat_map(|texel| [texel.coverage, texel.shade]).collect();
        Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
    };
    let found: String =
        pairs().map(|(shape, shader)| format!("{shape} {shader} {}\n", hash(&mask(shape, shader)))).collect();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(GOLDEN);
    if std::env::var_os(UPDATE).is_some() {
        fs::write(&path, &found).unwrap();
    }
    let expected = fs::read_to_string(&path).unwrap_or_default();
    let changed: Vec<&str> = found.lines().filter(|line| !expected.lines().any(|old| old == *line)).collect();
    assert!(
        found == expected,
        "the texels of these masks are not those of {GOLDEN}: {changed:#?}\nif the drawings were meant to change, look \
         at them, raise `evolve::ALGORITHM_VERSION`, and run\n    {UPDATE}=1 cargo test --test suite shapes::masks"
    );
}

#[test]
fn all_masks_differ_but_those_of_the_square_that_has_no_relief() {
    let all: Vec<_> = pairs().map(|(shape, shader)| (shape, shader, mask(shape, shader))).collect();
    for (index, (shape, shader, mask)) in all.iter().enumerate() {
        let twin = all[..index].iter().find(|(_, _, other)| other == mask);
        let Some((other_shape, other_shader, _)) = twin else { continue };
        // A border is a square with another intensity.
        let is_square = |shape| matches!(shape, BuiltIn::Square | BuiltIn::Border);
        assert!(
            is_square(*shape) && is_square(*other_shape),
            "{shape} in {shader} is the same as {other_shape} in {other_shader}"
        );
    }
}

#[test]
fn the_flat_square_is_the_square_of_the_engine() {
    assert_eq!(mask(BuiltIn::Square, Shader::Flat), Mask::square());
}

#[test]
fn every_mask_covers_enough_to_be_seen_as_an_opaque_tile() {
    for (shape, shader) in pairs() {
        let mask = mask(shape, shader);
        let solid = mask.texels().iter().filter(|texel| texel.coverage >= COVERAGE_THRESHOLD).count();
        assert!(solid * 100 >= mask.texels().len() * 8, "{shape} in {shader} has only {solid} solid texels");
    }
}

#[test]
fn no_mask_is_so_dark_that_a_light_colour_is_out_of_reach() {
    for (shape, shader) in pairs() {
        let mask = mask(shape, shader);
        let (mut sum, mut weight) = (0_u64, 0_u64);
        for texel in mask.texels() {
            sum += u64::from(texel.coverage) * u64::from(shaded(255, u32::from(texel.shade)));
            weight += u64::from(texel.coverage);
        }
        assert!(sum / weight >= 150, "{shape} in {shader} has a mean shade of {}", sum / weight);
    }
}

#[test]
fn no_template_is_lit_where_it_is_a_hole_and_every_one_reaches_full_alpha_and_intensity() {
    for shape in BuiltIn::ALL {
        let template = shape.template();
        assert_eq!(template.ink().iter().map(|ink| ink.alpha).max(), Some(255), "{shape}");
        let brightest = template.ink().iter().filter(|ink| ink.alpha == 255).map(|ink| ink.intensity).max();
        assert!(brightest >= Some(250), "{shape} is nowhere brighter than {brightest:?}");
    }
}

#[test]
fn regular_shapes_are_symmetric() {
    use BuiltIn::{Border, Disc, Flower, Hexagon, Lines, Square, Triangle};
    let last = SIDE - 1;
    for shape in [Square, Border, Lines, Flower, Disc, Hexagon, Triangle] {
        let flat = mask(shape, Shader::Flat);
        for row in 0..SIDE {
            for column in 0..SIDE {
                let texel = flat.texel(column, row);
                assert_eq!(texel, flat.texel(last - column, row), "{shape}, left and right, at {column}, {row}");
                if shape != Triangle {
                    assert_eq!(texel, flat.texel(column, last - row), "{shape}, top and bottom, at {column}, {row}");
                }
            }
        }
    }
}

#[test]
fn shapes_fill_their_box() {
    for shape in BuiltIn::ALL.into_iter().filter(|shape| *shape != BuiltIn::Brush) {
        let flat = mask(shape, Shader::Flat);
        let any = |column: u32, row: u32| flat.texel(column, row).coverage > 0;
        assert!((0..SIDE).any(|column| any(column, 0)), "{shape} does not reach the top");
        assert!((0..SIDE).any(|column| any(column, SIDE - 1)), "{shape} does not reach the bottom");
        // The petals point up and down, so a flower's sides are a little short of the box.
        let margin = if shape == BuiltIn::Flower { 16 } else { 0 };
        assert!((0..SIDE).any(|row| any(margin, row)), "{shape} does not reach the left");
        assert!((0..SIDE).any(|row| any(SIDE - 1 - margin, row)), "{shape} does not reach the right");
    }
}

#[test]
fn the_border_is_darker_than_what_it_encloses_and_its_negative_is_not() {
    let shade = |mask: &Mask, column| mask.texel(column, 128).shade;
    let border = mask(BuiltIn::Border, Shader::Template);
    assert!(shade(&border, 4) < 100 && shade(&border, 128) == 255);
    let negative = mask(BuiltIn::Border, Shader::Negative);
    assert!(shade(&negative, 4) == 255 && shade(&negative, 128) < 150);
}

#[test]
fn stripes_have_gaps_even_on_a_tile_of_eight_pixels() {
    let lines = mask(BuiltIn::Lines, Shader::Flat);
    for offset in 0..32 {
        let rows = (0..8).map(|row| lines.texel(128, row * 32 + offset).coverage >= COVERAGE_THRESHOLD);
        let solid = rows.filter(|solid| *solid).count();
        assert!((3..=5).contains(&solid), "{solid} of 8 px are solid at offset {offset}");
    }
}

#[test]
fn the_middle_of_a_flower_is_darker_than_its_petals() {
    let flower = mask(BuiltIn::Flower, Shader::Template);
    let middle = mean_in(&flower, 118..138, 118..138, |texel| texel.shade);
    let petal = mean_in(&flower, 108..122, 20..40, |texel| texel.shade);
    assert!(middle + 50 < petal, "{middle} in the middle, {petal} on a petal");
}

#[test]
fn a_brush_leaves_streaks_and_less_paint_at_its_end() {
    let stroke = mask(BuiltIn::Brush, Shader::Flat);
    let coverage = |columns| mean_in(&stroke, columns, 60..196, |texel| texel.coverage);
    assert!(coverage(40..80) > coverage(120..160) + 10 && coverage(120..160) > coverage(190..230) + 10);
    let thin = stroke.texels().iter().filter(|texel| (60..220).contains(&texel.coverage)).count();
    assert!(thin > 5000, "only {thin} texels are half covered");
}

#[test]
fn soft_masks_thin_out_towards_the_edge() {
    for shape in [BuiltIn::Square, BuiltIn::Disc, BuiltIn::Hexagon] {
        let soft = mask(shape, Shader::Soft);
        let row: Vec<u8> = (128..SIDE).map(|column| soft.texel(column, 128).coverage).collect();
        assert!(row.is_sorted_by(|a, b| a >= b), "{shape}: {row:?}");
        assert!(row[0] == 255 && row[127] < 8, "{shape} goes from {} to {}", row[0], row[127]);
    }
}

#[test]
fn embossed_masks_are_lit_from_the_upper_left() {
    for shape in [BuiltIn::Square, BuiltIn::Disc, BuiltIn::Hexagon] {
        let emboss = mask(shape, Shader::Emboss);
        let shade = |first: u32| {
            let range = first..first + 8;
            mean_in(&emboss, range.clone(), range, |texel| texel.shade)
        };
        // A disc's bevel meets the diagonal a good seventh of a side from the corner.
        let near = if shape == BuiltIn::Square { 8 } else { 46 };
        let (lit, level, dark) = (shade(near), shade(124), shade(SIDE - near - 8));
        assert!(lit > level + 20 && level > dark + 50, "{shape}: {lit}, {level}, {dark}");
    }
}

#[test]
fn an_outline_is_dark_along_the_edge_and_full_inside() {
    for shape in [BuiltIn::Square, BuiltIn::Disc, BuiltIn::Lines] {
        let outline = mask(shape, Shader::Outline);
        // The middle of the stripes' first cord; the other shapes' middle.
        let row = if shape == BuiltIn::Lines { 18 } else { 128 };
        assert!(outline.texel(2, row).shade < 80 && outline.texel(128, row).shade == 255, "{shape}");
    }
}

#[test]
fn a_hollow_mask_has_a_rim_and_no_middle() {
    for shape in [BuiltIn::Square, BuiltIn::Disc, BuiltIn::Triangle, BuiltIn::Flower] {
        let hollow = mask(shape, Shader::Hollow);
        assert_eq!(hollow.texel(128, 140).coverage, 0, "{shape}");
        let rows = (0..SIDE).filter(|&row| hollow.texel(128, row).coverage == 255).count();
        assert!((20..110).contains(&rows), "{shape}'s rim is {rows} texels thick in all");
    }
}

#[test]
fn a_fading_mask_thins_out_from_top_to_bottom() {
    let fade = mask(BuiltIn::Square, Shader::Fade);
    let column: Vec<u8> = (0..SIDE).map(|row| fade.texel(9, row).coverage).collect();
    assert!(column.is_sorted_by(|a, b| a >= b) && column[0] == 255 && column[255] < 30, "{column:?}");
}

#[test]
fn a_wash_is_densest_along_its_edge_and_has_a_grain() {
    let wash = mask(BuiltIn::Disc, Shader::Wash);
    let rim = mean_in(&wash, 3..7, 120..136, |texel| texel.coverage);
    let inside = mean_in(&wash, 80..176, 80..176, |texel| texel.coverage);
    assert!(rim > inside + 60, "{rim} on the rim, {inside} inside");
    let grains: std::collections::BTreeSet<u8> = (80..176).map(|column| wash.texel(column, 128).coverage).collect();
    assert!(grains.len() > 8, "only {} levels inside", grains.len());
}

#[test]
fn names_are_read_back_and_wrong_ones_are_answered_with_all_names() {
    for shape in BuiltIn::ALL {
        assert_eq!(shape.name().parse::<BuiltIn>().unwrap(), shape);
    }
    for shader in Shader::ALL {
        assert_eq!(shader.name().parse::<Shader>().unwrap(), shader);
    }
    assert_eq!(
        "star".parse::<BuiltIn>().unwrap_err().to_string(),
        "there is no built-in mask `star`; there are square, border, lines, flower, disc, triangle, hexagon, brush"
    );
    assert_eq!(
        "star".parse::<Shader>().unwrap_err().to_string(),
        "there is no shader `star`; there are flat, template, outline, emboss, soft, hollow, negative, fade, wash"
    );
}

#[test]
fn descriptions_are_one_line_each_and_all_different() {
    let shapes = BuiltIn::ALL.into_iter().map(BuiltIn::description);
    let descriptions: Vec<&str> = shapes.chain(Shader::ALL.into_iter().map(Shader::description)).collect();
    for (index, description) in descriptions.iter().enumerate() {
        assert!((10..110).contains(&description.len()) && !description.contains('\n'), "{description}");
        assert!(!description.ends_with('.') && !descriptions[..index].contains(description), "{description}");
    }
}
