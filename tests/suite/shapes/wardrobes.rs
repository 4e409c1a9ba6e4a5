//! From outfits to a set of masks and the layers that flies wear.

use smalti::model::Blend;
use smalti::model::mask::MASK_LAYERS_MAX;
use smalti::shapes::{BuiltIn, Shader};

use super::{mask, wardrobe};

#[test]
fn an_outfit_that_is_the_full_square_is_layer_0() {
    let (square, border, disc) = (BuiltIn::Square.template(), BuiltIn::Border.template(), BuiltIn::Disc.template());
    let outfits =
        [(&square, Shader::Flat), (&disc, Shader::Flat), (&border, Shader::Flat), (&square, Shader::Negative)];
    let found = wardrobe(&outfits, Blend::Opaque, 255).unwrap();
    assert_eq!(found.layers, [0, 1, 0, 0]);
    assert_eq!(found.masks.layers().len(), 2);
    assert_eq!(found.masks.layers()[1], mask(BuiltIn::Disc, Shader::Flat));
    assert_eq!(found.masks.blend(), Blend::Opaque);
}

#[test]
fn outfits_with_the_same_texels_share_a_layer() {
    let (square, border, disc) = (BuiltIn::Square.template(), BuiltIn::Border.template(), BuiltIn::Disc.template());
    let outfits =
        [(&disc, Shader::Emboss), (&square, Shader::Emboss), (&border, Shader::Emboss), (&disc, Shader::Emboss)];
    assert_eq!(wardrobe(&outfits, Blend::Opaque, 255).unwrap().layers, [1, 2, 2, 1]);
}

#[test]
fn opacity_thins_translucent_masks_and_leaves_opaque_ones_alone() {
    let (disc, square) = (BuiltIn::Disc.template(), BuiltIn::Square.template());
    let outfits = [(&disc, Shader::Flat), (&square, Shader::Flat)];
    let full = mask(BuiltIn::Disc, Shader::Flat);

    let opaque = wardrobe(&outfits, Blend::Opaque, 100).unwrap();
    assert_eq!((opaque.layers.as_slice(), &opaque.masks.layers()[1]), ([1, 0].as_slice(), &full));

    let translucent = wardrobe(&outfits, Blend::Translucent, 100).unwrap();
    assert_eq!(translucent.layers, [1, 2], "a thin square is not the full square");
    assert_eq!(translucent.masks.blend(), Blend::Translucent);
    for (thin, full) in translucent.masks.layers()[1].texels().iter().zip(full.texels()) {
        assert_eq!(u32::from(thin.coverage), (u32::from(full.coverage) * 100 + 127) / 255);
        assert_eq!(thin.shade, full.shade);
    }
    assert!(translucent.masks.layers()[2].texels().iter().all(|texel| texel.coverage == 100));
    assert_eq!(wardrobe(&outfits, Blend::Translucent, 255).unwrap().layers, [1, 0]);
}

#[test]
fn every_built_in_template_can_be_worn_at_any_opacity() {
    for shape in BuiltIn::ALL {
        let template = shape.template();
        let outfits = Shader::ALL.map(|shader| (&template, shader));
        for (blend, opacity) in [(Blend::Opaque, 255), (Blend::Translucent, 255), (Blend::Translucent, 1)] {
            let found = wardrobe(&outfits, blend, opacity).unwrap();
            assert_eq!(found.layers.len(), outfits.len(), "{shape}");
        }
    }
}

#[test]
fn a_wardrobe_holds_as_many_masks_as_a_set_and_no_more() {
    let folder = tempfile::tempdir().unwrap();
    let templates: Vec<_> = (0..MASK_LAYERS_MAX as u32)
        .map(|number| {
            let path = folder.path().join(format!("{number}.png"));
            let hole = |x, y| image::Luma([if y * 16 + x == number { 0 } else { 255_u8 }]);
            image::GrayImage::from_fn(16, 16, hole).save(&path).unwrap();
            smalti::shapes::read(&path).unwrap()
        })
        .collect();
    let outfits: Vec<_> = templates.iter().map(|template| (template, Shader::Flat)).collect();
    let found = wardrobe(&outfits[1..], Blend::Opaque, 255).unwrap();
    assert_eq!(found.layers.last(), Some(&255));
    let refusal = wardrobe(&outfits, Blend::Opaque, 255).unwrap_err();
    assert_eq!(refusal.to_string(), "mask: at most 255 besides the square, not 256");
}
