//! Images: the targets that passes draw into, and layered textures that shaders fetch from. All are for drawing.
//!
//! An image is moved to the layout `GENERAL` when it is created and stays there.

use std::sync::Arc;

use ash::vk;
use gpu_allocator::MemoryLocation;

use super::commands::run_once;
use super::handle::Owned;
use super::memory::{Memory, Purpose};
use super::{Device, call_failed, refused};
use crate::error::{Error, Remedy, Result};

/// What a pixel of an image holds, which also decides what the image is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImageFormat {
    /// Four channels of 8 bits, 0 to 1: a colour attachment, which can be written and shown, too.
    Rgba8Unorm,
    /// One unsigned 32-bit number: a colour attachment.
    R32Uint,
    /// Depth as a float: a depth attachment, which cannot be copied.
    D32Float,
    /// Two unsigned 8-bit numbers: an array of layers for shaders to fetch from.
    Rg8Uint,
}

impl ImageFormat {
    /// Bytes of one pixel.
    #[must_use]
    pub fn pixel_bytes(self) -> u64 {
        match self {
            Self::Rgba8Unorm | Self::R32Uint | Self::D32Float => 4,
            Self::Rg8Uint => 2,
        }
    }

    pub(super) fn raw(self) -> vk::Format {
        match self {
            Self::Rgba8Unorm => vk::Format::R8G8B8A8_UNORM,
            Self::R32Uint => vk::Format::R32_UINT,
            Self::D32Float => vk::Format::D32_SFLOAT,
            Self::Rg8Uint => vk::Format::R8G8_UINT,
        }
    }

    fn usage(self) -> vk::ImageUsageFlags {
        match self {
            // Every device can use this format in all of these ways.
            Self::Rgba8Unorm => {
                vk::ImageUsageFlags::COLOR_ATTACHMENT
                    | vk::ImageUsageFlags::SAMPLED
                    | vk::ImageUsageFlags::TRANSFER_SRC
                    | vk::ImageUsageFlags::TRANSFER_DST
            }
            Self::R32Uint => vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::TRANSFER_SRC,
            Self::D32Float => vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT,
            Self::Rg8Uint => vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST,
        }
    }

    fn aspect(self) -> vk::ImageAspectFlags {
        match self {
            Self::D32Float => vk::ImageAspectFlags::DEPTH,
            Self::Rgba8Unorm | Self::R32Uint | Self::Rg8Uint => vk::ImageAspectFlags::COLOR,
        }
    }

    fn view_type(self) -> vk::ImageViewType {
        match self {
            Self::Rg8Uint => vk::ImageViewType::TYPE_2D_ARRAY,
            Self::Rgba8Unorm | Self::R32Uint | Self::D32Float => vk::ImageViewType::TYPE_2D,
        }
    }
}

/// The size of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageShape {
    /// Width in pixels.
    pub width_px: u32,
    /// Height in pixels.
    pub height_px: u32,
    /// Number of layers; attachments have one.
    pub layers: u32,
}

/// A named image. Its contents are undefined until they are drawn or written.
pub struct Image {
    view: Owned<vk::ImageView>,
    handle: Owned<vk::Image>,
    _memory: Memory,
    name: String,
    format: ImageFormat,
    shape: ImageShape,
}

impl Image {
    /// Creates an image.
    ///
    /// # Errors
    /// [`Error::TooLarge`] if a side or the number of layers exceeds the device's limit, [`Error::OutOfDeviceMemory`]
    /// if it does not fit, [`Error::Vulkan`] if the device cannot draw.
    pub fn create(device: &Arc<Device>, name: &str, format: ImageFormat, shape: ImageShape) -> Result<Arc<Self>> {
        check_shape(name, shape, device)?;
        device.require_drawing(&format!("creation of image {name}"))?;
        let bytes = u64::from(shape.width_px) * u64::from(shape.height_px) * u64::from(shape.layers);
        let failed = |result| creation_failed(name, bytes * format.pixel_bytes(), result);
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(format.raw())
            .extent(vk::Extent3D { width: shape.width_px, height: shape.height_px, depth: 1 })
            .mip_levels(1)
            .array_layers(shape.layers)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(format.usage());
        // SAFETY: V1.
        let handle = unsafe { device.raw().create_image(&info, None) }.map_err(failed)?;
        let handle = Owned::new(device, handle, name);
        // SAFETY: V1.
        let requirements = unsafe { device.raw().get_image_memory_requirements(handle.get()) };
        let purpose = Purpose { name, location: MemoryLocation::GpuOnly, linear: false };
        let memory = Memory::allocate(device, requirements, &purpose)?;
        memory.bind_image(handle.get()).map_err(failed)?;
        let view = create_view(device, handle.get(), format, name)?;
        move_to_general(device, handle.get(), format)?;
        Ok(Arc::new(Self { view, handle, _memory: memory, name: name.to_owned(), format, shape }))
    }

