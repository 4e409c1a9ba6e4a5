//! The screen of a window, in a real one: an X server without a display, under the validation layer.

use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::time::Duration;

use egui::{Color32, Rect, TexturesDelta, pos2, vec2};
use smalti::vk::{Image, ImageFormat, ImageShape, Painted, Recorder, Screen, Timing, Validation};
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, EventLoop};
use winit::platform::x11::EventLoopBuilderExtX11;
use winit::window::{Window, WindowId};

use crate::display::{Display, photograph};
use crate::workshop::Workshop;

/// A dark colour, where a display is at its most inexact.
const SHOWN: [u8; 3] = [10, 3, 77];
const BEHIND: [u8; 3] = [200, 100, 50];

#[test]
fn a_window_shows_the_interface_and_an_image_at_every_size_and_validation_is_silent() {
    let display = Display::start(1_024, 768);
    let workshop = Workshop::new();
    let picture = workshop.path("screen.png");
    // A process has one event loop for all its life, so that the window gets a process of its own.
    let output = Command::new(std::env::current_exe().expect("the test binary has a path"))
        .args(["--exact", "screen::child_that_opens_a_window", "--ignored", "--nocapture"])
        .env("DISPLAY", display.name())
        .env_remove("WAYLAND_DISPLAY")
        .env("SMALTI_TEST_PICTURE", &picture)
        .output()
        .expect("the test binary runs");
    let told = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success() && told.contains("1 passed"), "{told}");
    let screen = workshop.pixels("screen.png");
    let count = |color: [u8; 3]| screen.pixels().filter(|pixel| pixel.0 == color).count();
    assert_eq!(count(SHOWN), 100 * 80, "the image is shown pixel by pixel, with its bytes");
    assert!(count([255; 3]) > 20, "the text is white");
    let is_behind = |pixel: &image::Rgb<u8>| pixel.0.iter().zip(BEHIND).all(|(&one, other)| one.abs_diff(other) <= 1);
    assert!(screen.pixels().filter(|pixel| is_behind(pixel)).count() > 100_000, "the colour of the interface");
}

/// Opens a window for the test above.
#[test]
#[ignore = "only a child process of another test runs it"]
fn child_that_opens_a_window() {
    if std::env::var_os("SMALTI_TEST_PICTURE").is_none() {
        return;
    }
    let event_loop = EventLoop::builder().with_any_thread(true).build().expect("there is an X server");
    let mut app = App::default();
    event_loop.run_app(&mut app).expect("the event loop runs");
    assert!(app.has_run);
}

#[derive(Default)]
struct App {
    has_run: bool,
}

impl ApplicationHandler for App {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        let attributes = Window::default_attributes().with_inner_size(PhysicalSize::new(640, 400));
        let window = Arc::new(event_loop.create_window(attributes).expect("a window opens"));
        let messages = show(&window);
        assert_eq!(Arc::strong_count(&window), 1, "the screen lets go of its window");
        assert!(messages.is_empty(), "the validation layer complains:\n{}", messages.join("\n"));
        self.has_run = true;
        event_loop.exit();
    }

    fn window_event(&mut self, _: &ActiveEventLoop, _: WindowId, _: WindowEvent) {}
}

