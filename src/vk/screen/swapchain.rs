//! The swapchain: the images that a surface shows in turn.

use std::sync::Arc;

use ash::{khr, vk};

use super::surface::Surface;
use crate::error::Result;
use crate::vk::handle::Owned;
use crate::vk::{Device, call_failed};

/// The images of a surface at one size, each with its view and with the semaphore that tells when it is drawn.
pub(super) struct Swapchain {
    rendered: Vec<Owned<vk::Semaphore>>,
    views: Vec<Owned<vk::ImageView>>,
    images: Vec<vk::Image>,
    extent: vk::Extent2D,
    functions: khr::swapchain::Device,
    handle: vk::SwapchainKHR,
    device: Arc<Device>,
    surface: Arc<Surface>,
}

impl Swapchain {
    /// Creates the images at the size that the surface has now, in place of the `old` ones; none if it has no pixel.
    /// The queue must be idle. `size_px` counts where the surface takes any size.
    pub(super) fn create(
        device: &Arc<Device>,
        surface: &Arc<Surface>,
        format: vk::SurfaceFormatKHR,
        size_px: [u32; 2],
        old: Option<Self>,
    ) -> Result<Option<Self>> {
        let now = surface.capabilities(device.physical())?;
        let extent = extent_of(&now, size_px);
        if extent.width == 0 || extent.height == 0 {
            return Ok(None);
        }
        let old_handle = old.as_ref().map(|old| old.handle).unwrap_or_default();
        let most_images = if now.max_image_count == 0 { u32::MAX } else { now.max_image_count };
        let info = vk::SwapchainCreateInfoKHR::default()
            .surface(surface.raw())
            .min_image_count((now.min_image_count + 1).min(most_images))
            .image_format(format.format)
            .image_color_space(format.color_space)
            .image_extent(extent)
            .image_array_layers(1)
            .image_usage(vk::ImageUsageFlags::COLOR_ATTACHMENT)
            .pre_transform(now.current_transform)
            .composite_alpha(composite_alpha(now.supported_composite_alpha))
            .present_mode(vk::PresentModeKHR::FIFO)
            .clipped(true)
            .old_swapchain(old_handle);
        let functions = khr::swapchain::Device::new(surface.instance().raw(), device.raw());
        // SAFETY: V1, V2.
        let created = unsafe { functions.create_swapchain(&info, None) };
        let handle = created.map_err(|result| call_failed("vkCreateSwapchainKHR", result))?;
        device.set_name(handle, "swapchain");
        let mut swapchain = Self {
            rendered: Vec::new(),
            views: Vec::new(),
            images: Vec::new(),
            extent,
            functions,
            handle,
            device: Arc::clone(device),
            surface: Arc::clone(surface),
        };
        drop(old);
        swapchain.open_images(format.format)?;
        Ok(Some(swapchain))
    }

    fn open_images(&mut self, format: vk::Format) -> Result<()> {
        // SAFETY: V1.
        self.images = unsafe { self.functions.get_swapchain_images(self.handle) }
            .map_err(|result| call_failed("vkGetSwapchainImagesKHR", result))?;
        for &image in &self.images {
            self.device.set_name(image, "screen");
            let info = vk::ImageViewCreateInfo::default()
                .image(image)
                .view_type(vk::ImageViewType::TYPE_2D)
                .format(format)
                .subresource_range(WHOLE);
            // SAFETY: V1.
            let view = unsafe { self.device.raw().create_image_view(&info, None) }
                .map_err(|result| call_failed("creation of the view of an image of the screen", result))?;
            self.views.push(Owned::new(&self.device, view, "screen"));
            self.rendered.push(create_semaphore(&self.device, "screen drawn")?);
        }
        Ok(())
    }

    /// The size of the images.
    pub(super) fn extent(&self) -> vk::Extent2D {
        self.extent
    }

    /// Whether the surface has another size by now.
    pub(super) fn is_outgrown(&self, size_px: [u32; 2]) -> Result<bool> {
        Ok(extent_of(&self.surface.capabilities(self.device.physical())?, size_px) != self.extent)
    }

    /// Waits for an image to draw into, at most `most_ns`; its number, and whether it still fits the surface.
    pub(super) fn acquire(&self, acquired: vk::Semaphore, most_ns: u64) -> Result<(u32, bool), vk::Result> {
        // SAFETY: V1, V2: the semaphore is not in use, since every frame is waited for.
        let next = unsafe { self.functions.acquire_next_image(self.handle, most_ns, acquired, vk::Fence::null()) };
        next.map(|(number, is_suboptimal)| (number, !is_suboptimal))
    }

    /// The view of an image.
    pub(super) fn view(&self, number: u32) -> vk::ImageView {
        self.views[number as usize].get()
    }

    /// The semaphore that tells when an image is drawn.
    pub(super) fn rendered(&self, number: u32) -> vk::Semaphore {
        self.rendered[number as usize].get()
    }

