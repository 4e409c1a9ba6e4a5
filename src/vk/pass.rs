//! Passes: pieces of a submission that do one kind of work. A pass borrows the recorder and ends when it is dropped.
//!
//! A mistake in a pass, such as a dispatch without a pipeline, is returned by `Recorder::submit_and_wait`.

use std::sync::Arc;

use ash::vk;

use super::commands::record_barrier;
use super::recorder::Recorder;
use super::scope::Scope;
use super::{
    BindingGroup, Buffer, ComputePipeline, DepthTest, GraphicsPipeline, Image, ImageFormat, PipelineLayout, refused,
};
use crate::error::Result;

/// What later calls need to know about the bound pipeline.
#[derive(Clone, Copy)]
struct Bound {
    layout: vk::PipelineLayout,
    push_constant_bytes: u32,
}

impl Recorder {
    /// Begins a pass of fills and copies on the device. `name` is its label in debuggers, times and errors.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] if the driver cannot begin a recording.
    pub fn transfer_pass(&mut self, name: &'static str) -> Result<TransferPass<'_>> {
        self.begin_pass(name, Scope::Transfer)?;
        Ok(TransferPass { recorder: self })
    }

    /// Begins a pass of compute shaders. `name` is its label in debuggers, times and errors.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] if the driver cannot begin a recording.
    pub fn compute_pass(&mut self, name: &'static str) -> Result<ComputePass<'_>> {
        self.begin_pass(name, Scope::Compute)?;
        Ok(ComputePass { recorder: self, bound: None })
    }

    /// Begins a pass that clears `targets` and draws into them. `name` is its label in debuggers, times and errors.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] if the targets are smaller than the area or not of the right formats, or if the device
    /// cannot draw.
    pub fn render_pass(&mut self, name: &'static str, targets: &RenderTargets<'_>) -> Result<RenderPass<'_>> {
        self.device().require_drawing(&format!("recording of pass {name}"))?;
        targets.check(name)?;
        self.begin_pass(name, Scope::Graphics)?;
        for target in targets.colors {
            self.keep(target.image);
        }
        if let Some(depth) = targets.depth {
            self.keep(depth);
        }
        record_begin_rendering(self, targets);
        Ok(RenderPass {
            colors: targets.colors.iter().map(|target| target.image.format()).collect(),
            depth: if targets.depth.is_some() { DepthTest::Less } else { DepthTest::Off },
            recorder: self,
            bound: None,
        })
    }

    fn fail_pass(&mut self, reason: impl Into<String>) {
        let error = refused(format!("recording of pass {}", self.last_pass()), reason);
        self.fail(error);
    }

    fn record_bind(
        &mut self,
        point: vk::PipelineBindPoint,
        pipeline: vk::Pipeline,
        layout: &PipelineLayout,
        group: &Arc<BindingGroup>,
    ) -> Option<Bound> {
        if group.kinds() != layout.bindings() {
            self.fail_pass(format!("binding group {} does not fit pipeline {}", group.name(), layout.name()));
            return None;
        }
        self.keep(group);
        let (commands, sets) = (self.commands(), [group.raw()]);
        let raw = self.device().raw();
        // SAFETY: V1, V2, V3.
        unsafe {
            raw.cmd_bind_pipeline(commands, point, pipeline);
            raw.cmd_bind_descriptor_sets(commands, point, layout.raw(), 0, &sets, &[]);
        }
        Some(Bound { layout: layout.raw(), push_constant_bytes: layout.push_constant_bytes() })
    }

    fn record_push_constants(&mut self, bound: Option<Bound>, bytes: &[u8]) {
        let Some(bound) = bound else {
            return self.fail_pass("push constants without a pipeline");
        };
        if bytes.len() != bound.push_constant_bytes as usize {
            let expected = bound.push_constant_bytes;
            return self.fail_pass(format!("{} bytes of push constants instead of {expected}", bytes.len()));
        }
        if !bytes.is_empty() {
            let stages = super::pipeline_layout::STAGES;
            // SAFETY: V1, V3, V4.
            unsafe { self.device().raw().cmd_push_constants(self.commands(), bound.layout, stages, 0, bytes) };
        }
    }
}

/// Fills and copies on the device.
pub struct TransferPass<'a> {
    recorder: &'a mut Recorder,
}