/// Paints into a window; returns what the validation layer said until everything was gone.
fn show(window: &Arc<Window>) -> Vec<String> {
    let mut screen = Screen::create(Arc::clone(window), [640, 400], Validation::On).expect("a device shows windows");
    let log = Arc::clone(screen.validation_log());
    let mut stage = Stage::new(&mut screen);
    for _ in 0..30 {
        assert_eq!(stage.paint(&mut screen, [640, 400]), Painted::Shown);
    }
    for size_px in [[333, 222], [1, 1], [900, 700], [0, 0], [64, 500], [640, 400]] {
        let _ = window.request_inner_size(PhysicalSize::new(size_px[0].max(1), size_px[1].max(1)));
        std::thread::sleep(Duration::from_millis(50));
        let expected = if size_px == [0, 0] { Painted::Skipped } else { Painted::Shown };
        screen.resize(size_px);
        for _ in 0..3 {
            assert_eq!(stage.paint(&mut screen, size_px), expected, "at {size_px:?} px");
        }
    }
    // The window changes its size and nobody tells the screen.
    let _ = window.request_inner_size(PhysicalSize::new(700, 500));
    std::thread::sleep(Duration::from_millis(50));
    assert_eq!(stage.paint(&mut screen, [700, 500]), Painted::Shown);
    std::thread::sleep(Duration::from_millis(100));
    let picture = std::env::var_os("SMALTI_TEST_PICTURE").expect("the parent says where to");
    photograph(&std::env::var("DISPLAY").expect("the parent tells its display"), Path::new(&picture));

    screen.remove_image(stage.id);
    let gone = stage.try_paint(&mut screen, [700, 500]).expect_err("the interface names an image that is gone");
    assert!(gone.to_string().contains("there is no User("), "{gone}");
    drop(stage);
    drop(screen);
    log.take()
}

/// An interface with an image.
struct Stage {
    context: egui::Context,
    id: egui::TextureId,
    frames: u32,
}

impl Stage {
    fn new(screen: &mut Screen) -> Self {
        let device = Arc::clone(screen.device());
        let shape = ImageShape { width_px: 100, height_px: 80, layers: 1 };
        let image = Image::create(&device, "test", ImageFormat::Rgba8Unorm, shape).expect("it fits");
        let [r, g, b] = SHOWN;
        let pixels: Vec<u8> = [r, g, b, 255].repeat(100 * 80);
        let mut recorder = Recorder::create(&device, "test", Timing::Off).expect("the device works");
        recorder.write_image_corner(&image, [100, 80], &pixels).expect("it has that size");
        recorder.submit_and_wait().expect("the device works");
        let depth = Image::create(&device, "depth", ImageFormat::D32Float, shape).expect("it fits");
        assert!(screen.add_image(&depth).is_err(), "depth is no picture");
        let id = screen.add_image(&image).expect("it is a picture");
        Self { context: egui::Context::default(), id, frames: 0 }
    }

    fn paint(&mut self, screen: &mut Screen, size_px: [u32; 2]) -> Painted {
        self.try_paint(screen, size_px).expect("it can be painted")
    }

    fn try_paint(&mut self, screen: &mut Screen, size_px: [u32; 2]) -> smalti::Result<Painted> {
        self.frames += 1;
        let (id, frames) = (self.id, self.frames);
        let size = vec2(size_px[0].max(1) as f32, size_px[1].max(1) as f32);
        let input = egui::RawInput {
            screen_rect: Some(Rect::from_min_size(pos2(0.0, 0.0), size)),
            ..egui::RawInput::default()
        };
        let mut output = self.context.run_ui(input, |ui| {
            let painter = ui.ctx().layer_painter(egui::LayerId::background());
            let [r, g, b] = BEHIND;
            painter.rect_filled(Rect::EVERYTHING, 0.0, Color32::from_rgb(r, g, b));
            let place = Rect::from_min_size(pos2(300.0, 200.0), vec2(100.0, 80.0));
            painter.image(id, place, Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0)), Color32::WHITE);
            // Other letters in each frame change a part of the texture of the font.
            let text: String = (0..frames).filter_map(|letter| char::from_u32(65 + letter)).collect();
            let font = egui::FontId::proportional(24.0);
            painter.text(pos2(10.0, 10.0), egui::Align2::LEFT_TOP, text, font, Color32::WHITE);
        });
        let textures: TexturesDelta = std::mem::take(&mut output.textures_delta);
        let primitives = self.context.tessellate(output.shapes, output.pixels_per_point);
        let painted = screen.paint(&textures, &primitives, output.pixels_per_point);
        let mut textures = textures;
        textures.clear();
        painted
    }
}