    /// Records the move of an image from one layout to another.
    pub(super) fn record_move(
        &self,
        commands: vk::CommandBuffer,
        number: u32,
        (from, to): (vk::ImageLayout, vk::ImageLayout),
    ) {
        let barriers = [vk::ImageMemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
            .src_access_mask(vk::AccessFlags2::MEMORY_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
            .dst_access_mask(vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE)
            .old_layout(from)
            .new_layout(to)
            .image(self.images[number as usize])
            .subresource_range(WHOLE)];
        let dependency = vk::DependencyInfo::default().image_memory_barriers(&barriers);
        // SAFETY: V1, V3, V5.
        unsafe { self.device.raw().cmd_pipeline_barrier2(commands, &dependency) };
    }

    /// Shows an image once it is drawn; whether it still fits the surface.
    pub(super) fn present(&self, number: u32) -> Result<bool, vk::Result> {
        let (drawn, swapchains, numbers) = ([self.rendered(number)], [self.handle], [number]);
        let info =
            vk::PresentInfoKHR::default().wait_semaphores(&drawn).swapchains(&swapchains).image_indices(&numbers);
        let queue = self.device.queue();
        // SAFETY: V1, V2, V3.
        unsafe { self.functions.queue_present(*queue, &info) }.map(|is_suboptimal| !is_suboptimal)
    }
}

impl Drop for Swapchain {
    fn drop(&mut self) {
        if self.device.is_given_up() {
            // V2: what still shows the images stays, too.
            std::mem::forget(Arc::clone(&self.surface));
            return;
        }
        self.views.clear();
        self.rendered.clear();
        // SAFETY: V1, V2: the queue is idle.
        unsafe { self.functions.destroy_swapchain(self.handle, None) };
    }
}

const WHOLE: vk::ImageSubresourceRange = vk::ImageSubresourceRange {
    aspect_mask: vk::ImageAspectFlags::COLOR,
    base_mip_level: 0,
    level_count: 1,
    base_array_layer: 0,
    layer_count: 1,
};

/// Creates a semaphore that nothing has signalled yet.
pub(super) fn create_semaphore(device: &Arc<Device>, name: &str) -> Result<Owned<vk::Semaphore>> {
    // SAFETY: V1.
    let semaphore = unsafe { device.raw().create_semaphore(&vk::SemaphoreCreateInfo::default(), None) }
        .map_err(|result| call_failed(format!("creation of semaphore {name}"), result))?;
    Ok(Owned::new(device, semaphore, name))
}

/// The size of the surface; the one that was asked for where the surface has none of its own.
fn extent_of(now: &vk::SurfaceCapabilitiesKHR, [width, height]: [u32; 2]) -> vk::Extent2D {
    if now.current_extent.width != u32::MAX {
        return now.current_extent;
    }
    if width == 0 || height == 0 {
        return vk::Extent2D::default();
    }
    let (least, most) = (now.min_image_extent, now.max_image_extent);
    vk::Extent2D { width: width.max(least.width).min(most.width), height: height.max(least.height).min(most.height) }
}

/// How the window lies over what is behind it: without letting that through, if that can be had.
fn composite_alpha(supported: vk::CompositeAlphaFlagsKHR) -> vk::CompositeAlphaFlagsKHR {
    let wanted = [
        vk::CompositeAlphaFlagsKHR::OPAQUE,
        vk::CompositeAlphaFlagsKHR::INHERIT,
        vk::CompositeAlphaFlagsKHR::PRE_MULTIPLIED,
        vk::CompositeAlphaFlagsKHR::POST_MULTIPLIED,
    ];
    wanted.into_iter().find(|&way| supported.contains(way)).unwrap_or(wanted[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_surface_decides_its_size_unless_it_takes_any() {
        let extent = |width, height| vk::Extent2D { width, height };
        let mut now = vk::SurfaceCapabilitiesKHR {
            current_extent: extent(640, 400),
            min_image_extent: extent(1, 1),
            max_image_extent: extent(4096, 2048),
            ..Default::default()
        };
        assert_eq!(extent_of(&now, [100, 100]), extent(640, 400));
        now.current_extent = extent(u32::MAX, u32::MAX);
        assert_eq!(extent_of(&now, [100, 50]), extent(100, 50));
        assert_eq!(extent_of(&now, [5000, 5000]), extent(4096, 2048));
        assert_eq!(extent_of(&now, [0, 50]), extent(0, 0));
    }

    #[test]
    fn a_window_lets_nothing_through_if_that_can_be_had() {
        let (opaque, inherit) = (vk::CompositeAlphaFlagsKHR::OPAQUE, vk::CompositeAlphaFlagsKHR::INHERIT);
        assert_eq!(composite_alpha(inherit | opaque), opaque);
        assert_eq!(composite_alpha(inherit), inherit);
    }
}
