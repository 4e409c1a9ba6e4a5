//! Hashes of what decides a result, whatever file held it.

use sha2::{Digest, Sha256};

use super::hex::hexadecimal;
use crate::model::{Blend, MaskSet, Population};

/// SHA-256 over what evolves from a population: its flies and masks, whatever file held them.
pub(crate) fn population_sha256(population: &Population) -> String {
    let mut hash = Sha256::new();
    for fly in &population.flies {
        let genes = [fly.x as u32, fly.y as u32, fly.z, fly.w, fly.h];
        let channels = [fly.r, fly.g, fly.b, fly.angle, fly.mask, u16::from(fly.alive)];
        genes.iter().for_each(|gene| hash.update(gene.to_le_bytes()));
        channels.iter().for_each(|channel| hash.update(channel.to_le_bytes()));
    }
    hash_masks(&population.masks, &mut hash);
    hexadecimal(&hash.finalize())
}

/// SHA-256 over the texels of masks and how they are read, whatever file held them.
pub(super) fn masks_sha256(masks: &MaskSet) -> String {
    let mut hash = Sha256::new();
    hash_masks(masks, &mut hash);
    hexadecimal(&hash.finalize())
}

fn hash_masks(masks: &MaskSet, hash: &mut Sha256) {
    for mask in masks.layers() {
        hash.update(bytemuck::cast_slice(mask.texels()));
    }
    if masks.blend() == Blend::Translucent {
        hash.update(b"translucent");
    }
}
