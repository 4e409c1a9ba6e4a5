//! The screen of a window: its surface with the swapchain, and the interface that is drawn into it. It has a device of
//! its own, so that no work elsewhere waits for a frame.
//!
//! A frame is waited for before the call that painted it returns.

mod colors;
mod display;
mod interface;
mod memory;
mod surface;
mod swapchain;

use std::sync::Arc;

use ash::{khr, vk};
use egui::{ClippedPrimitive, TextureId, TexturesDelta};
use winit::raw_window_handle::{HasDisplayHandle, HasWindowHandle};

pub use self::display::when_display_is_gone;
use self::interface::{Interface, LABEL};
use self::surface::Surface;
use self::swapchain::{Swapchain, create_semaphore};
use super::commands::{
    allocate_command_buffers, begin_commands, create_command_pool, create_fence, end_commands, record_barrier,
    submission_failed, submit, wait_for,
};
use super::handle::Owned;
use super::scope::Scope;
use super::{Device, Image, InstanceOptions, Validation, ValidationLog, call_failed};
use crate::error::{Error, Result};

/// How long a frame waits for an image to draw into. A window that is covered may get none for as long as it is.
const PATIENCE_NS: u64 = 500_000_000;
/// A window may change its size while it is painted, but not for ever.
const ATTEMPTS: usize = 4;

/// What became of a painting.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Painted {
    /// The window shows it.
    Shown,
    /// The window has no pixel, or takes no frame at the moment.
    Skipped,
}

/// A window's surface with its swapchain, and the interface that is drawn into it.
pub struct Screen {
    interface: Interface,
    swapchain: Option<Swapchain>,
    acquired: Owned<vk::Semaphore>,
    fence: Owned<vk::Fence>,
    commands: vk::CommandBuffer,
    // Owns the command buffer.
    pool: Owned<vk::CommandPool>,
    format: vk::SurfaceFormatKHR,
    size_px: [u32; 2],
    /// Whether the swapchain no longer fits the surface.
    is_stale: bool,
    log: Arc<ValidationLog>,
    device: Arc<Device>,
    surface: Arc<Surface>,
}

impl Screen {
    /// Opens the best device that can draw and show on this window, hardware before software. The window is kept until
    /// the screen is gone. `size_px` is its width and height.
    ///
    /// # Errors
    /// [`Error::NoSuitableDevice`] if no device can show on the window, or for the reasons of
    /// [`super::Instance::create`]; [`Error::Vulkan`] if the driver refuses.
    pub fn create<W>(window: Arc<W>, size_px: [u32; 2], validation: Validation) -> Result<Self>
    where
        W: HasDisplayHandle + HasWindowHandle + Send + Sync + 'static,
    {
        let surface = Surface::create(window, InstanceOptions { validation })?;
        let (info, family) = surface.best_device()?;
        let device = Device::create_to_present(surface.instance(), &info, family, khr::swapchain::NAME)?;
        let format = surface.format(device.physical())?;
        let pool = create_command_pool(&device, LABEL)?;
        let [commands] = allocate_command_buffers(&pool)?;
        device.set_name(commands, LABEL);
        Ok(Self {
            interface: Interface::create(&device, format.format)?,
            swapchain: None,
            acquired: create_semaphore(&device, "screen acquired")?,
            fence: create_fence(&device, LABEL)?,
            commands,
            pool,
            format,
            size_px,
            is_stale: true,
            log: Arc::clone(surface.instance().validation_log()),
            device,
            surface,
        })
    }

    /// The device that draws the window. Whatever the interface shows must be made on it.
    #[must_use]
    pub fn device(&self) -> &Arc<Device> {
        &self.device
    }

    /// The messages of the validation layer; the log may outlive the screen.
    #[must_use]
    pub fn validation_log(&self) -> &Arc<ValidationLog> {
        &self.log
    }

    /// Tells the new size of the window, which takes effect at the next painting. Without any pixel the window is
    /// minimised, and nothing is drawn.
    pub fn resize(&mut self, size_px: [u32; 2]) {
        if self.size_px != size_px {
            self.size_px = size_px;
            self.is_stale = true;
        }
    }

    /// Lets the interface show an image of format [`super::ImageFormat::Rgba8Unorm`] that was made on
    /// [`Self::device`], and keeps it alive. Its bytes are shown exactly; where it has alpha, its colours must be
    /// multiplied by it. Enlarged pixels stay squares.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if the image has another format, or the driver refuses.
    pub fn add_image(&mut self, image: &Arc<Image>) -> Result<TextureId> {
        self.interface.add_image(image)
    }

    /// Lets go of an image. What is painted from now on must not name it.
    pub fn remove_image(&mut self, id: TextureId) {
        self.interface.remove_image(id);
    }

    /// Draws the interface and shows it. The changes of textures take effect even if nothing is shown. A swapchain that
    /// no longer fits is made anew, and the interface drawn again.
    ///
    /// # Errors
    /// [`Error::DeviceLost`] if the device stopped working; [`Error::Vulkan`] if the surface is lost, or if the
    /// interface names a texture that is not there.
    pub fn paint(
        &mut self,
        textures: &TexturesDelta,
        primitives: &[ClippedPrimitive],
        pixels_per_point: f32,
    ) -> Result<Painted> {
        if self.device.is_given_up() {
            return Err(submission_failed("painting", vk::Result::ERROR_DEVICE_LOST, LABEL));
        }
        self.interface.set_textures(textures)?;
        let primitives = self.interface.prepare(primitives)?;
        let mut painted = Painted::Skipped;
        for _ in 0..ATTEMPTS {
            if !self.renew()? {
                break;
            }
            match self.paint_once(&primitives, pixels_per_point)? {
                Painted::Shown => painted = Painted::Shown,
                Painted::Skipped if !self.is_stale => break,
                Painted::Skipped => {}
            }
            if !self.is_stale {
                break;
            }
        }
        self.interface.free_textures(textures)?;
        Ok(painted)
    }

