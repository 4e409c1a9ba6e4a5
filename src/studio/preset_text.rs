//! A style in the words of a preset file (see [`super::preset`]): the one that it begins from, and what of it differs.

use serde_json::{Map, Value, json};

use super::decimal::{of_units, shortest};
use crate::evolve::style::{Ground, GuideKind, Style};

const ONE_Q8: f64 = 256.0;
const ONE_Q16: f64 = 65_536.0;
/// Units of an angle in a degree.
const UNITS_PER_DEG: f64 = 65_536.0 / 360.0;

/// The name of a style, and what differs from it: nothing, if the style has a name. `worn` is what becomes of a named
/// style in the same job.
///
/// Of the names, the one that leaves least to tell is taken. Masks and shader of a style are those of its name.
pub(super) fn of_style(style: &Style, worn: impl Fn(Style) -> Style) -> (&'static str, Map<String, Value>) {
    let bases = Style::NAMES.into_iter().filter_map(|name| Some((name, worn(Style::named(name)?))));
    let alike = bases.filter(|(_, base)| look_alike(base, style));
    let told = alike.map(|(name, base)| (name, differences(style, &base)));
    told.min_by_key(|(_, differences)| differences.len()).unwrap_or_else(|| (Style::NAMES[0], parts(style)))
}

/// Whether two styles have the same of what a preset's style takes from its name.
fn look_alike(one: &Style, other: &Style) -> bool {
    let look = |style: &Style| (style.masks.clone(), style.shader.clone(), style.blend, style.opacity);
    look(one) == look(other)
}

fn differences(style: &Style, base: &Style) -> Map<String, Value> {
    let usual = parts(base);
    let mut told = parts(style);
    told.retain(|word, value| usual.get(word) != Some(value));
    told
}

/// All that a preset says of a style. Every field is named, so that a new one does not compile until it is told or left
/// out on purpose.
fn parts(style: &Style) -> Map<String, Value> {
    let Style {
        side_min_q8,
        side_max_q8,
        aspect_max_q8,
        birth_min_q8,
        birth_max_q8,
        is_stroke,
        ground,
        overlap,
        hole,
        turn,
        angle_spread,
        coherence,
        guide,
        grout_q8,
        classes,
        recolor_q16,
        masks: _,
        shader: _,
        blend: _,
        opacity: _,
    } = style;
    let length = |q8: u32| of_units(q8, ONE_Q8);
    let classes: Vec<Value> = classes
        .iter()
        .map(|class| {
            let (share, scale) = (of_units(class.share_q16, ONE_Q16), length(class.scale_q8));
            json!({"share": share, "scale": scale, "first-round": class.first_round})
        })
        .collect();
    let ground = match ground {
        Ground::Black => "black",
        Ground::Mean => "mean",
        Ground::Grout => "grout",
    };
    let mut told = vec![
        ("side", json!([length(*side_min_q8), length(*side_max_q8)])),
        ("aspect", json!(length(*aspect_max_q8))),
        ("birth-side", json!([length(*birth_min_q8), length(*birth_max_q8)])),
        ("stroke", json!(is_stroke)),
        ("ground", json!(ground)),
        ("overlap", json!(overlap)),
        ("hole", json!(hole)),
        ("turn", json!(turn)),
        ("angle-spread-deg", json!(of_units(*angle_spread, UNITS_PER_DEG))),
        ("coherence", json!(coherence)),
        ("grout-width", json!(length(*grout_q8))),
        ("classes", json!(classes)),
        ("recolor", json!(of_units(*recolor_q16, ONE_Q16))),
    ];
    match *guide {
        GuideKind::Edges => told.push(("guide", json!("edges"))),
        GuideKind::Flow { smoothing_q8, size_strength_q8 } => {
            let is_read = |share: f64| (share * ONE_Q16).round() as u32 >> 8 == size_strength_q8;
            let size_strength = shortest(f64::from(size_strength_q8) / ONE_Q8, is_read);
            told.push(("guide", json!("flow")));
            told.push(("smoothing", json!(length(smoothing_q8))));
            told.push(("size-strength", json!(size_strength)));
        }
    }
    told.into_iter().map(|(word, value)| (word.to_owned(), value)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::studio::Recipe;

    fn style(text: &str) -> Style {
        let recipe = Recipe::from_toml(text).expect("the preset can be read");
        recipe.choices.style.expect("a preset has a style")
    }

    /// A preset as TOML: what JSON of numbers, texts and lists of them is, too, but for maps in lists.
    fn toml_of(base: &str, told: &Map<String, Value>) -> String {
        let mut text = format!("style = \"{base}\"\n");
        let (classes, others): (Vec<_>, Vec<_>) = told.iter().partition(|(word, _)| *word == "classes");
        others.iter().for_each(|(word, value)| text += &format!("{word} = {value}\n"));
        for class in classes.iter().flat_map(|(_, list)| list.as_array().into_iter().flatten()) {
            text += "[[classes]]\n";
            class.as_object().into_iter().flatten().for_each(|(word, value)| text += &format!("{word} = {value}\n"));
        }
        text
    }

    #[test]
    fn named_styles_are_told_by_their_names_alone() {
        for name in Style::NAMES {
            let named = Style::named(name).expect("it has a name");
            assert_eq!(of_style(&named, |style| style), (name, Map::new()));
            let worn = named.for_translucent_tiles();
            assert_eq!(of_style(&worn, Style::for_translucent_tiles).1, Map::new(), "{name}");
        }
    }

    #[test]
    fn what_is_told_of_a_style_of_ones_own_makes_it_again() {
        for text in [
            "style = \"mosaic\"\nside = [0.3, 1.234]\nangle-spread-deg = 7\nsize-strength = 0.123",
            "style = \"spray\"\nrecolor = 0.3\ncoherence = 7\nguide = \"flow\"\nsmoothing = 0.7",
            "aspect = 3.3\nbirth-side = [0.01, 5.55]\nstroke = true\nground = \"mean\"\ngrout-width = 0.07",
            "style = \"paint\"\nguide = \"edges\"\nhole = 9\nturn = 5\noverlap = 3\n[[classes]]\nshare = 0.4\nscale = 2\n\
             [[classes]]\nshare = 0.6\nscale = 0.8\nfirst-round = 6",
        ] {
            let own = style(text);
            let (base, told) = of_style(&own, |style| style);
            assert_eq!(style(&toml_of(base, &told)), own, "{text}");
            assert!(!told.is_empty() && told.len() < 8, "{told:?}");
        }
    }
}