impl TransferPass<'_> {
    /// Sets `size_bytes` at `offset`, both multiples of 4, to repetitions of `value`.
    pub fn fill(&mut self, buffer: &Arc<Buffer>, offset: u64, size_bytes: u64, value: u32) {
        if let Err(error) = buffer.check_range("fill of", offset, size_bytes) {
            return self.recorder.fail(error);
        }
        if !offset.is_multiple_of(4) || !size_bytes.is_multiple_of(4) {
            return self.recorder.fail_pass(format!("fill of {size_bytes} bytes at {offset} of {}", buffer.name()));
        }
        if size_bytes > 0 {
            self.recorder.keep(buffer);
            let commands = self.recorder.commands();
            // SAFETY: V1, V2, V3, V5.
            unsafe {
                self.recorder.device().raw().cmd_fill_buffer(commands, buffer.raw(), offset, size_bytes, value);
            }
        }
    }

    /// Copies `size_bytes` from one buffer and offset to another.
    pub fn copy(&mut self, from: (&Arc<Buffer>, u64), to: (&Arc<Buffer>, u64), size_bytes: u64) {
        let ranges = from
            .0
            .check_range("copy from", from.1, size_bytes)
            .and_then(|()| to.0.check_range("copy to", to.1, size_bytes));
        if let Err(error) = ranges {
            return self.recorder.fail(error);
        }
        if Arc::ptr_eq(from.0, to.0) && from.1.abs_diff(to.1) < size_bytes {
            return self.recorder.fail_pass(format!("copy within {} overlaps itself", from.0.name()));
        }
        if size_bytes > 0 {
            self.recorder.keep(from.0);
            self.recorder.keep(to.0);
            let commands = self.recorder.commands();
            let copy = vk::BufferCopy { src_offset: from.1, dst_offset: to.1, size: size_bytes };
            // SAFETY: V1, V2, V3, V5.
            unsafe { self.recorder.device().raw().cmd_copy_buffer(commands, from.0.raw(), to.0.raw(), &[copy]) };
        }
    }

    /// Makes everything written so far visible to the rest of the pass.
    pub fn barrier(&mut self) {
        record_barrier(self.recorder.device(), self.recorder.commands(), Scope::Transfer, Scope::Transfer);
    }
}

impl Drop for TransferPass<'_> {
    fn drop(&mut self) {
        self.recorder.end_pass();
    }
}

/// Dispatches of compute shaders.
pub struct ComputePass<'a> {
    recorder: &'a mut Recorder,
    bound: Option<Bound>,
}

impl ComputePass<'_> {
    /// Sets the shader of the next dispatches and its bindings.
    pub fn bind(&mut self, pipeline: &Arc<ComputePipeline>, group: &Arc<BindingGroup>) {
        self.recorder.keep(pipeline);
        let (point, raw) = (vk::PipelineBindPoint::COMPUTE, pipeline.raw());
        self.bound = self.recorder.record_bind(point, raw, pipeline.layout(), group);
    }

    /// Sets all push constants of the bound pipeline.
    pub fn push_constants(&mut self, bytes: &[u8]) {
        self.recorder.record_push_constants(self.bound, bytes);
    }

    /// Runs `x` * `y` * `z` workgroups.
    pub fn dispatch(&mut self, x: u32, y: u32, z: u32) {
        if self.bound.is_none() {
            return self.recorder.fail_pass("dispatch without a pipeline");
        }
        let limits = self.recorder.device().info().limits.workgroups;
        if x > limits[0] || y > limits[1] || z > limits[2] {
            return self.recorder.fail_pass(format!("{x}x{y}x{z} workgroups exceed the limits {limits:?}"));
        }
        // SAFETY: V1, V2, V3, V4, V5.
        unsafe { self.recorder.device().raw().cmd_dispatch(self.recorder.commands(), x, y, z) };
    }

    /// Makes everything that earlier dispatches wrote visible to the next ones.
    pub fn barrier(&mut self) {
        record_barrier(self.recorder.device(), self.recorder.commands(), Scope::Compute, Scope::Compute);
    }
}

impl Drop for ComputePass<'_> {
    fn drop(&mut self) {
        self.recorder.end_pass();
    }
}

/// What a colour attachment holds before the first draw.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ClearColor {
    /// For [`ImageFormat::Rgba8Unorm`]: channels from 0 to 1.
    Float([f32; 4]),
    /// For [`ImageFormat::R32Uint`]: the first number.
    Uint([u32; 4]),
}

/// A colour attachment.
#[derive(Clone, Copy)]
pub struct ColorTarget<'a> {
    /// The image.
    pub image: &'a Arc<Image>,
    /// What it holds before the first draw.
    pub clear: ClearColor,
}

/// What a render pass draws into. Only the area of `width_px` by `height_px` from the upper left corner is touched.
#[derive(Clone, Copy)]
pub struct RenderTargets<'a> {
    /// The colour attachments at location 0, 1, ...
    pub colors: &'a [ColorTarget<'a>],
    /// The depth attachment, cleared to 1; its contents are gone after the pass.
    pub depth: Option<&'a Arc<Image>>,
    /// Width of the area.
    pub width_px: u32,
    /// Height of the area.
    pub height_px: u32,
}

