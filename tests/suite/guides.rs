//! The maps that guide a search: directions along contours and sizes that follow detail.

use std::path::Path;

use sha2::{Digest, Sha256};
use smalti::guide::{Flow, flowing, sharp};
use smalti::model::guide::{GUIDE_PX, SIZE_ONE};
use smalti::model::{Guide, GuideSample, Target};
use smalti::photo::{ReadOptions, read};

/// For tiles with a side of 8 px.
const FLOW: Flow<'_> = Flow { tile_side: 8 * 64, smoothing: 16 * 64, size_strength_q8: 256, weights: None };

/// A picture whose pixels mix two colours by `share`, clamped to 0 to 1, of the place.
fn picture(width_px: u32, height_px: u32, share: impl Fn(f64, f64) -> f64) -> Target {
    let pixel = |place: u32| {
        let share = share(f64::from(place % width_px), f64::from(place / width_px)).clamp(0.0, 1.0);
        [(40.0, 200.0), (60.0, 90.0), (150.0, 130.0)].map(|(dark, light)| (dark + (light - dark) * share + 0.5) as u8)
    };
    Target::new(width_px, height_px, (0..width_px * height_px).map(pixel).collect()).unwrap()
}

/// Distance of a pixel from the centre of a picture of 256x256 px, and the angle at which it lies.
fn polar(x: f64, y: f64) -> (f64, f64) {
    let (x, y) = (x - 127.5, y - 127.5);
    (x.hypot(y), y.atan2(x).to_degrees())
}

/// A disc of 60 px in a picture of 256x256 px.
fn disc() -> Target {
    picture(256, 256, |x, y| 60.5 - polar(x, y).0)
}

/// The photograph's pixels from `(x0, y0)` on.
fn parrots(x0: u32, y0: u32, width_px: u32, height_px: u32) -> Target {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/photos/parrots.png");
    let photo = read(&path, &ReadOptions::default()).unwrap().photo;
    let pixel = |place| photo.pixels[((y0 + place / width_px) * photo.width_px + x0 + place % width_px) as usize];
    Target::new(width_px, height_px, (0..width_px * height_px).map(pixel).collect()).unwrap()
}

/// The angle between a direction and one in degrees, 0 to 90.
fn error_deg(direction: u16, expected_deg: f64) -> f64 {
    let difference = (f64::from(direction) * 360.0 / 65_536.0 - expected_deg).rem_euclid(180.0);
    difference.min(180.0 - difference)
}

/// Every sample's place in px, and its index.
fn places(guide: &Guide) -> impl Iterator<Item = (f64, f64, usize)> + use<> {
    let (columns, middle) = (guide.columns as usize, f64::from(GUIDE_PX - 1) / 2.0);
    let px = move |place: usize| f64::from(GUIDE_PX) * place as f64 + middle;
    (0..guide.samples.len()).map(move |place| (px(place % columns), px(place / columns), place))
}

/// Mean of `1 / size^2` over the pixels.
fn tiles_per_tile(guide: &Guide, target: &Target) -> f64 {
    let (width, height) = (target.width_px() as i32, target.height_px() as i32);
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let area = |(x, y)| (f64::from(SIZE_ONE) / f64::from(guide.at(x, y).size_q12)).powi(2);
    pixels.map(area).sum::<f64>() / f64::from(width * height)
}

fn short_hash(guide: &Guide) -> String {
    Sha256::digest(bytemuck::cast_slice(&guide.samples)).iter().take(8).map(|byte| format!("{byte:02x}")).collect()
}

#[test]
fn along_a_straight_edge_both_guides_have_its_direction() {
    for expected_deg in [0.0, 17.0, 45.0, 90.0, 120.0, 135.0, 171.0_f64] {
        let (sin, cos) = expected_deg.to_radians().sin_cos();
        let distance = |x: f64, y: f64| (y - 60.3) * cos - (x - 63.7) * sin;
        let target = picture(128, 120, |x, y| distance(x, y) + 0.5);
        let (sharp, flowing) = (sharp(&target), flowing(&target, &FLOW));
        for (x, y, place) in places(&sharp) {
            let flow = flowing.samples[place];
            assert!(error_deg(flow.direction, expected_deg) < 2.0, "{expected_deg} at {x}, {y}: {flow:?}");
            // At the border of the picture the edge is cut off.
            let is_inside = (4.0..124.0).contains(&x) && (4.0..116.0).contains(&y);
            if is_inside && distance(x, y).abs() < 2.0 {
                let edge = sharp.samples[place];
                assert!(error_deg(edge.direction, expected_deg) < 2.0, "{expected_deg} at {x}, {y}: {edge:?}");
                assert!(edge.coherence > 225 && flow.coherence > 225, "{expected_deg} at {x}, {y}: {edge:?}, {flow:?}");
            } else if distance(x, y).abs() > 18.0 {
                assert_eq!(sharp.samples[place].coherence, 0, "{expected_deg} at {x}, {y}");
            }
        }
    }
}

