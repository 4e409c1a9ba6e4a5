//! Raw Vulkan: transfers, passes, pipelines, attachments. How it fails is in `vulkan_failures`.

use std::sync::Arc;

use smalti::Result;
use smalti::vk::{
    Binding, BindingGroup, BindingKind, Buffer, BufferUse, ClearColor, ColorTarget, ComputePipeline, ComputeShader,
    DepthTest, Device, DeviceKind, DeviceOptions, GraphicsPipeline, GraphicsShaders, Image, ImageFormat, ImageShape,
    Instance, Recorder, RenderTargets, Residence, Staging, Timing,
};

use crate::canary;

// Compiled by the command in `shaders_fresh`, which also tests that they are fresh.
pub const NEIGHBOURS: &[u8] = include_bytes!("../golden/vk/neighbours.comp.spv");
const SQUARES_VERTEX: &[u8] = include_bytes!("../golden/vk/squares.vert.spv");
const SQUARES_FRAGMENT: &[u8] = include_bytes!("../golden/vk/squares.frag.spv");

const TWO_BUFFERS: [BindingKind; 2] = [BindingKind::StorageBuffer; 2];

/// Runs `test` once with direct access to the buffers and once through staging.
pub fn on_both_paths(test: impl Fn(&Arc<Device>) -> Result<()>) {
    for staging in [Staging::Auto, Staging::Forced] {
        let options = DeviceOptions { staging, ..DeviceOptions::default() };
        canary::with_device(&options, |device| test(&device))
            .unwrap_or_else(|error| panic!("with staging {staging:?}: {error}"));
    }
}

pub fn storage(device: &Arc<Device>, name: &str, size_bytes: u64) -> Result<Arc<Buffer>> {
    Buffer::create(device, name, size_bytes, BufferUse::Storage, Residence::Device)
}

/// Reads a whole buffer in a submission that may hold other work.
pub fn read_all(recorder: &mut Recorder, buffer: &Arc<Buffer>) -> Result<Vec<u8>> {
    let ticket = recorder.read_buffer(buffer, 0, buffer.size_bytes())?;
    recorder.submit_and_wait()?;
    let mut bytes = vec![0; buffer.size_bytes() as usize];
    recorder.read_into(&ticket, &mut bytes)?;
    Ok(bytes)
}

pub fn words(bytes: &[u8]) -> Vec<u32> {
    bytemuck::pod_collect_to_vec(bytes)
}

pub fn neighbours(device: &Arc<Device>, added: u32) -> Result<Arc<ComputePipeline>> {
    ComputePipeline::create(
        device,
        &ComputeShader {
            name: "neighbours",
            spirv: &words(NEIGHBOURS),
            specialization: &[(3, added), (0, 64)],
            bindings: &TWO_BUFFERS,
            push_constant_bytes: 8,
        },
    )
}

/// What `neighbours.comp` does, in plain words.
fn neighbours_twin(numbers: &[u32], factor: u32, added: u32) -> Vec<u32> {
    (0..numbers.len()).map(|i| numbers[i] + factor * numbers[(i + 1) % numbers.len()] + added).collect()
}

#[test]
fn bytes_written_to_a_buffer_are_the_bytes_read_back() {
    on_both_paths(|device| {
        let buffer = storage(device, "bytes", 300_000)?;
        assert_eq!(buffer.has_host_access(), device.staging() == Staging::Auto, "the path under test was not taken");
        let mut recorder = Recorder::create(device, "test", Timing::Off)?;
        let mut expected: Vec<u8> = (0..300_000_u32).map(|i| (i * 7 % 251) as u8).collect();
        recorder.write_buffer(&buffer, 0, &expected)?;
        assert_eq!(read_all(&mut recorder, &buffer)?, expected);

        // Many small records, in no order, as an evolution writes them; the rest must stay as it was.
        for record in 0..1000_usize {
            let place = record * 397 % 1000 * 64;
            let bytes = [record as u8; 48];
            recorder.write_buffer(&buffer, place as u64, &bytes)?;
            expected[place..place + 48].copy_from_slice(&bytes);
        }
        assert_eq!(read_all(&mut recorder, &buffer)?, expected);
        Ok(())
    });
}

#[test]
fn the_later_of_two_writes_to_one_byte_wins() {
    on_both_paths(|device| {
        let buffer = storage(device, "bytes", 16)?;
        let mut recorder = Recorder::create(device, "test", Timing::Off)?;
        recorder.write_buffer(&buffer, 4, &[1; 8])?;
        recorder.write_buffer(&buffer, 0, &[2; 6])?;
        recorder.write_buffer(&buffer, 8, &[3; 8])?;
        recorder.write_buffer(&buffer, 5, &[4; 1])?;
        assert_eq!(read_all(&mut recorder, &buffer)?, [2, 2, 2, 2, 2, 4, 1, 1, 3, 3, 3, 3, 3, 3, 3, 3]);
        Ok(())
    });
}

