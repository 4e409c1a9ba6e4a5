//! The recorder: the only way to give work to the device.
//!
//! A submission consists of writes, passes and reads. Writes take effect before its first pass and reads after its last
//! pass, whatever the order of the calls, so the result is the same on devices with and without staging.

use std::any::Any;
use std::ffi::CStr;
use std::sync::Arc;
use std::time::Duration;

use ash::vk;

use super::commands::{
    allocate_command_buffers, begin_commands, create_command_pool, create_fence, end_commands, record_barrier,
    submission_failed,
};
use super::handle::Owned;
use super::scope::Scope;
use super::timer::{READ_BACKS, Timer, UPLOADS};
use super::transfer::{ReadBacks, ReadTicket, Uploads};
use super::{Buffer, Device, Image, ImageFormat, PassTime, SubmissionObserver, Timing, call_failed, lock, refused};
use crate::error::{Error, Result};

/// Records submissions and runs them, one after another.
pub struct Recorder {
    timer: Option<Timer>,
    uploads: Uploads,
    read_backs: ReadBacks,
    /// Objects that the commands use, kept alive until the fence.
    kept: Vec<Arc<dyn Any + Send + Sync>>,
    upload_commands: vk::CommandBuffer,
    pass_commands: vk::CommandBuffer,
    // Owns both command buffers.
    pool: Owned<vk::CommandPool>,
    fence: Owned<vk::Fence>,
    is_recording: bool,
    /// Number of the current or last recording; tickets carry it.
    recording: u64,
    last_scope: Scope,
    last_pass: &'static str,
    /// Stays true if a pass is leaked instead of dropped.
    is_pass_open: bool,
    stop_query: Option<u32>,
    label: Vec<u8>,
    failure: Option<Error>,
    took: Duration,
    name: String,
    observers: Vec<Arc<dyn SubmissionObserver>>,
    device: Arc<Device>,
}

impl Recorder {
    /// Creates a recorder. Its staging buffers are created when first used. Whatever `timing` says, it times its passes
    /// if an observer of the device asks for that.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if the driver refuses.
    pub fn create(device: &Arc<Device>, name: &str, timing: Timing) -> Result<Self> {
        let pool = create_command_pool(device, name)?;
        let [upload_commands, pass_commands] = allocate_command_buffers(&pool)?;
        device.set_name(upload_commands, &format!("{name} uploads"));
        device.set_name(pass_commands, &format!("{name} passes"));
        let fence = create_fence(device, name)?;
        let observers = lock(&device.observers).clone();
        let asks = |observer: &Arc<dyn SubmissionObserver>| observer.timing() == Timing::On;
        let timing = if observers.iter().any(asks) { Timing::On } else { timing };
        Ok(Self {
            timer: Timer::create(device, name, timing)?,
            uploads: Uploads::new(),
            read_backs: ReadBacks::new(),
            kept: Vec::new(),
            upload_commands,
            pass_commands,
            pool,
            fence,
            is_recording: false,
            recording: device.next_recording(),
            last_scope: Scope::Earlier,
            last_pass: "transfers",
            is_pass_open: false,
            stop_query: None,
            label: Vec::new(),
            failure: None,
            took: Duration::ZERO,
            name: name.to_owned(),
            observers,
            device: Arc::clone(device),
        })
    }

    /// The device that the recorder works on.
    #[must_use]
    pub fn device(&self) -> &Arc<Device> {
        &self.device
    }

    /// Writes `bytes` at `offset` of the buffer, before the first pass of this submission. If two writes cover the same
    /// byte, the later call wins.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if the range is outside the buffer.
    pub fn write_buffer(&mut self, buffer: &Arc<Buffer>, offset: u64, bytes: &[u8]) -> Result<()> {
        self.begin()?;
        if buffer.has_host_access() {
            return buffer.write(offset, bytes);
        }
        buffer.check_range("write to", offset, bytes.len() as u64)?;
        self.uploads.add_buffer(buffer, offset, bytes);
        Ok(())
    }

    /// Writes a whole layer of a texture, rows packed tightly, before the first pass of this submission.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if the image is not a texture, has no such layer, or `bytes` has not the size of a layer.
    pub fn write_image_layer(&mut self, image: &Arc<Image>, layer: u32, bytes: &[u8]) -> Result<()> {
        self.begin()?;
        let fits = layer < image.shape().layers && bytes.len() as u64 == image.layer_bytes();
        if image.format() != ImageFormat::Rg8Uint || !fits {
            return Err(refused(
                format!("write to image {}", image.name()),
                format!("{} bytes for layer {layer} of {:?} {:?}", bytes.len(), image.shape(), image.format()),
            ));
        }
        self.uploads.add_image_layer(image, layer, bytes);
        Ok(())
    }