#[test]
fn around_a_disc_the_flow_is_concentric_inside_and_outside() {
    let target = disc();
    let (sharp, flowing) = (sharp(&target), flowing(&target, &FLOW));
    for (x, y, place) in places(&sharp) {
        let (radius, angle) = polar(x, y);
        if (radius - 60.0).abs() < 2.0 {
            let edge = sharp.samples[place];
            assert!(error_deg(edge.direction, angle + 90.0) < 2.0 && edge.coherence > 200, "{x}, {y}: {edge:?}");
        }
        if (8.0..120.0).contains(&radius) {
            let flow = flowing.samples[place];
            let bound = if (radius - 60.0).abs() < 8.0 { 4.0 } else { 15.0 };
            assert!(error_deg(flow.direction, angle + 90.0) < bound, "{x}, {y}: {flow:?}");
        }
    }
}

#[test]
fn noise_in_flat_areas_does_not_turn_the_flow() {
    let mut pixels = disc().pixels().to_vec();
    let mut state = 7_u32;
    for channel in pixels.as_flattened_mut() {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *channel = channel.wrapping_add((state >> 24) as u8 % 13).wrapping_sub(6);
    }
    let guide = flowing(&Target::new(256, 256, pixels).unwrap(), &FLOW);
    let ring = places(&guide).filter(|&(x, y, _)| (12.0..115.0).contains(&polar(x, y).0));
    let errors: Vec<f64> =
        ring.map(|(x, y, place)| error_deg(guide.samples[place].direction, polar(x, y).1 + 90.0)).collect();
    assert!(errors.iter().all(|&error| error < 25.0), "{:?}", errors.iter().copied().fold(0.0, f64::max));
    assert!(errors.iter().sum::<f64>() / (errors.len() as f64) < 5.0);
}

#[test]
fn a_picture_of_one_colour_has_no_direction_and_equal_sizes() {
    for (width_px, height_px) in [(1, 1), (3, 9), (64, 64), (101, 30)] {
        let target = picture(width_px, height_px, |_, _| 0.5);
        for guide in [sharp(&target), flowing(&target, &FLOW)] {
            assert_eq!((guide.columns, guide.rows), (width_px.div_ceil(GUIDE_PX), height_px.div_ceil(GUIDE_PX)));
            assert_eq!(guide.samples.len(), (guide.columns * guide.rows) as usize);
            let flat = |sample: GuideSample| (sample.direction, sample.coherence, sample.size_q12) == (0, 0, SIZE_ONE);
            assert!(guide.samples.iter().copied().all(flat), "{guide:?}");
        }
    }
}

#[test]
fn a_picture_turned_by_a_quarter_has_the_guide_turned_by_a_quarter() {
    let target = parrots(300, 100, 128, 256);
    // Clockwise: the row at the top comes from the column at the left, from below.
    let source = |place: usize| target.pixels()[(255 - place % 256) * 128 + place / 256];
    let turned = Target::new(256, 128, (0..256 * 128).map(source).collect()).unwrap();
    for (guide, turned) in [(sharp(&target), sharp(&turned)), (flowing(&target, &FLOW), flowing(&turned, &FLOW))] {
        for (place, &found) in turned.samples.iter().enumerate() {
            let mut expected = guide.samples[(63 - place % 64) * 32 + place / 64];
            expected.direction = (expected.direction + 16_384) % 32_768;
            assert_eq!(found, expected, "sample {place}");
        }
    }
}

#[test]
fn lengths_beyond_all_use_still_give_a_guide() {
    let target = disc();
    let (stiff, loose) = (Flow { smoothing: u32::MAX, ..FLOW }, Flow { smoothing: 0, ..FLOW });
    let coherence = |flow: &Flow<'_>| flowing(&target, flow).at(127, 67).coherence;
    assert!(coherence(&stiff) < 100 && coherence(&loose) > 240, "{} {}", coherence(&stiff), coherence(&loose));
    for tile_side in [0, u32::MAX] {
        let guide = flowing(&target, &Flow { tile_side, size_strength_q8: u32::MAX, ..FLOW });
        let count = tiles_per_tile(&guide, &target);
        assert!((count - 1.0).abs() < 0.01, "{tile_side}: {count}");
    }
}

