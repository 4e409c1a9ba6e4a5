//! Whether the style `mosaic` lays whole, separate tiles along the contours.

use smalti::model::cells::footprint::Footprint;
use smalti::model::cells::pixel::difference;
use smalti::model::cells::suit::{Look, Suit};
use smalti::model::cells::{Course, Search, Stacks};
use smalti::model::tile::pack;
use smalti::model::{Fly, Target};

use crate::report::{Report, Wanted};
use crate::{Gallery, Task, common};

/// Width in px of the surroundings of a tile's centre, to each side, in which its area is flat or not.
const REACH_PX: i32 = 8;

pub fn measure(gallery: &Gallery, report: &mut Report) {
    for name in ["woman", "parrots", "hats"] {
        let task = Task { target: gallery.target(name, 512), fly_count: 4_000, candidates: 1, evals: 800_000 };
        let (mut search, took) = task.search("mosaic", None);
        let is_set = name == "woman";
        let wanted = |limit: Wanted| if is_set { limit } else { Wanted::Anything };
        report.section(&format!("Style mosaic, {name}, 512 px, N=4000, 800k evals ({:.1} s)", took.as_secs_f64()));

        let stacks = search.read_back_stacks().expect("the search works");
        let flies = search.read_back().expect("the search works").flies;
        let course = search.course();
        let pixel_count = stacks.pixels.len() as f64;
        let share = |is_counted: fn(usize) -> bool| {
            stacks.pixels.iter().filter(|stack| is_counted(stack.len())).count() as f64 * 100.0 / pixel_count
        };
        report.row("pixels covered twice or more, %", share(|depth| depth >= 2), wanted(Wanted::AtMost(16.0)), 2);
        report.row("pixels uncovered, %", share(|depth| depth == 0), wanted(Wanted::AtMost(0.5)), 2);
        report.row("largest aspect", largest_aspect(&flies), wanted(Wanted::AtMost(1.6)), 3);
        let (sae, grout) = sae_outside_grout(course, &stacks, &flies);
        report.row("SAE outside the grout", sae as f64, wanted(Wanted::AtMost(5_300_000.0)), 0);
        report.row("pixels of grout, %", grout as f64 * 100.0 / pixel_count, Wanted::Anything, 1);
        measure_angles(course, &flies, report, wanted);
        let mosaic = common::cells::draw(&mut search);
        let away_percent = (mean_luma(&mosaic.pixels) / mean_luma(task.target.pixels()) - 1.0).abs() * 100.0;
        report.row("mean luma away from the target's, %", away_percent, wanted(Wanted::AtMost(3.0)), 2);
    }
}

fn living(flies: &[Fly]) -> impl Iterator<Item = &Fly> {
    flies.iter().filter(|fly| fly.alive)
}

fn largest_aspect(flies: &[Fly]) -> f64 {
    living(flies).map(|fly| f64::from(fly.w.max(fly.h)) / f64::from(fly.w.min(fly.h))).fold(1.0, f64::max)
}

/// The SAE of all pixels that do not show grout, and how many do.
fn sae_outside_grout(course: &Course, stacks: &Stacks, flies: &[Fly]) -> (u64, u64) {
    let Course { rules, target, masks, .. } = course;
    let width = target.width_px();
    let (mut sae, mut grout) = (0, 0);
    for (place, (stack, &color)) in stacks.pixels.iter().zip(target.pixels()).enumerate() {
        let Some(&(top, error)) = stack.first() else {
            sae += u64::from(difference(pack(color), rules.background).unsigned_abs());
            continue;
        };
        let fly = &flies[top as usize];
        let footprint = Footprint::of(fly, (width, target.height_px()));
        let (u, v) = footprint.coordinates((place % width as usize) as i32, (place / width as usize) as i32);
        match Suit::of(fly, masks, rules).look(&footprint, u as u32, v as u32) {
            Some(Look::Grout) => grout += 1,
            _ => sae += u64::from(error.unsigned_abs()),
        }
    }
    (sae, grout)
}

/// Medians of the angle between tile and field, modulo 90 degrees: over all tiles, over the quarter of tiles where the
/// picture is flattest, and over the tiles where the field is not sure of its direction.
fn measure_angles(course: &Course, flies: &[Fly], report: &mut Report, wanted: impl Fn(Wanted) -> Wanted) {
    let guide = &course.guide;
    let mut tiles: Vec<(f64, f64, u16)> = living(flies)
        .map(|fly| {
            let local = guide.at(fly.x >> 6, fly.y >> 6);
            let turned = fly.angle.wrapping_sub(local.direction).wrapping_add(1 << 13) & 0x3FFF;
            let deviation_deg = f64::from(i32::from(turned) - (1 << 13)).abs() * 360.0 / 65_536.0;
            (steepness(&course.target, (fly.x >> 6, fly.y >> 6)), deviation_deg, local.coherence)
        })
        .collect();
    tiles.sort_by(|one, other| one.0.total_cmp(&other.0));
    let all = median(tiles.iter().map(|tile| tile.1));
    let flat = median(tiles[..tiles.len() / 4].iter().map(|tile| tile.1));
    let unsure: Vec<f64> = tiles.iter().filter(|tile| tile.2 < 64).map(|tile| tile.1).collect();
    report.row("median angle to the field, degrees", all, wanted(Wanted::AtMost(12.0)), 2);
    report.row("the same in the flattest quarter", flat, wanted(Wanted::AtMost(12.0)), 2);
    let what = format!("the same at coherence below a quarter, {} tiles", unsure.len());
    if !unsure.is_empty() {
        report.row(&what, median(unsure.into_iter()), wanted(Wanted::AtMost(12.0)), 2);
    }
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Mean difference of luma between neighbours around a place.
fn steepness(target: &Target, (x, y): (i32, i32)) -> f64 {
    let (width, height) = (target.width_px() as i32, target.height_px() as i32);
    let at = |x: i32, y: i32| luma(target.pixels()[(y.clamp(0, height - 1) * width + x.clamp(0, width - 1)) as usize]);
    let around = -REACH_PX..=REACH_PX;
    let sum: f64 = around
        .clone()
        .flat_map(|dy| around.clone().map(move |dx| (x + dx, y + dy)))
        .map(|(x, y)| (at(x + 1, y) - at(x, y)).abs() + (at(x, y + 1) - at(x, y)).abs())
        .sum();
    sum / f64::from((2 * REACH_PX + 1).pow(2))
}

fn luma([r, g, b]: [u8; 3]) -> f64 {
    0.299 * f64::from(r) + 0.587 * f64::from(g) + 0.114 * f64::from(b)
}

fn mean_luma(pixels: &[[u8; 3]]) -> f64 {
    pixels.iter().map(|&pixel| luma(pixel)).sum::<f64>() / pixels.len() as f64
}