impl RenderTargets<'_> {
    fn check(&self, pass: &str) -> Result<()> {
        let fits = |image: &Image| self.width_px <= image.shape().width_px && self.height_px <= image.shape().height_px;
        let color_fits = |target: &ColorTarget<'_>| {
            let format = match target.clear {
                ClearColor::Float(_) => ImageFormat::Rgba8Unorm,
                ClearColor::Uint(_) => ImageFormat::R32Uint,
            };
            target.image.format() == format && fits(target.image)
        };
        let depth_fits = self.depth.is_none_or(|image| image.format() == ImageFormat::D32Float && fits(image));
        let has_area = self.width_px > 0 && self.height_px > 0;
        if has_area && depth_fits && self.colors.iter().all(color_fits) {
            return Ok(());
        }
        Err(refused(
            format!("recording of pass {pass}"),
            format!("its targets do not fit an area of {}x{} px or its formats", self.width_px, self.height_px),
        ))
    }
}

fn record_begin_rendering(recorder: &Recorder, targets: &RenderTargets<'_>) {
    let attachment = |image: &Image, clear: vk::ClearValue| {
        vk::RenderingAttachmentInfo::default()
            .image_view(image.view())
            .image_layout(vk::ImageLayout::GENERAL)
            .load_op(vk::AttachmentLoadOp::CLEAR)
            .store_op(vk::AttachmentStoreOp::STORE)
            .clear_value(clear)
    };
    let colors: Vec<vk::RenderingAttachmentInfo<'_>> = targets
        .colors
        .iter()
        .map(|target| {
            let color = match target.clear {
                ClearColor::Float(float32) => vk::ClearColorValue { float32 },
                ClearColor::Uint(uint32) => vk::ClearColorValue { uint32 },
            };
            attachment(target.image, vk::ClearValue { color })
        })
        .collect();
    let far = vk::ClearValue { depth_stencil: vk::ClearDepthStencilValue { depth: 1.0, stencil: 0 } };
    let depth = targets.depth.map(|image| attachment(image, far).store_op(vk::AttachmentStoreOp::DONT_CARE));
    let extent = vk::Extent2D { width: targets.width_px, height: targets.height_px };
    let area = vk::Rect2D { offset: vk::Offset2D::default(), extent };
    let mut info = vk::RenderingInfo::default().render_area(area).layer_count(1).color_attachments(&colors);
    if let Some(depth) = &depth {
        info = info.depth_attachment(depth);
    }
    let viewport = vk::Viewport {
        width: targets.width_px as f32,
        height: targets.height_px as f32,
        max_depth: 1.0,
        ..Default::default()
    };
    let (raw, commands) = (recorder.device().raw(), recorder.commands());
    // SAFETY: V1, V2, V3, V5.
    unsafe {
        raw.cmd_begin_rendering(commands, &info);
        raw.cmd_set_viewport(commands, 0, &[viewport]);
        raw.cmd_set_scissor(commands, 0, &[area]);
    }
}

/// Draws into the targets of the pass.
pub struct RenderPass<'a> {
    recorder: &'a mut Recorder,
    bound: Option<Bound>,
    colors: Vec<ImageFormat>,
    depth: DepthTest,
}

impl RenderPass<'_> {
    /// Sets the shaders of the next draws and their bindings.
    pub fn bind(&mut self, pipeline: &Arc<GraphicsPipeline>, group: &Arc<BindingGroup>) {
        if pipeline.colors() != self.colors || pipeline.depth() != self.depth {
            let name = pipeline.layout().name();
            return self
                .recorder
                .fail_pass(format!("pipeline {name} draws to formats other than those of the targets"));
        }
        self.recorder.keep(pipeline);
        let (point, raw) = (vk::PipelineBindPoint::GRAPHICS, pipeline.raw());
        self.bound = self.recorder.record_bind(point, raw, pipeline.layout(), group);
    }

    /// Sets all push constants of the bound pipeline.
    pub fn push_constants(&mut self, bytes: &[u8]) {
        self.recorder.record_push_constants(self.bound, bytes);
    }

    /// Draws a triangle strip of `vertices` vertices once for each instance.
    pub fn draw(&mut self, vertices: u32, instances: u32) {
        if self.bound.is_none() {
            return self.recorder.fail_pass("draw without a pipeline");
        }
        // SAFETY: V1, V2, V3, V4, V5.
        unsafe { self.recorder.device().raw().cmd_draw(self.recorder.commands(), vertices, instances, 0, 0) };
    }
}

impl Drop for RenderPass<'_> {
    fn drop(&mut self) {
        // SAFETY: V1, V3.
        unsafe { self.recorder.device().raw().cmd_end_rendering(self.recorder.commands()) };
        self.recorder.end_pass();
    }
}