#[test]
fn sizes_fill_the_picture_once_whatever_their_strength() {
    for target in [parrots(0, 0, 512, 512), parrots(37, 90, 203, 322), disc()] {
        for size_strength_q8 in [0, 100, 256, 1_000] {
            let guide = flowing(&target, &Flow { size_strength_q8, ..FLOW });
            let (least, most) = (2_458, 6_963);
            assert!(guide.samples.iter().all(|sample| (least..=most).contains(&sample.size_q12)));
            let count = tiles_per_tile(&guide, &target);
            assert!((count - 1.0).abs() < 0.01, "{size_strength_q8}: {count}");
            assert_eq!(size_strength_q8 == 0, guide.samples.iter().all(|sample| sample.size_q12 == SIZE_ONE));
        }
    }
}

#[test]
fn tiles_are_smaller_where_there_is_detail_and_neighbours_have_similar_sizes() {
    let target = parrots(0, 0, 512, 512);
    let guide = flowing(&target, &FLOW);
    let size = |x, y| guide.at(x, y).size_q12;
    let (eye, beak, wall) = (size(410, 168), size(320, 220), size(260, 60));
    assert!(eye < SIZE_ONE * 7 / 10 && eye < beak && beak < wall && wall > SIZE_ONE * 5 / 4, "{eye} {beak} {wall}");
    for (guide, side) in [(guide, 512), (flowing(&disc(), &FLOW), 256)] {
        for (x, y) in (0..side).flat_map(|y| (0..side).map(move |x| (x, y))) {
            let (here, beside, below) = (guide.at(x, y), guide.at(x + 8, y), guide.at(x, y + 8));
            let [here, beside, below] = [here, beside, below].map(|sample| sample.size_q12);
            assert!(here.abs_diff(beside).max(here.abs_diff(below)) * 3 < here, "{x}, {y}: {here} {beside} {below}");
        }
    }
}

#[test]
fn sizes_do_not_depend_on_contrast() {
    let target = parrots(0, 0, 512, 512);
    let pale = target.pixels().iter().map(|pixel| pixel.map(|channel| 100 + channel / 3)).collect();
    let pale = flowing(&Target::new(512, 512, pale).unwrap(), &FLOW);
    let full = flowing(&target, &FLOW);
    for (full, pale) in full.samples.iter().zip(&pale.samples) {
        assert!(full.size_q12.abs_diff(pale.size_q12) * 20 < full.size_q12, "{full:?} {pale:?}");
    }
}

#[test]
fn weights_make_tiles_smaller_where_they_are_high_and_change_nothing_where_all_are_alike() {
    let target = parrots(0, 0, 512, 512);
    let guide = |weights: Option<&[u8]>| flowing(&target, &Flow { weights, ..FLOW });
    let plain = guide(None);
    for weight in [0, 1, 9, 16] {
        assert!(guide(Some(&[weight; 512 * 512])) == plain, "all weights are {weight}");
    }
    let right: Vec<u8> = (0..512 * 512).map(|place| if place % 512 < 256 { 1 } else { 16 }).collect();
    let weighted = guide(Some(&right));
    assert!((tiles_per_tile(&weighted, &target) - 1.0).abs() < 0.01);
    let mean = |guide: &Guide, x: i32| (0..512).map(|y| guide.at(x, y).size_q12).sum::<u32>() / 512;
    for x in 0..512 {
        let (weighted, plain) = (mean(&weighted, x), mean(&plain, x));
        match x {
            0..200 => assert!(weighted * 10 > plain * 11, "column {x}: {weighted} {plain}"),
            312.. => assert!(weighted * 11 < plain * 10, "column {x}: {weighted} {plain}"),
            _ => {}
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_guides_of_this_version() {
    let target = parrots(0, 0, 512, 512);
    let guides = |thread_count| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(thread_count).build().unwrap();
        pool.install(|| [sharp(&target), flowing(&target, &FLOW)])
    };
    let one = guides(1);
    assert!(one == guides(2), "two threads give another guide");
    assert_eq!(
        one.each_ref().map(short_hash),
        ["d43ff82a608a4e24", "81b946dbf6f4963e"],
        "raise evolve::ALGORITHM_VERSION if mosaics change with it"
    );
}