#[test]
fn writes_come_before_the_passes_and_reads_after_them_whatever_the_order_of_the_calls() {
    on_both_paths(|device| {
        let (from, to) = (storage(device, "from", 8)?, storage(device, "to", 8)?);
        let mut recorder = Recorder::create(device, "test", Timing::Off)?;
        let ticket = recorder.read_buffer(&to, 2, 5)?;
        {
            let mut pass = recorder.transfer_pass("copy")?;
            pass.fill(&to, 0, 8, 0x0909_0909);
            pass.barrier();
            pass.copy((&from, 4), (&to, 0), 4);
        }
        recorder.write_buffer(&from, 0, &[1, 2, 3, 4, 5, 6, 7, 8])?;
        recorder.submit_and_wait()?;
        let mut bytes = [0; 5];
        recorder.read_into(&ticket, &mut bytes)?;
        assert_eq!(bytes, [7, 8, 9, 9, 9]);
        Ok(())
    });
}

#[test]
fn a_compute_shader_sees_its_constants_and_each_dispatch_the_one_before_it() {
    on_both_paths(|device| {
        let numbers: Vec<u32> = (0..1000).collect();
        let (a, b) = (storage(device, "a", 4000)?, storage(device, "b", 4000)?);
        let pipeline = neighbours(device, 5)?;
        let forth = BindingGroup::create("forth", pipeline.layout(), &[Binding::Buffer(&a), Binding::Buffer(&b)])?;
        let back = BindingGroup::create("back", pipeline.layout(), &[Binding::Buffer(&b), Binding::Buffer(&a)])?;
        let mut recorder = Recorder::create(device, "test", Timing::On)?;
        let mut expected = numbers.clone();
        recorder.write_buffer(&a, 0, bytemuck::cast_slice(&numbers))?;
        for factor in 2..5_u32 {
            {
                let mut pass = recorder.compute_pass("neighbours")?;
                pass.bind(&pipeline, &forth);
                pass.push_constants(bytemuck::cast_slice(&[1000, factor]));
                pass.dispatch(1000_u32.div_ceil(64), 1, 1);
                pass.barrier();
                pass.bind(&pipeline, &back);
                pass.dispatch(1000_u32.div_ceil(64), 1, 1);
            }
            recorder.compute_pass("nothing")?;
            let read = read_all(&mut recorder, &a)?;
            expected = neighbours_twin(&neighbours_twin(&expected, factor, 5), factor, 5);
            assert_eq!(bytemuck::pod_collect_to_vec::<u8, u32>(&read), expected, "factor {factor}");
            let mut times = recorder.pass_times().to_vec();
            // Where bytes are staged, their copies are timed, too.
            times.retain(|time| !["uploads", "read-backs"].contains(&time.name));
            assert_eq!(times.iter().map(|time| time.name).collect::<Vec<_>>(), ["neighbours", "nothing"]);
            assert!(times.windows(2).all(|pair| pair[0].start_ticks <= pair[1].start_ticks), "{times:?}");
            assert!(times[0].ms > 0.0 && times.iter().all(|time| (0.0..60_000.0).contains(&time.ms)), "{times:?}");
        }
        Ok(())
    });
}

#[test]
fn a_pass_sees_the_work_of_every_pass_before_it() {
    on_both_paths(|device| {
        let [a, b, c] = [storage(device, "a", 16)?, storage(device, "b", 16)?, storage(device, "c", 16)?];
        let pipeline = neighbours(device, 1)?;
        let a_to_b = BindingGroup::create("a to b", pipeline.layout(), &[Binding::Buffer(&a), Binding::Buffer(&b)])?;
        let b_to_c = BindingGroup::create("b to c", pipeline.layout(), &[Binding::Buffer(&b), Binding::Buffer(&c)])?;
        let c_to_a = BindingGroup::create("c to a", pipeline.layout(), &[Binding::Buffer(&c), Binding::Buffer(&a)])?;
        let mut recorder = Recorder::create(device, "test", Timing::Off)?;
        recorder.write_buffer(&a, 0, bytemuck::cast_slice(&[1_u32, 2, 3, 4]))?;
        recorder.transfer_pass("fill")?.fill(&a, 4, 4, 9);
        for group in [&a_to_b, &b_to_c, &c_to_a] {
            let mut pass = recorder.compute_pass("neighbours")?;
            pass.bind(&pipeline, group);
            pass.push_constants(bytemuck::cast_slice(&[4_u32, 2]));
            pass.dispatch(1, 1, 1);
        }
        recorder.transfer_pass("copy")?.copy((&a, 0), (&b, 8), 8);
        let read = read_all(&mut recorder, &b)?;
        let once = neighbours_twin(&[1, 9, 3, 4], 2, 1);
        let thrice = neighbours_twin(&neighbours_twin(&once, 2, 1), 2, 1);
        let expected = [once[0], once[1], thrice[0], thrice[1]];
        assert_eq!(bytemuck::pod_collect_to_vec::<u8, u32>(&read), expected);
        Ok(())
    });
}

