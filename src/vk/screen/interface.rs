//! The interface that `egui` lays out: its textures, the images that it shows, and the recording of its meshes.

use std::collections::HashMap;
use std::mem::ManuallyDrop;
use std::sync::Arc;

use ash::vk;
use egui::epaint::{ImageDelta, Primitive};
use egui::{ClippedPrimitive, ColorImage, ImageData, TextureId, TexturesDelta};
use egui_ash_renderer::{DynamicRendering, Options, RenderMode, Renderer, RendererError};

use super::colors::Channels;
use super::memory::InterfaceMemory;
use crate::error::{Error, Result};
use crate::vk::commands::{create_command_pool, submission_failed};
use crate::vk::handle::Owned;
use crate::vk::{Device, Image, ImageFormat, call_failed, refused};

/// Label of the interface in errors and debuggers.
pub(super) const LABEL: &str = "interface";

/// What the interface is drawn with. Nothing of it may be in use by the device when it is changed or dropped.
pub(super) struct Interface {
    renderer: ManuallyDrop<Renderer<InterfaceMemory>>,
    /// Every texture of `egui` as it was given, for the next change to a part of it.
    textures: HashMap<TextureId, ColorImage>,
    shown: HashMap<TextureId, Shown>,
    vertices: Channels,
    texels: Channels,
    sampler: Owned<vk::Sampler>,
    set_layout: Owned<vk::DescriptorSetLayout>,
    pool: Owned<vk::CommandPool>,
    device: Arc<Device>,
}

/// An image that the interface shows, with what binds it.
struct Shown {
    _pool: Owned<vk::DescriptorPool>,
    _image: Arc<Image>,
}

impl Interface {
    /// An interface that draws into images of this format.
    pub(super) fn create(device: &Arc<Device>, format: vk::Format) -> Result<Self> {
        let mode = RenderMode::DynamicRendering(DynamicRendering {
            color_attachment_format: format,
            depth_attachment_format: None,
            stencil_attachment_format: None,
        });
        // What the shader computes is stored as it is: `colors` says why.
        let options = Options { srgb_framebuffer: true, ..Options::default() };
        let renderer = Renderer::with_allocator(InterfaceMemory::new(device), device.raw().clone(), mode, options)
            .map_err(|error| failed("creation of the interface", error))?;
        let renderer = ManuallyDrop::new(renderer);
        Ok(Self {
            renderer,
            textures: HashMap::new(),
            shown: HashMap::new(),
            vertices: Channels::of_vertices(),
            texels: Channels::of_texels(),
            sampler: create_sampler(device)?,
            set_layout: create_set_layout(device)?,
            pool: create_command_pool(device, "interface uploads")?,
            device: Arc::clone(device),
        })
    }

    /// Shows an image as a texture of the interface, and keeps it alive.
    pub(super) fn add_image(&mut self, image: &Arc<Image>) -> Result<TextureId> {
        if image.format() != ImageFormat::Rgba8Unorm {
            let reason = format!("{:?} is not a format to be shown", image.format());
            return Err(refused(format!("showing of image {}", image.name()), reason));
        }
        let (pool, set) = self.bind(image)?;
        let id = self.renderer.add_user_texture(set);
        self.shown.insert(id, Shown { _pool: pool, _image: Arc::clone(image) });
        Ok(id)
    }

    /// Shows an image no more.
    pub(super) fn remove_image(&mut self, id: TextureId) {
        if self.shown.remove(&id).is_some() {
            self.renderer.remove_user_texture(id);
        }
    }