    /// Writes `width_px` * `height_px` pixels, rows packed tightly, to the upper left corner of an image of format
    /// [`ImageFormat::Rgba8Unorm`], before the first pass of this submission. Write an image once in a submission.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if the image has another format or is smaller, or `bytes` has not that size.
    pub fn write_image_corner(
        &mut self,
        image: &Arc<Image>,
        [width_px, height_px]: [u32; 2],
        bytes: &[u8],
    ) -> Result<()> {
        self.begin()?;
        let shape = image.shape();
        let has_area = width_px > 0 && height_px > 0;
        let fits = has_area && width_px <= shape.width_px && height_px <= shape.height_px;
        let size = u64::from(width_px) * u64::from(height_px) * image.format().pixel_bytes();
        if image.format() != ImageFormat::Rgba8Unorm || !fits || bytes.len() as u64 != size {
            return Err(refused(
                format!("write to image {}", image.name()),
                format!("{} bytes for {width_px}x{height_px} px of {shape:?} {:?}", bytes.len(), image.format()),
            ));
        }
        self.uploads.add_image_corner(image, [width_px, height_px], bytes);
        Ok(())
    }

    /// Asks for `size_bytes` bytes at `offset` of the buffer, as they are after the last pass of this submission.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if the range is outside the buffer.
    pub fn read_buffer(&mut self, buffer: &Arc<Buffer>, offset: u64, size_bytes: u64) -> Result<ReadTicket> {
        self.begin()?;
        buffer.check_range("read of", offset, size_bytes)?;
        let (buffer, offset) = self.read_backs.add_buffer(buffer, offset, size_bytes);
        Ok(ReadTicket { recording: self.recording, buffer, offset, size_bytes })
    }

    /// Asks for the pixels of a colour attachment, rows packed tightly, as they are after the last pass of this
    /// submission.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if the image is not a colour attachment.
    pub fn read_image(&mut self, image: &Arc<Image>) -> Result<ReadTicket> {
        self.begin()?;
        if !matches!(image.format(), ImageFormat::Rgba8Unorm | ImageFormat::R32Uint) {
            return Err(refused(
                format!("read of image {}", image.name()),
                format!("{:?} is not the format of a colour attachment", image.format()),
            ));
        }
        let offset = self.read_backs.add_image(image);
        let size_bytes = image.layer_bytes();
        Ok(ReadTicket { recording: self.recording, buffer: None, offset, size_bytes })
    }

    /// Copies the bytes of a ticket. Call this after its submission, before anything else is recorded.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if the ticket belongs to another submission, or `bytes` has another size.
    pub fn read_into(&self, ticket: &ReadTicket, bytes: &mut [u8]) -> Result<()> {
        if bytes.len() as u64 != ticket.size_bytes {
            return Err(refused(
                "read-back",
                format!("{} bytes requested from a ticket for {}", bytes.len(), ticket.size_bytes),
            ));
        }
        self.look(ticket, |read| bytes.copy_from_slice(read))
    }

    /// Calls `look` with the bytes of a ticket, without copying them. Call this after its submission, before anything
    /// else is recorded. The bytes may have any alignment.
    ///
    /// # Errors
    /// [`Error::Vulkan`] if the ticket belongs to another submission.
    pub fn look<T>(&self, ticket: &ReadTicket, look: impl FnOnce(&[u8]) -> T) -> Result<T> {
        if self.is_recording || ticket.recording != self.recording {
            return Err(refused("read-back", "the ticket does not belong to the last submission"));
        }
        match &ticket.buffer {
            Some(buffer) => buffer.look(ticket.offset, ticket.size_bytes, look),
            None => self.read_backs.look(ticket.offset, ticket.size_bytes, look),
        }
    }

    /// Times of the passes of the last submission; empty without [`Timing::On`] or without timestamps.
    #[must_use]
    pub fn pass_times(&self) -> &[PassTime] {
        self.timer.as_ref().map_or(&[], Timer::times)
    }

    /// How long the last submission took, from handing it over until it was over.
    #[must_use]
    pub fn took(&self) -> Duration {
        self.took
    }

    pub(super) fn note_time(&mut self, took: Duration) {
        self.took = took;
    }

    /// Starts a recording unless one is in progress.
    pub(super) fn begin(&mut self) -> Result<()> {
        if self.is_recording {
            return Ok(());
        }
        if self.device.is_given_up() {
            return Err(submission_failed("vkResetCommandPool", vk::Result::ERROR_DEVICE_LOST, self.last_pass));
        }
        // SAFETY: V1, V2, V3.
        unsafe { self.device.raw().reset_command_pool(self.pool.get(), vk::CommandPoolResetFlags::empty()) }
            .map_err(|result| call_failed("vkResetCommandPool", result))?;
        begin_commands(&self.device, self.pass_commands)?;
        self.is_recording = true;
        self.recording = self.device.next_recording();
        self.last_scope = Scope::Earlier;
        self.last_pass = "transfers";
        if let Some(timer) = &mut self.timer {
            timer.record_reset(self.pass_commands);
        }
        Ok(())
    }

    /// Opens a pass: records the barrier after earlier work, and starts its label and its clock.
    pub(super) fn begin_pass(&mut self, name: &'static str, scope: Scope) -> Result<()> {
        self.begin()?;
        self.require_closed()?;
        self.record_boundary(scope);
        self.last_pass = name;
        self.is_pass_open = true;
        self.record_label(self.pass_commands, name);
        self.stop_query = self.timer.as_mut().and_then(|timer| timer.record_start(self.pass_commands, name));
        Ok(())
    }