#[test]
fn what_the_commands_name_lives_exactly_until_they_have_run() {
    on_both_paths(|device| {
        let result = storage(device, "result", 16)?;
        let mut recorder = Recorder::create(device, "test", Timing::Off)?;
        let (group, pipeline, source) = {
            let source = storage(device, "source", 16)?;
            recorder.write_buffer(&source, 0, bytemuck::cast_slice(&[1_u32, 2, 3, 4]))?;
            let pipeline = neighbours(device, 0)?;
            let bindings = [Binding::Buffer(&source), Binding::Buffer(&result)];
            let group = BindingGroup::create("short-lived", pipeline.layout(), &bindings)?;
            let mut pass = recorder.compute_pass("neighbours")?;
            pass.bind(&pipeline, &group);
            pass.push_constants(bytemuck::cast_slice(&[4_u32, 1]));
            pass.dispatch(1, 1, 1);
            (Arc::downgrade(&group), Arc::downgrade(&pipeline), Arc::downgrade(&source))
        };
        assert_eq!([group.strong_count(), pipeline.strong_count()], [1, 1], "before the submission");
        let read = read_all(&mut recorder, &result)?;
        assert_eq!(bytemuck::pod_collect_to_vec::<u8, u32>(&read), [3, 5, 7, 5]);
        let counts = [group.strong_count(), pipeline.strong_count(), source.strong_count()];
        assert_eq!(counts, [0, 0, 0], "after the submission");
        Ok(())
    });
}

/// A square as `squares.vert` reads it.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Square {
    left: u32,
    top: u32,
    side: u32,
    depth: f32,
    number: u32,
    layer: u32,
}

pub fn squares(device: &Arc<Device>) -> Result<Arc<GraphicsPipeline>> {
    GraphicsPipeline::create(
        device,
        &GraphicsShaders {
            name: "squares",
            vertex: &words(SQUARES_VERTEX),
            fragment: &words(SQUARES_FRAGMENT),
            specialization: &[],
            bindings: &[BindingKind::StorageBuffer, BindingKind::SampledImage],
            push_constant_bytes: 8,
            colors: &[ImageFormat::Rgba8Unorm, ImageFormat::R32Uint],
            depth: DepthTest::Less,
        },
    )
}

#[test]
fn the_nearer_of_two_squares_covers_exactly_its_pixels_in_both_attachments() {
    on_both_paths(|device| {
        let shape = ImageShape { width_px: 32, height_px: 24, layers: 1 };
        let color = Image::create(device, "color", ImageFormat::Rgba8Unorm, shape)?;
        let ids = Image::create(device, "ids", ImageFormat::R32Uint, shape)?;
        let depth = Image::create(device, "depth", ImageFormat::D32Float, shape)?;
        let texture_shape = ImageShape { width_px: 2, height_px: 1, layers: 2 };
        let texture = Image::create(device, "texture", ImageFormat::Rg8Uint, texture_shape)?;
        let list = [
            Square { left: 2, top: 3, side: 10, depth: 0.25, number: 7, layer: 0 },
            Square { left: 6, top: 5, side: 12, depth: 0.5, number: 8, layer: 1 },
        ];
        let buffer = storage(device, "squares", size_of_val(&list) as u64)?;
        let pipeline = squares(device)?;
        let bindings = [Binding::Buffer(&buffer), Binding::SampledImage(&texture)];
        let group = BindingGroup::create("squares", pipeline.layout(), &bindings)?;

        let mut recorder = Recorder::create(device, "test", Timing::Off)?;
        recorder.write_buffer(&buffer, 0, bytemuck::cast_slice(&list))?;
        recorder.write_image_layer(&texture, 1, &[0; 4])?;
        recorder.write_image_layer(&texture, 0, &[1, 2, 30, 40])?;
        recorder.write_image_layer(&texture, 1, &[3, 4, 50, 60])?;
        let colors = [
            ColorTarget { image: &color, clear: ClearColor::Float([1.0, 0.0, 0.0, 0.0]) },
            ColorTarget { image: &ids, clear: ClearColor::Uint([u32::MAX, 0, 0, 0]) },
        ];
        let targets = RenderTargets { colors: &colors, depth: Some(&depth), width_px: 32, height_px: 24 };
        // Twice, so that the second pass has to wait for the attachments of the first.
        for _ in 0..2 {
            let mut pass = recorder.render_pass("squares", &targets)?;
            pass.bind(&pipeline, &group);
            pass.push_constants(bytemuck::cast_slice(&[32.0_f32, 24.0]));
            pass.draw(4, 2);
        }
        let tickets = [recorder.read_image(&color)?, recorder.read_image(&ids)?];
        recorder.submit_and_wait()?;
        let mut pixels = [[0_u8; 32 * 24 * 4]; 2];
        for (ticket, pixels) in tickets.iter().zip(&mut pixels) {
            recorder.read_into(ticket, pixels)?;
        }

        for place in 0..32 * 24 {
            let (x, y) = (place % 32, place / 32);
            let inside = |square: &&Square| {
                x >= square.left && x < square.left + square.side && y >= square.top && y < square.top + square.side
            };
            let (color, id) = match list.iter().find(inside) {
                Some(square) if square.layer == 0 => ([30, 40, 0, 255], square.number),
                Some(square) => ([50, 60, 0, 255], square.number),
                None => ([255, 0, 0, 0], u32::MAX),
            };
            let bytes = place as usize * 4..place as usize * 4 + 4;
            assert_eq!(pixels[0][bytes.clone()], color, "colour at {x}, {y}");
            assert_eq!(pixels[1][bytes], id.to_ne_bytes(), "number at {x}, {y}");
        }
        Ok(())
    });
}