    /// The debug name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What a pixel holds.
    #[must_use]
    pub fn format(&self) -> ImageFormat {
        self.format
    }

    /// Width, height and layers.
    #[must_use]
    pub fn shape(&self) -> ImageShape {
        self.shape
    }

    /// Bytes of one layer, rows packed tightly.
    #[must_use]
    pub fn layer_bytes(&self) -> u64 {
        u64::from(self.shape.width_px) * u64::from(self.shape.height_px) * self.format.pixel_bytes()
    }

    pub(super) fn raw(&self) -> vk::Image {
        self.handle.get()
    }

    pub(super) fn view(&self) -> vk::ImageView {
        self.view.get()
    }

    /// The description of a copy between the upper left corner and tightly packed bytes at `buffer_offset`.
    pub(super) fn corner_copy(&self, [width, height]: [u32; 2], buffer_offset: u64) -> vk::BufferImageCopy {
        self.layer_copy(0, buffer_offset).image_extent(vk::Extent3D { width, height, depth: 1 })
    }

    /// The description of a copy between one layer and tightly packed bytes at `buffer_offset`.
    pub(super) fn layer_copy(&self, layer: u32, buffer_offset: u64) -> vk::BufferImageCopy {
        vk::BufferImageCopy::default()
            .buffer_offset(buffer_offset)
            .image_subresource(
                vk::ImageSubresourceLayers::default()
                    .aspect_mask(self.format.aspect())
                    .base_array_layer(layer)
                    .layer_count(1),
            )
            .image_extent(vk::Extent3D { width: self.shape.width_px, height: self.shape.height_px, depth: 1 })
    }
}

fn check_shape(name: &str, shape: ImageShape, device: &Device) -> Result<()> {
    let limits = &device.info().limits;
    let ImageShape { width_px, height_px, layers } = shape;
    if width_px == 0 || height_px == 0 || layers == 0 {
        return Err(refused(format!("creation of image {name}"), "an image needs at least one pixel"));
    }
    if width_px.max(height_px) > limits.image_side_px || layers > limits.image_layers {
        let what = format!(
            "image {name} of {width_px}x{height_px} px with {layers} layers is past the device's limit of {} px and {} layers",
            limits.image_side_px, limits.image_layers
        );
        return Err(Error::TooLarge { what, remedies: &[Remedy::SmallerPicture, Remedy::Cpu] });
    }
    Ok(())
}

fn create_view(
    device: &Arc<Device>,
    image: vk::Image,
    format: ImageFormat,
    name: &str,
) -> Result<Owned<vk::ImageView>> {
    let info = vk::ImageViewCreateInfo::default()
        .image(image)
        .view_type(format.view_type())
        .format(format.raw())
        .subresource_range(all_of(format));
    // SAFETY: V1.
    let view = unsafe { device.raw().create_image_view(&info, None) }
        .map_err(|result| call_failed(format!("creation of the view of image {name}"), result))?;
    Ok(Owned::new(device, view, name))
}

fn move_to_general(device: &Arc<Device>, image: vk::Image, format: ImageFormat) -> Result<()> {
    run_once(device, "image layout", |commands| {
        let barriers = [vk::ImageMemoryBarrier2::default()
            .dst_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
            .dst_access_mask(vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE)
            .old_layout(vk::ImageLayout::UNDEFINED)
            .new_layout(vk::ImageLayout::GENERAL)
            .image(image)
            .subresource_range(all_of(format))];
        let dependency = vk::DependencyInfo::default().image_memory_barriers(&barriers);
        // SAFETY: V1, V5; `run_once` records into a buffer of its own.
        unsafe { device.raw().cmd_pipeline_barrier2(commands, &dependency) };
    })
}

fn all_of(format: ImageFormat) -> vk::ImageSubresourceRange {
    vk::ImageSubresourceRange::default()
        .aspect_mask(format.aspect())
        .level_count(1)
        .layer_count(vk::REMAINING_ARRAY_LAYERS)
}

fn creation_failed(name: &str, bytes: u64, result: vk::Result) -> Error {
    match result {
        vk::Result::ERROR_OUT_OF_DEVICE_MEMORY | vk::Result::ERROR_OUT_OF_HOST_MEMORY => {
            Error::OutOfDeviceMemory { name: name.to_owned(), bytes }
        }
        other => call_failed(format!("creation of image {name}"), other),
    }
}