    /// Closes what `begin_pass` opened.
    pub(super) fn end_pass(&mut self) {
        self.is_pass_open = false;
        if let (Some(timer), Some(query)) = (&self.timer, self.stop_query.take()) {
            timer.record_stamp(self.pass_commands, query);
        }
        self.record_end_of_label(self.pass_commands);
    }

    /// Begins a named range of commands, for debuggers.
    fn record_label(&mut self, commands: vk::CommandBuffer, name: &str) {
        let Some(debug_utils) = self.device.debug_utils() else { return };
        self.label.clear();
        self.label.extend_from_slice(name.as_bytes());
        self.label.push(0);
        let label = CStr::from_bytes_until_nul(&self.label).unwrap_or_default();
        let label = vk::DebugUtilsLabelEXT::default().label_name(label);
        // SAFETY: V1, V3.
        unsafe { debug_utils.cmd_begin_debug_utils_label(commands, &label) };
    }

    fn record_end_of_label(&self, commands: vk::CommandBuffer) {
        if let Some(debug_utils) = self.device.debug_utils() {
            // SAFETY: V1, V3.
            unsafe { debug_utils.cmd_end_debug_utils_label(commands) };
        }
    }

    fn require_closed(&self) -> Result<()> {
        if self.is_pass_open {
            return Err(refused(format!("recording of pass {}", self.last_pass), "it was never ended"));
        }
        Ok(())
    }

    /// Records the barrier between the last work and `next`.
    pub(super) fn record_boundary(&mut self, next: Scope) {
        record_barrier(&self.device, self.pass_commands, self.last_scope, next);
        self.last_scope = next;
    }

    /// The command buffer of the passes.
    pub(super) fn commands(&self) -> vk::CommandBuffer {
        self.pass_commands
    }

    /// Keeps an object that the commands use until they have run.
    pub(super) fn keep<T: Any + Send + Sync>(&mut self, object: &Arc<T>) {
        // A pass uses the same few objects over and over.
        let recent = self.kept.iter().rev().take(4);
        let address = Arc::as_ptr(object).cast::<()>();
        if !recent.map(|kept| Arc::as_ptr(kept).cast::<()>()).any(|kept| std::ptr::eq(kept, address)) {
            self.kept.push(Arc::<T>::clone(object));
        }
    }

    /// Stores the first error of a recording, which its submission will return.
    pub(super) fn fail(&mut self, error: Error) {
        self.failure.get_or_insert(error);
    }

    /// Records the writes before the passes and the reads after them, and ends the command buffers.
    pub(super) fn finish_recording(&mut self) -> Result<()> {
        if let Some(failure) = self.failure.take() {
            return Err(failure);
        }
        self.require_closed()?;
        if !self.uploads.is_empty() {
            let commands = self.upload_commands;
            begin_commands(&self.device, commands)?;
            self.record_label(commands, UPLOADS);
            let stop_query = self.timer.as_mut().map(|timer| timer.record_start_of_uploads(commands));
            self.uploads.record(&self.device, commands)?;
            if let (Some(timer), Some(query)) = (&self.timer, stop_query) {
                timer.record_stamp(commands, query);
            }
            self.record_end_of_label(commands);
            end_commands(&self.device, commands)?;
        }
        if self.read_backs.has_copies() {
            // Errors keep naming the last pass, since copies do not fail.
            let last_pass = self.last_pass;
            self.begin_pass(READ_BACKS, Scope::Transfer)?;
            self.read_backs.record(&self.device, self.pass_commands)?;
            self.end_pass();
            self.last_pass = last_pass;
        }
        if !self.read_backs.is_empty() {
            self.record_boundary(Scope::HostRead);
        }
        end_commands(&self.device, self.pass_commands)
    }

    /// Clears the recording; results stay readable. Nothing may be in flight.
    pub(super) fn clear(&mut self) {
        self.is_recording = false;
        self.is_pass_open = false;
        self.failure = None;
        self.uploads.clear();
        self.read_backs.clear();
        self.kept.clear();
    }

    pub(super) fn collect_times(&mut self) -> Result<()> {
        self.timer.as_mut().map_or(Ok(()), Timer::collect)
    }

    pub(super) fn is_recording(&self) -> bool {
        self.is_recording
    }

    pub(super) fn has_uploads(&self) -> bool {
        !self.uploads.is_empty()
    }

    /// The command buffers of the writes and of the passes.
    pub(super) fn command_buffers(&self) -> (vk::CommandBuffer, vk::CommandBuffer) {
        (self.upload_commands, self.pass_commands)
    }

    /// The name of the recorder.
    pub(super) fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn observers(&self) -> &[Arc<dyn SubmissionObserver>] {
        &self.observers
    }

    pub(super) fn fence(&self) -> vk::Fence {
        self.fence.get()
    }

    pub(super) fn last_pass(&self) -> &'static str {
        self.last_pass
    }
}