#[test]
fn a_render_pass_clears_its_area_and_leaves_the_rest() {
    on_both_paths(|device| {
        let shape = ImageShape { width_px: 4, height_px: 3, layers: 1 };
        let ids = Image::create(device, "ids", ImageFormat::R32Uint, shape)?;
        let mut recorder = Recorder::create(device, "test", Timing::Off)?;
        for (number, width_px, height_px) in [(5, 4, 3), (6, 2, 1)] {
            let colors = [ColorTarget { image: &ids, clear: ClearColor::Uint([number, 0, 0, 0]) }];
            recorder.render_pass("clear", &RenderTargets { colors: &colors, depth: None, width_px, height_px })?;
        }
        let ticket = recorder.read_image(&ids)?;
        recorder.submit_and_wait()?;
        let mut numbers = [0_u32; 12];
        recorder.read_into(&ticket, bytemuck::cast_slice_mut(&mut numbers))?;
        assert_eq!(numbers, [6, 6, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5]);
        Ok(())
    });
}

#[test]
fn any_bytes_are_accepted_as_a_saved_pipeline_cache() {
    let saved = canary::with_device(&DeviceOptions::default(), |device| {
        neighbours(&device, 0).map(|_| device.pipeline_cache_bytes()).expect("the shader compiles")
    });
    for pipeline_cache in [saved, b"no pipeline cache".to_vec(), vec![0xff; 4096]] {
        let options = DeviceOptions { pipeline_cache, ..DeviceOptions::default() };
        canary::with_device(&options, |device| neighbours(&device, 0).map(drop)).expect("the shader compiles");
    }
}

#[test]
fn software_vulkan_is_described_as_a_device_that_lacks_nothing() {
    canary::with_device(&DeviceOptions::default(), |device| {
        let info = device.info();
        assert_eq!(info.kind, DeviceKind::Cpu);
        assert_eq!(info.missing, Vec::<String>::new());
        assert_eq!(info.missing_for_drawing, Vec::<String>::new());
        assert!(info.can_draw());
        assert!(info.api_version.starts_with("1."), "{}", info.api_version);
        assert!(info.subgroup_size.is_power_of_two(), "{}", info.subgroup_size);
        assert!(info.subgroup_operations.contains(&"arithmetic"), "{:?}", info.subgroup_operations);
        assert!(info.memory_bytes > 1 << 20, "{}", info.memory_bytes);
        assert!(info.limits.workgroup_invocations >= 128, "{:?}", info.limits);
        let json = serde_json::to_value(info).expect("a description is plain data");
        assert_eq!(json["kind"], "cpu");
        assert_eq!(json["uuid"].as_str().map(str::len), Some(36));
    });
}

#[test]
fn everything_that_an_evaluator_holds_can_move_to_another_thread() {
    fn is_send<T: Send>() {}
    is_send::<Arc<Instance>>();
    is_send::<Arc<Device>>();
    is_send::<Arc<Buffer>>();
    is_send::<Arc<Image>>();
    is_send::<Arc<BindingGroup>>();
    is_send::<Arc<ComputePipeline>>();
    is_send::<Arc<GraphicsPipeline>>();
    is_send::<Recorder>();
}