    fn bind(&self, image: &Image) -> Result<(Owned<vk::DescriptorPool>, vk::DescriptorSet)> {
        let (device, name) = (&self.device, image.name());
        let kind = vk::DescriptorType::COMBINED_IMAGE_SAMPLER;
        let sizes = [vk::DescriptorPoolSize::default().ty(kind).descriptor_count(1)];
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        // SAFETY: V1.
        let pool = unsafe { device.raw().create_descriptor_pool(&info, None) }
            .map_err(|result| call_failed(format!("creation of the pool for image {name}"), result))?;
        let pool = Owned::new(device, pool, name);
        let layouts = [self.set_layout.get()];
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool.get()).set_layouts(&layouts);
        // SAFETY: V1.
        let sets = unsafe { device.raw().allocate_descriptor_sets(&info) }
            .map_err(|result| call_failed(format!("binding of image {name}"), result))?;
        let set = sets.first().copied().unwrap_or_default();
        let images = [vk::DescriptorImageInfo::default()
            .sampler(self.sampler.get())
            .image_view(image.view())
            .image_layout(vk::ImageLayout::GENERAL)];
        let write = vk::WriteDescriptorSet::default().dst_set(set).descriptor_type(kind).image_info(&images);
        // SAFETY: V1; the set is new, so nothing uses it.
        unsafe { device.raw().update_descriptor_sets(&[write], &[]) };
        Ok((pool, set))
    }

    /// Uploads new and changed textures, and waits for that.
    pub(super) fn set_textures(&mut self, changes: &TexturesDelta) -> Result<()> {
        for (&id, changes) in &changes.set {
            for change in changes {
                self.set_texture(id, change)?;
            }
        }
        Ok(())
    }

    /// The renderer lets go of all of a texture when it changes a part (`egui-ash-renderer` 0.13: its move from the
    /// layout `UNDEFINED`). So a change to a part is given as a change to the whole.
    fn set_texture(&mut self, id: TextureId, change: &ImageDelta) -> Result<()> {
        let ImageData::Color(image) = &change.image;
        let most = self.device.info().limits.image_side_px as usize;
        if image.size.iter().any(|&side| side == 0 || side > most) {
            let reason = format!("{:?} px are not 1 to {most}", image.size);
            return Err(refused("upload of a texture of the interface", reason));
        }
        let mut part = ColorImage::clone(image);
        part.pixels.iter_mut().for_each(|color| *color = self.texels.of(*color));
        match (change.pos, self.textures.get_mut(&id)) {
            (None, _) => {
                self.textures.insert(id, part);
            }
            (Some(corner), Some(whole)) if fits(corner, part.size, whole.size) => put(&part, corner, whole),
            (Some(_), _) => {
                return Err(refused("upload of a texture of the interface", "it changes what is not there"));
            }
        }
        let Some(whole) = self.textures.get(&id) else { return Ok(()) };
        let whole = ImageDelta::full(whole.clone(), change.options);
        let queue = self.device.queue();
        let uploaded = self.renderer.set_texture(*queue, self.pool.get(), id, &whole);
        uploaded.map_err(|error| failed("upload of a texture of the interface", error))
    }

    /// Lets go of the textures that are no longer shown.
    pub(super) fn free_textures(&mut self, changes: &TexturesDelta) -> Result<()> {
        for &id in &changes.free {
            self.textures.remove(&id);
            self.renderer.free_texture(id).map_err(|error| failed("freeing of a texture of the interface", error))?;
        }
        Ok(())
    }

    /// What there is to draw, as [`Self::record`] takes it.
    pub(super) fn prepare(&self, primitives: &[ClippedPrimitive]) -> Result<Vec<ClippedPrimitive>> {
        let primitives = self.vertices.of_primitives(primitives);
        let is_known = |id: &TextureId| self.textures.contains_key(id) || self.shown.contains_key(id);
        for primitive in &primitives {
            if let Primitive::Mesh(mesh) = &primitive.primitive
                && !is_known(&mesh.texture_id)
            {
                return Err(refused("painting of the interface", format!("there is no {:?}", mesh.texture_id)));
            }
        }
        Ok(primitives)
    }

    /// Records the drawing of what was prepared.
    pub(super) fn record(
        &mut self,
        commands: vk::CommandBuffer,
        extent: vk::Extent2D,
        pixels_per_point: f32,
        primitives: &[ClippedPrimitive],
    ) -> Result<()> {
        let recorded = self.renderer.cmd_draw(commands, extent, pixels_per_point, primitives);
        recorded.map_err(|error| failed("recording of the interface", error))
    }
}

impl Drop for Interface {
    fn drop(&mut self) {
        if !self.device.is_given_up() {
            // SAFETY: V2; it is dropped here and nowhere else.
            unsafe { ManuallyDrop::drop(&mut self.renderer) };
        }
    }
}

/// Whether a part lies inside a whole.
fn fits(corner: [usize; 2], part: [usize; 2], whole: [usize; 2]) -> bool {
    (0..2).all(|axis| corner[axis].checked_add(part[axis]).is_some_and(|end| end <= whole[axis]))
}

/// Puts a part into a whole that it fits.
fn put(part: &ColorImage, [x, y]: [usize; 2], whole: &mut ColorImage) {
    let (width, stride) = (part.size[0], whole.size[0]);
    for (row, pixels) in part.pixels.chunks_exact(width).enumerate() {
        whole.pixels[(y + row) * stride + x..][..width].copy_from_slice(pixels);
    }
}

/// Enlarged pixels stay squares.
fn create_sampler(device: &Arc<Device>) -> Result<Owned<vk::Sampler>> {
    let edge = vk::SamplerAddressMode::CLAMP_TO_EDGE;
    let info = vk::SamplerCreateInfo::default()
        .mag_filter(vk::Filter::NEAREST)
        .min_filter(vk::Filter::NEAREST)
        .address_mode_u(edge)
        .address_mode_v(edge)
        .address_mode_w(edge);
    // SAFETY: V1.
    let sampler = unsafe { device.raw().create_sampler(&info, None) }
        .map_err(|result| call_failed("creation of the sampler of shown images", result))?;
    Ok(Owned::new(device, sampler, "shown images"))
}

/// The layout of one texture, as the renderer has it.
fn create_set_layout(device: &Arc<Device>) -> Result<Owned<vk::DescriptorSetLayout>> {
    let bindings = [vk::DescriptorSetLayoutBinding::default()
        .descriptor_type(vk::DescriptorType::COMBINED_IMAGE_SAMPLER)
        .descriptor_count(1)
        .stage_flags(vk::ShaderStageFlags::FRAGMENT)];
    let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
    // SAFETY: V1.
    let layout = unsafe { device.raw().create_descriptor_set_layout(&info, None) }
        .map_err(|result| call_failed("creation of the layout of shown images", result))?;
    Ok(Owned::new(device, layout, "shown images"))
}

/// An error of the renderer as one of ours.
fn failed(call: &str, error: RendererError) -> Error {
    match error {
        RendererError::Vulkan(result) => submission_failed(call, result, LABEL),
        other => refused(call, other.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use egui::Color32;

    use super::*;

    #[test]
    fn a_change_to_a_part_of_a_texture_leaves_the_rest() {
        let mut whole = ColorImage::filled([3, 2], Color32::BLACK);
        let part = ColorImage::filled([2, 1], Color32::WHITE);
        assert!(fits([1, 1], part.size, whole.size) && !fits([2, 1], part.size, whole.size));
        put(&part, [1, 1], &mut whole);
        let white: Vec<bool> = whole.pixels.iter().map(|&color| color == Color32::WHITE).collect();
        assert_eq!(white, [false, false, false, false, true, true]);
    }
}
