//! How diverse a population is, gene by gene.
//!
//! These are floats, since they decide nothing. They are the same on every machine, since they come from sums in a
//! fixed order, roots, tables, and `libm`.

use crate::model::Fly;
use crate::model::fly::{UNITS_PER_PX, Z_MAX, position_max};
use crate::model::tables::{TRIG_ONE, cos_sin};

/// The spread of the living flies' genes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spread {
    /// Clark-Evans index ("Distance to nearest neighbor as a measure of spatial relationships in populations", Ecology
    /// 35, 1954) of the positions: the mean distance to the nearest neighbour over its expectation for random
    /// positions. 1 is random, less is clustered, 0 is all in one place, more is regular, at most 2.15. The expectation
    /// is corrected for the borders as by Donnelly (1978): `sqrt(A / N) / 2 + (0.0514 + 0.041 / sqrt(N)) * P / N` with
    /// area A and perimeter P. `None` for fewer than two flies, or if the centres have no area to lie in.
    pub clark_evans: Option<f64>,
    /// Standard deviation of the depth over that of uniform depths, range / sqrt(12).
    pub z: f64,
    /// Root of the mean variance of the three channels, over the standard deviation of uniform channels.
    pub color: f64,
    /// Standard deviation of ln(sqrt(width * height)): 0.1 means that sizes differ by about 10 %.
    pub log_size: f64,
    /// Circular variance of the angle, `1 - |mean of (cos, sin)|` (Mardia and Jupp, "Directional Statistics", 2000): 0
    /// if all are alike, 1 if they cancel out.
    pub angle: f64,
}

impl Spread {
    /// The spread of the living flies of a population for a picture of `width_px` x `height_px`.
    #[must_use]
    pub fn of(flies: &[Fly], width_px: u32, height_px: u32) -> Self {
        let living: Vec<&Fly> = flies.iter().filter(|fly| fly.alive).collect();
        if living.is_empty() {
            return Self::default();
        }
        let channel = |gene: fn(&Fly) -> u16| variance(living.iter().map(|fly| f64::from(gene(fly))));
        let channels = channel(|fly| fly.r) + channel(|fly| fly.g) + channel(|fly| fly.b);
        let log_size = |fly: &&Fly| 0.5 * libm::log(f64::from(fly.w) * f64::from(fly.h));
        Self {
            clark_evans: clark_evans(&living, width_px, height_px),
            z: of_uniform(variance(living.iter().map(|fly| f64::from(fly.z))), f64::from(Z_MAX)),
            color: of_uniform(channels / 3.0, 65_535.0),
            log_size: variance(living.iter().map(log_size)).sqrt(),
            angle: circular_variance(&living),
        }
    }
}

/// A variance as a standard deviation, divided by that of uniform values in this range.
fn of_uniform(variance: f64, range: f64) -> f64 {
    (variance * 12.0).sqrt() / range
}

fn variance(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let count = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / count;
    values.map(|value| (value - mean) * (value - mean)).sum::<f64>() / count
}

fn circular_variance(flies: &[&Fly]) -> f64 {
    let mut sum = (0_i64, 0_i64);
    for fly in flies {
        let (cos, sin) = cos_sin(fly.angle);
        sum = (sum.0 + i64::from(cos), sum.1 + i64::from(sin));
    }
    let (x, y) = (sum.0 as f64, sum.1 as f64);
    1.0 - (x * x + y * y).sqrt() / (f64::from(TRIG_ONE) * flies.len() as f64)
}

fn clark_evans(flies: &[&Fly], width_px: u32, height_px: u32) -> Option<f64> {
    let sides = [width_px, height_px].map(|px| f64::from(position_max(px)));
    let (area, perimeter) = (sides[0] * sides[1], 2.0 * (sides[0] + sides[1]));
    if flies.len() < 2 || area == 0.0 {
        return None;
    }
    let count = flies.len() as f64;
    let mean = Grid::new(flies, width_px, height_px).nearest_distances().sum::<f64>() / count;
    let expected = 0.5 * (area / count).sqrt() + (0.0514 + 0.041 / count.sqrt()) * perimeter / count;
    Some(mean / expected)
}

/// Positions sorted into square cells that hold about one each if they are random.
struct Grid {
    cell: i64,
    columns: i64,
    rows: i64,
    cells: Vec<Vec<(i64, i64)>>,
}

impl Grid {
    fn new(flies: &[&Fly], width_px: u32, height_px: u32) -> Self {
        let units = i64::from(UNITS_PER_PX);
        let (width, height) = (i64::from(width_px) * units, i64::from(height_px) * units);
        let cell = ((width * height / flies.len() as i64) as u64).isqrt().max(1) as i64;
        let (columns, rows) = (width / cell + 1, height / cell + 1);
        let mut cells = vec![Vec::new(); (columns * rows) as usize];
        for fly in flies {
            let (x, y) = (i64::from(fly.x), i64::from(fly.y));
            cells[(y / cell * columns + x / cell) as usize].push((x, y));
        }
        Self { cell, columns, rows, cells }
    }

    /// For each position the distance to the nearest other one, in 1/64 px. There must be at least two.
    fn nearest_distances(&self) -> impl Iterator<Item = f64> {
        let positions = (0..self.rows).flat_map(move |row| (0..self.columns).map(move |column| (column, row)));
        positions.flat_map(move |(column, row)| {
            let here = &self.cells[(row * self.columns + column) as usize];
            (0..here.len()).map(move |number| (self.nearest_square(here[number], number, (column, row)) as f64).sqrt())
        })
    }

