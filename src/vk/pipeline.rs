//! Pipelines: compiled shaders with their bindings, push constants and fixed state.

use std::sync::Arc;

use ash::vk;

use super::handle::Owned;
use super::image::ImageFormat;
use super::pipeline_layout::{BindingKind, PipelineLayout};
use super::{Device, refused};
use crate::error::Result;

/// First word of every SPIR-V module.
const SPIRV_MAGIC: u32 = 0x0723_0203;

/// What a compute pipeline is created from.
#[derive(Debug, Clone, Copy)]
pub struct ComputeShader<'a> {
    /// Debug name: the stem of the shader's file.
    pub name: &'a str,
    /// The module, with the entry point `main`.
    pub spirv: &'a [u32],
    /// Specialisation constants: number and value.
    pub specialization: &'a [(u32, u32)],
    /// What is bound at set 0, binding 0, 1, ...
    pub bindings: &'a [BindingKind],
    /// Size of the push constants in bytes, a multiple of 4.
    pub push_constant_bytes: u32,
}

/// Whether a graphics pipeline tests and writes depth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DepthTest {
    /// No depth attachment.
    Off,
    /// A pixel is drawn if it is nearer (its depth is less) than the pixel there.
    Less,
}

/// What a graphics pipeline is created from. It draws triangle strips without culling or blending; the vertex shader
/// fetches its vertices from storage buffers.
#[derive(Debug, Clone, Copy)]
pub struct GraphicsShaders<'a> {
    /// Debug name: the stem of the shaders' files.
    pub name: &'a str,
    /// The vertex module, with the entry point `main`.
    pub vertex: &'a [u32],
    /// The fragment module, with the entry point `main`.
    pub fragment: &'a [u32],
    /// Specialisation constants of both modules: number and value.
    pub specialization: &'a [(u32, u32)],
    /// What is bound at set 0, binding 0, 1, ...
    pub bindings: &'a [BindingKind],
    /// Size of the push constants in bytes, a multiple of 4.
    pub push_constant_bytes: u32,
    /// Formats of the colour attachments at location 0, 1, ...
    pub colors: &'a [ImageFormat],
    /// Whether there is a depth attachment.
    pub depth: DepthTest,
}

/// A compute shader, ready to be dispatched.
pub struct ComputePipeline {
    handle: Owned<vk::Pipeline>,
    layout: PipelineLayout,
}

impl ComputePipeline {
    /// Compiles the shader for the device.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] if the module is not SPIR-V or the driver refuses it.
    pub fn create(device: &Arc<Device>, shader: &ComputeShader<'_>) -> Result<Arc<Self>> {
        let name = shader.name;
        let layout = PipelineLayout::create(device, name, shader.bindings, shader.push_constant_bytes)?;
        let module = create_module(device, name, shader.spirv)?;
        let constants = Specialization::new(shader.specialization);
        let specialization = constants.info();
        let stage = stage(vk::ShaderStageFlags::COMPUTE, module.get(), &specialization);
        let infos = [vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout.raw())];
        // SAFETY: V1, V4.
        let created = unsafe { device.raw().create_compute_pipelines(device.pipeline_cache(), &infos, None) };
        let handle = take_one(device, name, created)?;
        Ok(Arc::new(Self { handle, layout }))
    }

    /// What the pipeline expects to be bound.
    #[must_use]
    pub fn layout(&self) -> &PipelineLayout {
        &self.layout
    }

    pub(super) fn raw(&self) -> vk::Pipeline {
        self.handle.get()
    }
}

/// A vertex and a fragment shader, ready to draw.
pub struct GraphicsPipeline {
    handle: Owned<vk::Pipeline>,
    layout: PipelineLayout,
    colors: Vec<ImageFormat>,
    depth: DepthTest,
}

impl GraphicsPipeline {
    /// Compiles the shaders for the device.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] if a module is not SPIR-V, the driver refuses it, or the device cannot draw.
    pub fn create(device: &Arc<Device>, shaders: &GraphicsShaders<'_>) -> Result<Arc<Self>> {
        let name = shaders.name;
        device.require_drawing(&format!("creation of pipeline {name}"))?;
        let layout = PipelineLayout::create(device, name, shaders.bindings, shaders.push_constant_bytes)?;
        let vertex = create_module(device, name, shaders.vertex)?;
        let fragment = create_module(device, name, shaders.fragment)?;
        let constants = Specialization::new(shaders.specialization);
        let specialization = constants.info();
        let stages = [
            stage(vk::ShaderStageFlags::VERTEX, vertex.get(), &specialization),
            stage(vk::ShaderStageFlags::FRAGMENT, fragment.get(), &specialization),
        ];
        let handle = create_graphics(device, shaders, &layout, &stages)?;
        Ok(Arc::new(Self { handle, layout, colors: shaders.colors.to_vec(), depth: shaders.depth }))
    }

    /// What the pipeline expects to be bound.
    #[must_use]
    pub fn layout(&self) -> &PipelineLayout {
        &self.layout
    }

    /// Formats of the colour attachments that the pipeline draws to.
    #[must_use]
    pub fn colors(&self) -> &[ImageFormat] {
        &self.colors
    }

