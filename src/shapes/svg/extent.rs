//! How much there is to draw in an SVG whose elements are resolved: layers, dashes, and how far it reaches.

use resvg::tiny_skia::Transform;
use resvg::usvg::{ClipPath, Group, Mask, Node, Path, Tree};

/// Farthest that anything may reach, in px of the mask. The rasteriser counts in 32-bit fixed point.
const REACH_MAX_PX: f32 = 1e6;
/// Most layers that are drawn by themselves and then laid on others, each as large as the mask or up to 16 times that:
/// groups with an opacity, clips and masks.
const LAYERS_MAX: u32 = 200;
/// Most dashes of all strokes together.
const DASHES_MAX: f64 = 1e5;
/// Most points of all paths together.
const POINTS_MAX: usize = 1_000_000;

/// Refuses a drawing that would take too long, or lies out of the reach of the rasteriser, when it is drawn by `fit`.
///
/// # Errors
/// A sentence for the user.
pub(super) fn check(tree: &Tree, fit: Transform) -> Result<(), String> {
    Extent::default().add_group(tree.root(), fit)
}

#[derive(Default)]
struct Extent {
    layers: u32,
    dashes: f64,
    points: usize,
}

impl Extent {
    fn add_group(&mut self, group: &Group, transform: Transform) -> Result<(), String> {
        let transform = transform.pre_concat(group.transform());
        if group.should_isolate() {
            self.add_layer()?;
        }
        if let Some(clip) = group.clip_path() {
            self.add_clip(clip, transform)?;
        }
        if let Some(mask) = group.mask() {
            self.add_mask(mask, transform)?;
        }
        group.children().iter().try_for_each(|node| match node {
            Node::Group(group) => self.add_group(group, transform),
            Node::Path(path) => self.add_path(path, transform),
            // There are none: both were refused.
            Node::Image(_) | Node::Text(_) => Ok(()),
        })
    }

    fn add_clip(&mut self, clip: &ClipPath, transform: Transform) -> Result<(), String> {
        self.add_layer()?;
        if let Some(other) = clip.clip_path() {
            self.add_clip(other, transform)?;
        }
        self.add_group(clip.root(), transform.pre_concat(clip.transform()))
    }

    fn add_mask(&mut self, mask: &Mask, transform: Transform) -> Result<(), String> {
        self.add_layer()?;
        if let Some(other) = mask.mask() {
            self.add_mask(other, transform)?;
        }
        self.add_group(mask.root(), transform)
    }

    fn add_layer(&mut self) -> Result<(), String> {
        self.layers += 1;
        if self.layers > LAYERS_MAX {
            return Err(format!(
                "the SVG has more than {LAYERS_MAX} layers of masks, clips and opacities; simplify it, or export it as \
                 PNG"
            ));
        }
        Ok(())
    }

    fn add_path(&mut self, path: &Path, transform: Transform) -> Result<(), String> {
        let is_near = |value: f32| value.abs() <= REACH_MAX_PX;
        let bounds = path.stroke_bounding_box().transform(transform);
        if !bounds.is_some_and(|all| [all.left(), all.top(), all.right(), all.bottom()].into_iter().all(is_near)) {
            return Err(TOO_FAR.to_owned());
        }
        let points = path.data().points();
        self.points += points.len();
        if let Some(dashes) = path.stroke().and_then(|stroke| stroke.dasharray()) {
            let period: f64 = dashes.iter().map(|&dash| f64::from(dash)).sum();
            let length: f64 = points.windows(2).map(|pair| f64::from(pair[0].distance(pair[1]))).sum();
            self.dashes += length / period * dashes.len() as f64 / 2.0;
        }
        if self.points > POINTS_MAX || self.dashes.is_nan() || self.dashes > DASHES_MAX {
            return Err("the SVG has too many points or dashes; simplify it, or export it as PNG".to_owned());
        }
        Ok(())
    }
}

/// Why a drawing with absurd coordinates is refused.
pub(super) const TOO_FAR: &str = "the SVG has coordinates far outside its picture; correct them, or export it as PNG";
