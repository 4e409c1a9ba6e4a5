//! Results as lists of numbers, so that all kinds are compared in one way.

use crate::model::cells::{SearchState, Stacks, Standing};
use crate::model::{Evaluation, Fly, Layers, Mosaic};

/// Numbers of one kind: what each of them belongs to, what its fields are called, and the fields one after the other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Part {
    of: &'static str,
    fields: &'static [&'static str],
    numbers: Vec<i64>,
}

impl Part {
    pub(super) fn new(
        of: &'static str,
        fields: &'static [&'static str],
        numbers: impl IntoIterator<Item = i64>,
    ) -> Self {
        Self { of, fields, numbers: numbers.into_iter().collect() }
    }

    /// The genes of flies.
    pub(super) fn flies(flies: &[Fly]) -> Self {
        const FIELDS: [&str; 11] =
            ["x", "y", "depth", "red", "green", "blue", "angle", "width", "height", "mask", "life"];
        let genes = flies.iter().flat_map(|fly| {
            let channels = [fly.r, fly.g, fly.b, fly.angle].map(i64::from);
            [i64::from(fly.x), i64::from(fly.y), i64::from(fly.z)].into_iter().chain(channels).chain([
                i64::from(fly.w),
                i64::from(fly.h),
                i64::from(fly.mask),
                i64::from(fly.alive),
            ])
        });
        Self::new("tile", &FIELDS, genes)
    }

    /// The SAE, and the marginal fitness of every tile.
    pub(super) fn evaluation(evaluation: &Evaluation<'_>) -> [Self; 2] {
        [
            Self::new("population", &["SAE"], [evaluation.sae as i64]),
            Self::new("tile", &["marginal fitness"], evaluation.marginal.iter().copied()),
        ]
    }

    /// The two nearest tiles of every pixel.
    pub(super) fn layers(layers: &Layers) -> Self {
        let pairs = layers.top.iter().zip(&layers.under);
        Self::new("pixel", &["nearest tile", "tile below"], pairs.flat_map(|(&top, &under)| [top.into(), under.into()]))
    }

    /// How far a search has come.
    pub(super) fn standing(standing: Standing) -> Self {
        let Standing { rounds, evals, births, accepted, objective } = standing;
        let numbers = [rounds.into(), evals as i64, births as i64, accepted as i64, objective];
        Self::new("search", &["rounds", "evals", "births", "children accepted", "objective"], numbers)
    }

    /// The tiles of a search, with their steps and fitness.
    pub(super) fn state(SearchState { flies, steps, fitness }: &SearchState) -> [Self; 3] {
        [
            Self::flies(flies),
            Self::new("tile", &["step"], steps.iter().copied().map(i64::from)),
            Self::new("tile", &["marginal fitness"], fitness.iter().copied()),
        ]
    }

    /// What lies on every pixel: how many tiles, then each of them with its error or look, mixed into one number.
    pub(super) fn stacks(stacks: &Stacks) -> Self {
        let mixed = |stack: &Vec<(u32, i32)>| {
            let mix = |sum: i64, &(fly, look): &(u32, i32)| {
                sum.wrapping_mul(0x5851_F42D).wrapping_add(i64::from(fly) << 32 ^ i64::from(look))
            };
            [stack.len() as i64, stack.iter().fold(0, mix)]
        };
        Self::new("pixel", &["tiles on it", "tiles and errors, mixed"], stacks.pixels.iter().flat_map(mixed))
    }

    /// The pixels of a drawing.
    pub(super) fn mosaic(mosaic: &Mosaic) -> Self {
        let alpha = |pixel: usize| mosaic.alpha.as_ref().map_or(i64::from(u8::MAX), |alpha| alpha[pixel].into());
        let channels = |(pixel, color): (usize, &[u8; 3])| {
            let [r, g, b] = color.map(i64::from);
            [r, g, b, alpha(pixel)]
        };
        let numbers = mosaic.pixels.iter().enumerate().flat_map(channels);
        Self::new("pixel", &["red", "green", "blue", "opacity"], numbers)
    }

    /// What the first number is that differs.
    fn difference(&self, expected: &Self) -> Option<String> {
        if self.numbers.len() != expected.numbers.len() {
            let (found, expected) = (self.numbers.len(), expected.numbers.len());
            return Some(format!("{found} numbers of all {}s together, and {expected} on the CPU", self.of));
        }
        let place = self.numbers.iter().zip(&expected.numbers).position(|(found, expected)| found != expected)?;
        let differing =
            self.numbers.iter().zip(&expected.numbers).filter(|(found, expected)| found != expected).count();
        let (index, field) = (place / self.fields.len(), self.fields[place % self.fields.len()]);
        let (found, expected, all) = (self.numbers[place], expected.numbers[place], self.numbers.len());
        Some(format!("{} {index}, {field}: {found}, and {expected} on the CPU ({differing} of {all} differ)", self.of))
    }
}

/// How many numbers there are.
pub(super) fn count(parts: &[Part]) -> usize {
    parts.iter().map(|part| part.numbers.len()).sum()
}

/// The first difference between what was found and what was expected.
pub(super) fn first_difference(found: &[Part], expected: &[Part]) -> Option<String> {
    if found.len() != expected.len() {
        return Some(format!("{} results, and {} on the CPU", found.len(), expected.len()));
    }
    found.iter().zip(expected).find_map(|(found, expected)| found.difference(expected))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evolve::evolution::random_population;

    #[test]
    fn the_first_difference_is_named_by_tile_and_gene() {
        let flies = random_population(20, 20, 9, 3);
        assert_eq!(first_difference(&[Part::flies(&flies)], &[Part::flies(&flies)]), None);
        let mut other = flies.clone();
        other[4].angle ^= 1;
        other[7].x += 2;
        let told = first_difference(&[Part::flies(&other)], &[Part::flies(&flies)]).expect("two genes differ");
        let (found, expected) = (other[4].angle, flies[4].angle);
        assert_eq!(told, format!("tile 4, angle: {found}, and {expected} on the CPU (2 of 99 differ)"));
        assert!(first_difference(&[Part::flies(&flies[1..])], &[Part::flies(&flies)]).is_some());
        assert!(first_difference(&[], &[Part::flies(&flies)]).is_some());
    }
}