    /// Whether the pipeline needs a depth attachment.
    #[must_use]
    pub fn depth(&self) -> DepthTest {
        self.depth
    }

    pub(super) fn raw(&self) -> vk::Pipeline {
        self.handle.get()
    }
}

fn create_graphics(
    device: &Arc<Device>,
    shaders: &GraphicsShaders<'_>,
    layout: &PipelineLayout,
    stages: &[vk::PipelineShaderStageCreateInfo<'_>],
) -> Result<Owned<vk::Pipeline>> {
    let vertex_input = vk::PipelineVertexInputStateCreateInfo::default();
    let assembly = vk::PipelineInputAssemblyStateCreateInfo::default().topology(vk::PrimitiveTopology::TRIANGLE_STRIP);
    let viewport = vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
    let raster = vk::PipelineRasterizationStateCreateInfo::default()
        .polygon_mode(vk::PolygonMode::FILL)
        .cull_mode(vk::CullModeFlags::NONE)
        .line_width(1.0);
    let multisample =
        vk::PipelineMultisampleStateCreateInfo::default().rasterization_samples(vk::SampleCountFlags::TYPE_1);
    let tests_depth = shaders.depth == DepthTest::Less;
    let depth = vk::PipelineDepthStencilStateCreateInfo::default()
        .depth_test_enable(tests_depth)
        .depth_write_enable(tests_depth)
        .depth_compare_op(vk::CompareOp::LESS);
    let opaque = vk::PipelineColorBlendAttachmentState::default().color_write_mask(vk::ColorComponentFlags::RGBA);
    let attachments = vec![opaque; shaders.colors.len()];
    let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&attachments);
    let dynamic_states = [vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR];
    let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&dynamic_states);
    let formats: Vec<vk::Format> = shaders.colors.iter().map(|format| format.raw()).collect();
    let mut rendering = vk::PipelineRenderingCreateInfo::default().color_attachment_formats(&formats);
    if tests_depth {
        rendering = rendering.depth_attachment_format(ImageFormat::D32Float.raw());
    }
    let infos = [vk::GraphicsPipelineCreateInfo::default()
        .stages(stages)
        .vertex_input_state(&vertex_input)
        .input_assembly_state(&assembly)
        .viewport_state(&viewport)
        .rasterization_state(&raster)
        .multisample_state(&multisample)
        .depth_stencil_state(&depth)
        .color_blend_state(&blend)
        .dynamic_state(&dynamic)
        .layout(layout.raw())
        .push_next(&mut rendering)];
    // SAFETY: V1, V4.
    let created = unsafe { device.raw().create_graphics_pipelines(device.pipeline_cache(), &infos, None) };
    take_one(device, shaders.name, created)
}

/// Specialisation constants in the form that Vulkan reads.
struct Specialization {
    entries: Vec<vk::SpecializationMapEntry>,
    values: Vec<u8>,
}

impl Specialization {
    fn new(constants: &[(u32, u32)]) -> Self {
        let entries = (0..)
            .zip(constants)
            .map(|(index, &(constant_id, _))| vk::SpecializationMapEntry { constant_id, offset: index * 4, size: 4 })
            .collect();
        let values = constants.iter().flat_map(|(_, value)| value.to_ne_bytes()).collect();
        Self { entries, values }
    }

    fn info(&self) -> vk::SpecializationInfo<'_> {
        vk::SpecializationInfo::default().map_entries(&self.entries).data(&self.values)
    }
}

fn stage<'a>(
    stage: vk::ShaderStageFlags,
    module: vk::ShaderModule,
    specialization: &'a vk::SpecializationInfo<'a>,
) -> vk::PipelineShaderStageCreateInfo<'a> {
    vk::PipelineShaderStageCreateInfo::default()
        .stage(stage)
        .module(module)
        .name(c"main")
        .specialization_info(specialization)
}

fn create_module(device: &Arc<Device>, name: &str, spirv: &[u32]) -> Result<Owned<vk::ShaderModule>> {
    let failed = |reason: String| refused(format!("loading of shader {name}"), reason);
    if spirv.first() != Some(&SPIRV_MAGIC) {
        return Err(failed("it is not a SPIR-V module".to_owned()));
    }
    let info = vk::ShaderModuleCreateInfo::default().code(spirv);
    // SAFETY: V1, V4.
    let module = unsafe { device.raw().create_shader_module(&info, None) }.map_err(|r| failed(r.to_string()))?;
    Ok(Owned::new(device, module, name))
}

/// Takes over the only pipeline of a call that creates several.
fn take_one(
    device: &Arc<Device>,
    name: &str,
    created: Result<Vec<vk::Pipeline>, (Vec<vk::Pipeline>, vk::Result)>,
) -> Result<Owned<vk::Pipeline>> {
    let failed = |reason: String| refused(format!("creation of pipeline {name}"), reason);
    // If the call fails, all its handles are null, since it was asked for only one pipeline.
    let pipelines = created.map_err(|(_, result)| failed(result.to_string()))?;
    let pipeline = pipelines.first().ok_or_else(|| failed("the driver returned no pipeline".to_owned()))?;
    Ok(Owned::new(device, *pipeline, name))
}