    /// Square of the distance from a position, number `number` in its cell, to the nearest other one. Searches cells
    /// ring by ring.
    fn nearest_square(&self, (x, y): (i64, i64), number: usize, (column, row): (i64, i64)) -> i64 {
        let mut nearest = i64::MAX;
        for ring in 0..=self.columns.max(self.rows) {
            // Positions in this ring or beyond are at least as far away as the ring's inner edge.
            let reach = (ring - 1).max(0) * self.cell;
            if nearest <= reach * reach {
                break;
            }
            for other_row in (row - ring).max(0)..=(row + ring).min(self.rows - 1) {
                let is_whole_row = (other_row - row).abs() == ring;
                let step = if is_whole_row || ring == 0 { 1 } else { 2 * ring };
                for other_column in (column - ring..=column + ring).step_by(step as usize) {
                    if !(0..self.columns).contains(&other_column) {
                        continue;
                    }
                    let others = &self.cells[(other_row * self.columns + other_column) as usize];
                    for (place, &(ox, oy)) in others.iter().enumerate() {
                        if ring > 0 || place != number {
                            nearest = nearest.min((ox - x).pow(2) + (oy - y).pow(2));
                        }
                    }
                }
            }
        }
        nearest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evolve::evolution::random_population;

    fn index(flies: &[Fly]) -> f64 {
        Spread::of(flies, 256, 256).clark_evans.expect("there are several flies")
    }

    /// Mean distance to the nearest neighbour by looking at all pairs.
    fn mean_by_all_pairs(flies: &[Fly]) -> f64 {
        let nearest = |fly: &Fly, own: usize| {
            let square = |other: &Fly| i64::from(other.x - fly.x).pow(2) + i64::from(other.y - fly.y).pow(2);
            let others = flies.iter().enumerate().filter(|(place, _)| *place != own);
            (others.map(|(_, other)| square(other)).min().expect("there is another") as f64).sqrt()
        };
        flies.iter().enumerate().map(|(own, fly)| nearest(fly, own)).sum::<f64>() / flies.len() as f64
    }

    #[test]
    fn random_positions_have_the_index_1_and_clusters_less() {
        let random = random_population(256, 256, 2_500, 1);
        assert!((index(&random) - 1.0).abs() < 0.03, "{}", index(&random));
        let clustered: Vec<Fly> =
            random.iter().map(|fly| Fly { x: fly.x / 2048 * 2048 + fly.x % 128, ..*fly }).collect();
        assert!(index(&clustered) < 0.7, "{}", index(&clustered));
        let grid = |slot: i32| Fly { x: slot % 50 * 332, y: slot / 50 * 332, alive: true, ..Fly::ABSENT };
        assert!(index(&(0..2_500).map(grid).collect::<Vec<_>>()) > 1.9, "a grid is regular");
        assert_eq!(index(&vec![random[0]; 40]), 0.0);
    }

    #[test]
    fn the_grid_finds_the_nearest_neighbours_of_all_pairs() {
        for (fly_count, squeeze) in [(2, 1), (3, 40), (200, 1), (200, 9), (777, 3)] {
            let flies: Vec<Fly> = random_population(90, 300, fly_count, 5)
                .into_iter()
                .map(|fly| Fly { x: fly.x / squeeze, y: fly.y / squeeze, ..fly })
                .collect();
            let count = fly_count as f64;
            let living: Vec<&Fly> = flies.iter().collect();
            let found = Grid::new(&living, 90, 300).nearest_distances().sum::<f64>() / count;
            let expected = mean_by_all_pairs(&flies);
            assert!((found - expected).abs() < 1e-9 * expected.max(1.0), "{fly_count}: {found} {expected}");
        }
    }

    #[test]
    fn uniform_genes_have_spread_1_and_equal_ones_0() {
        let random = random_population(256, 256, 20_000, 2);
        let Spread { z, color, log_size, angle, .. } = Spread::of(&random, 256, 256);
        assert!((z - 1.0).abs() < 0.02 && (color - 1.0).abs() < 0.02, "{z} {color}");
        assert!(log_size < 1e-9 && angle > 0.98, "{log_size} {angle}");
        let Spread { z, color, angle, .. } = Spread::of(&[random[0]; 9], 256, 256);
        assert!(z < 1e-9 && color < 1e-9 && angle < 1e-3, "{z} {color} {angle}");
        let mut sizes = random[..2].to_vec();
        (sizes[0].w, sizes[0].h, sizes[1].w, sizes[1].h) = (640, 640, 1_280, 1_280);
        let half_octave = 0.5 * std::f64::consts::LN_2;
        assert!((Spread::of(&sizes, 256, 256).log_size - half_octave).abs() < 1e-12);
    }

    #[test]
    fn absent_flies_do_not_count_and_too_few_have_no_index() {
        let mut flies = random_population(256, 256, 300, 3);
        let without = Spread::of(&flies, 256, 256);
        flies.extend([Fly::ABSENT; 100]);
        assert_eq!(Spread::of(&flies, 256, 256), without);
        assert_eq!(Spread::of(&flies[299..], 256, 256).clark_evans, None);
        assert_eq!(Spread::of(&[], 256, 256), Spread::default());
        assert_eq!(Spread::of(&random_population(256, 1, 9, 0), 256, 1).clark_evans, None, "a line has no area");
    }
}