    /// Makes the swapchain anew if it no longer fits; whether there is anything to draw into.
    fn renew(&mut self) -> Result<bool> {
        if self.size_px.contains(&0) {
            return Ok(false);
        }
        if self.is_stale || self.swapchain.is_none() {
            self.device.wait_idle();
            let old = self.swapchain.take();
            self.swapchain = Swapchain::create(&self.device, &self.surface, self.format, self.size_px, old)?;
            self.is_stale = false;
        }
        Ok(self.swapchain.is_some())
    }

    /// Draws and shows one frame, and finds out whether the swapchain still fits.
    fn paint_once(&mut self, primitives: &[ClippedPrimitive], pixels_per_point: f32) -> Result<Painted> {
        let Some(swapchain) = &self.swapchain else { return Ok(Painted::Skipped) };
        let (number, fits) = match swapchain.acquire(self.acquired.get(), PATIENCE_NS) {
            Ok(acquired) => acquired,
            Err(vk::Result::TIMEOUT | vk::Result::NOT_READY) => return Ok(Painted::Skipped),
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => {
                self.is_stale = true;
                return Ok(Painted::Skipped);
            }
            Err(result) => return Err(failed("vkAcquireNextImageKHR", result)),
        };
        if let Err(error) = self.draw(number, primitives, pixels_per_point) {
            // The semaphore stays signalled and the image taken, so that neither serves again.
            self.is_stale = true;
            if !self.device.is_given_up() {
                self.device.wait_idle();
                self.acquired = create_semaphore(&self.device, "screen acquired")?;
            }
            return Err(error);
        }
        let Some(swapchain) = &self.swapchain else { return Ok(Painted::Skipped) };
        let presented = swapchain.present(number);
        wait_for(&self.device, self.fence.get(), LABEL)?;
        match presented {
            Ok(still_fits) => {
                self.is_stale = !(fits && still_fits) && swapchain.is_outgrown(self.size_px)?;
                Ok(Painted::Shown)
            }
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => {
                self.is_stale = true;
                Ok(Painted::Skipped)
            }
            Err(result) => Err(failed("vkQueuePresentKHR", result)),
        }
    }

    /// Records a frame and hands it to the queue.
    fn draw(&mut self, number: u32, primitives: &[ClippedPrimitive], pixels_per_point: f32) -> Result<()> {
        let Some(swapchain) = &self.swapchain else { return Ok(()) };
        let (raw, commands, extent) = (self.device.raw(), self.commands, swapchain.extent());
        // SAFETY: V1, V2, V3.
        unsafe { raw.reset_command_pool(self.pool.get(), vk::CommandPoolResetFlags::empty()) }
            .map_err(|result| call_failed("vkResetCommandPool", result))?;
        begin_commands(&self.device, commands)?;
        record_barrier(&self.device, commands, Scope::Earlier, Scope::Graphics);
        let drawn = vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL;
        swapchain.record_move(commands, number, (vk::ImageLayout::UNDEFINED, drawn));
        let clear = vk::ClearValue { color: vk::ClearColorValue { float32: [0.0, 0.0, 0.0, 1.0] } };
        let targets = [vk::RenderingAttachmentInfo::default()
            .image_view(swapchain.view(number))
            .image_layout(drawn)
            .load_op(vk::AttachmentLoadOp::CLEAR)
            .store_op(vk::AttachmentStoreOp::STORE)
            .clear_value(clear)];
        let info = vk::RenderingInfo::default().render_area(extent.into()).layer_count(1).color_attachments(&targets);
        // SAFETY: V1, V2, V3, V5.
        unsafe { raw.cmd_begin_rendering(commands, &info) };
        self.interface.record(commands, extent, pixels_per_point, primitives)?;
        // SAFETY: V1, V3.
        unsafe { raw.cmd_end_rendering(commands) };
        swapchain.record_move(commands, number, (drawn, vk::ImageLayout::PRESENT_SRC_KHR));
        end_commands(&self.device, commands)?;
        let everything = vk::PipelineStageFlags2::ALL_COMMANDS;
        let at = |semaphore| [vk::SemaphoreSubmitInfo::default().semaphore(semaphore).stage_mask(everything)];
        let (acquired, rendered) = (at(self.acquired.get()), at(swapchain.rendered(number)));
        let buffers = [vk::CommandBufferSubmitInfo::default().command_buffer(commands)];
        let work = vk::SubmitInfo2::default()
            .wait_semaphore_infos(&acquired)
            .command_buffer_infos(&buffers)
            .signal_semaphore_infos(&rendered);
        submit(&self.device, work, self.fence.get(), LABEL)
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        if !self.device.is_given_up() {
            self.device.wait_idle();
        }
    }
}

/// The error of a swapchain.
fn failed(call: &str, result: vk::Result) -> Error {
    match result {
        vk::Result::ERROR_SURFACE_LOST_KHR => call_failed(call, result),
        other => submission_failed(call, other, LABEL),
    }
}
