//! The event loop: input goes to the interface, orders to the worker, tiles to the device, and frames to the screen.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use egui_winit::accesskit_winit;
use winit::application::ApplicationHandler;
use winit::dpi::LogicalSize;
use winit::event::{StartCause, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
use winit::window::{Window, WindowId};

use super::dialogs::{self, Answer};
use super::interface::{Drawn, Interface, Request, looks};
use super::news::{Desk, News, Note, Order, Standing};
use super::remembered::Remembered;
use super::wishes::Wishes;
use super::worker::{Tools, work};
use super::{Figures, Options, rescue};
use crate::error::{Error, NoDevice, Result};
use crate::gpu::{LiveMosaic, LiveView};
use crate::guard;
use crate::model::Population;
use crate::studio::check_messages;
use crate::threads;
use crate::vk::{self, Screen, Validation};

/// Width and height in points at the first time.
const FIRST_SIZE: [f32; 2] = [1_180.0, 780.0];
/// Longest time without a look at the clock.
const REST: Duration = Duration::from_secs(60);

/// What wakes the event loop.
pub(super) enum Wake {
    News,
    Access(accesskit_winit::Event),
    Answered(Request, Answer),
}

impl From<accesskit_winit::Event> for Wake {
    fn from(event: accesskit_winit::Event) -> Self {
        Self::Access(event)
    }
}

/// Runs the window until it is closed.
pub(super) fn run(options: Options) -> Result<Figures> {
    let no_display = |reason: String| Error::NoSuitableDevice { why: NoDevice::NoDisplay { reason } };
    let events = EventLoop::<Wake>::with_user_event().build().map_err(|error| no_display(in_words(&error)))?;
    let (orders, taken) = channel();
    let proxy = events.create_proxy();
    let waker = proxy.clone();
    // The loop may be gone already; then nobody is to be woken.
    let desk = Arc::new(Desk::new(move || drop(waker.send_event(Wake::News))));
    let Options { path, device, validation, snapshots, redraw, end_process } = options;
    let at_loss = Arc::clone(&desk);
    vk::when_display_is_gone(move || end_process(&rescue::after(Error::DisplayLost, &at_loss.peek())));
    let tools = Tools { snapshots, redraw };
    let for_worker = Arc::clone(&desk);
    let worker = threads::spawn("search", move || match device() {
        Ok(device) => {
            work(&device, &tools, &taken, &for_worker);
            Ok(())
        }
        Err(error) => {
            for_worker.tell(|news| news.notes.push(Note::failure(error.to_string())));
            Err(error)
        }
    })?;
    let mut app = App::new(validation, proxy, desk, orders);
    if let Some(path) = path {
        app.interface.open(path);
    }
    let desk = Arc::clone(&app.desk);
    match guard::caught(|| events.run_app(&mut app)) {
        Ok(ended) => app.end(worker, ended.map_err(|error| no_display(in_words(&error)))),
        Err(panicked) => end_process(&rescue::after(rescue::reason(&panicked), &desk.peek())),
    }
}

fn in_words(error: &winit::error::EventLoopError) -> String {
    match error {
        winit::error::EventLoopError::Os(error) => error.to_string(),
        other => other.to_string(),
    }
}

struct App {
    validation: Validation,
    proxy: EventLoopProxy<Wake>,
    ctx: egui::Context,
    interface: Interface,
    desk: Arc<Desk>,
    orders: Sender<Order>,
    remembered: Remembered,
    shown: Option<Shown>,
    began: Instant,
    figures: Figures,
    /// Why the window ends, if not because it was closed.
    failure: Option<Error>,
}

/// A window that is there. What draws comes before the window, which outlives it.
struct Shown {
    mosaic: LiveMosaic,
    screen: Screen,
    input: egui_winit::State,
    window: Arc<Window>,
    image: Option<(egui::TextureId, Arc<vk::Image>)>,
    /// Images that no frame shows any more.
    retired: Vec<egui::TextureId>,
    /// What the image shows.
    drawn: Option<(Arc<Population>, LiveView)>,
    /// The title that was set last; the window itself need not know it.
    title: String,
    /// Whether Ctrl is held, or Command.
    is_command: bool,
    /// Frames in which the mosaic was drawn.
    drawn_frames: u64,
    /// When the next frame is due without any event.
    next: Option<Instant>,
}

impl App {
    fn new(validation: Validation, proxy: EventLoopProxy<Wake>, desk: Arc<Desk>, orders: Sender<Order>) -> Self {
        let ctx = egui::Context::default();
        looks::apply(&ctx);
        let remembered = Remembered::read();
        if let Some(theme) = remembered.theme {
            ctx.set_theme(egui::ThemePreference::from(theme));
        }
        let (began, figures) = (Instant::now(), Figures::default());
        let mut interface = Interface::new(Wishes::default());
        interface.has_dialogs = dialogs::may_be_there();
        Self { validation, proxy, ctx, interface, desk, orders, remembered, shown: None, began, figures, failure: None }
    }

    /// Opens the window.
    fn show(&mut self, events: &ActiveEventLoop) -> Result<Shown> {
        let [width, height] = on_monitor(events, self.remembered.size.unwrap_or(FIRST_SIZE));
        // AccessKit wants the window invisible until its adapter is there.
        let attributes = Window::default_attributes()
            .with_title("smalti")
            .with_visible(false)
            .with_maximized(self.remembered.is_maximized)
            .with_min_inner_size(LogicalSize::new(480.0, 360.0))
            .with_inner_size(LogicalSize::new(width, height));
        let window = events
            .create_window(attributes)
            .map_err(|error| Error::NoSuitableDevice { why: NoDevice::NoDisplay { reason: error.to_string() } })?;
        let window = Arc::new(window);
        let size = window.inner_size();
        let screen = Screen::create(Arc::clone(&window), [size.width, size.height], self.validation)?;
        let mosaic = LiveMosaic::create(screen.device())?;
        let side_px = screen.device().info().limits.image_side_px as usize;
        let (scale, theme) = (window.scale_factor() as f32, window.theme());
        let root = egui::ViewportId::ROOT;
        let mut input = egui_winit::State::new(self.ctx.clone(), root, &*window, Some(scale), theme, Some(side_px));
        input.init_accesskit(events, &window, self.proxy.clone());
        window.set_visible(true);
        Ok(Shown {
            mosaic,
            screen,
            input,
            window,
            image: None,
            retired: Vec::new(),
            drawn: None,
            title: String::new(),
            is_command: false,
            drawn_frames: 0,
            next: None,
        })
    }

    /// Lays out and draws a frame.
    fn draw(&mut self, events: &ActiveEventLoop) -> Result<()> {
        let Self { ctx, interface, desk, orders, shown: Some(shown), .. } = self else { return Ok(()) };
        shown.next = None;
        for old in shown.retired.drain(..) {
            shown.screen.remove_image(old);
        }
        let raw = shown.input.take_egui_input(&shown.window);
        interface.hear(desk.fetch(), raw.time.unwrap_or_default());
        let image = shown.image.as_ref().map(|(texture, image)| {
            let shape = image.shape();
            Drawn { texture: *texture, image: [shape.width_px, shape.height_px] }
        });
        let mut output = ctx.run_ui(raw, |ui| interface.show(ui, image));
        let sent = interface.take_orders().into_iter().try_for_each(|order| orders.send(order));
        if sent.is_err() {
            output.textures_delta.clear();
            return Err(Error::Internal("the thread of the search is gone".to_owned()));
        }
        let (marginal, error_map) = interface.looks_at();
        desk.want(marginal, error_map);
        let platform = std::mem::take(&mut output.platform_output);
        shown.input.handle_platform_output_with_event_loop(&shown.window, events, platform);
        let primitives = ctx.tessellate(std::mem::take(&mut output.shapes), output.pixels_per_point);
        let is_new = shown.draw_mosaic(interface);
        let painted = is_new.and_then(|is_new| {
            shown.screen.paint(&output.textures_delta, &primitives, output.pixels_per_point).map(|_| is_new)
        });
        // They are dealt with, or the window ends; egui does not let them be forgotten.
        output.textures_delta.clear();
        let is_new = painted?;
        self.figures.count(self.began, shown.drawn_frames);
        let delay = output.viewport_output.get(&egui::ViewportId::ROOT).map_or(REST, |viewport| viewport.repaint_delay);
        if delay.is_zero() || is_new {
            shown.window.request_redraw();
        } else {
            // The delay may be longer than the clock counts.
            shown.next = Instant::now().checked_add(delay.min(REST));
        }
        self.show_title();
        Ok(())
    }

    fn show_title(&mut self) {
        if let Some(shown) = &mut self.shown {
            let name = self.interface.news.picture.as_ref().map(|picture| picture.name.as_str());
            let title = name.map_or_else(|| "smalti".to_owned(), |name| format!("{name} - smalti"));
            if shown.title != title {
                shown.window.set_title(&title);
                shown.title = title;
            }
        }
    }

    /// Does what the interface asked of the desktop.
    fn follow_requests(&mut self) {
        for request in self.interface.take_requests() {
            let proxy = self.proxy.clone();
            let tell = move |request, answer| drop(proxy.send_event(Wake::Answered(request, answer)));
            if dialogs::show(request.clone(), self.remembered.folder.as_deref(), tell).is_err() {
                self.take_answer(&request, Answer::Missing);
            }
        }
    }

    fn take_answer(&mut self, request: &Request, answer: Answer) {
        match answer {
            Answer::Cancelled => {}
            Answer::Missing => self.interface.without_dialogs(request),
            Answer::Chosen(path) => {
                self.remember_folder(&path);
                self.interface.choose(request, path);
            }
        }
    }

    fn remember_folder(&mut self, path: &Path) {
        self.remembered.folder = path.parent().map(Path::to_owned);
    }

    /// Takes the picture that lies in the clipboard, if one does.
    fn paste(&mut self) {
        let pasted = arboard::Clipboard::new().and_then(|mut clipboard| clipboard.get_image());
        if let Ok(image) = pasted {
            let size = [image.width, image.height].map(|side| u32::try_from(side).unwrap_or(u32::MAX));
            self.interface.take(size, image.bytes.into_owned());
        } else {
            let now = self.ctx.input(|input| input.time);
            self.interface.say(Note::hint("There is no picture in the clipboard"), now);
        }
    }

    fn fail(&mut self, events: &ActiveEventLoop, error: Error) {
        self.failure.get_or_insert(error);
        events.exit();
    }

    fn remember(&mut self) {
        let Some(shown) = &self.shown else { return };
        self.remembered.is_maximized = shown.window.is_maximized();
        if !self.remembered.is_maximized {
            let size = shown.window.inner_size().to_logical::<f32>(shown.window.scale_factor());
            self.remembered.size = Some([size.width, size.height]);
        }
        self.remembered.theme = Some(self.ctx.options(|options| options.theme_preference).into());
        self.remembered.write();
    }

    /// Ends the worker. Where the window ended by a failure, the tiles are saved.
    fn end(self, worker: JoinHandle<Result<()>>, ended: Result<()>) -> Result<Figures> {
        let Self { desk, orders, failure, shown, figures, .. } = self;
        let log = shown.as_ref().map(|shown| Arc::clone(shown.screen.validation_log()));
        drop(shown);
        // If it is gone already, it needs no order.
        let _ = orders.send(Order::Quit);
        drop(orders);
        let searched = worker.join().unwrap_or_else(|_| Err(Error::Internal("the search ended too early".to_owned())));
        // What the search could not do is the reason where both failed.
        let ended = searched.and(failure.map_or(ended, Err));
        let news: News = desk.fetch();
        let Err(error) = ended else {
            log.as_deref().map_or(Ok(()), check_messages)?;
            let Standing { evals, evals_per_s, .. } = news.standing;
            return Ok(Figures { evals, evals_per_s, ..figures });
        };
        Err(rescue::after(error, &news))
    }
}

/// A size in points that fits the monitor.
fn on_monitor(events: &ActiveEventLoop, size: [f32; 2]) -> [f32; 2] {
    let monitor = events.primary_monitor().or_else(|| events.available_monitors().next());
    let Some(monitor) = monitor else { return size };
    let room = monitor.size().to_logical::<f32>(monitor.scale_factor());
    // Some of it is taken by bars and by the frame of the window.
    let fitted = |side: f32, room: f32| if room > 0.0 { side.min(room * 0.95 - 40.0) } else { side };
    [fitted(size[0], room.width), fitted(size[1], room.height)]
}

impl Figures {
    fn count(&mut self, began: Instant, frames: u64) {
        self.frames = frames;
        if frames > 0 {
            self.first_tiles.get_or_insert_with(|| began.elapsed());
        }
    }
}

impl Shown {
    /// Draws the tiles where they changed or are seen from elsewhere; whether the interface must learn of a new image.
    fn draw_mosaic(&mut self, interface: &Interface) -> Result<bool> {
        let (Some(tiles), Some(wanted)) = (interface.tiles(), interface.wanted) else { return Ok(false) };
        let is_drawn = |(drawn, view): &(Arc<Population>, LiveView)| Arc::ptr_eq(drawn, tiles) && *view == wanted;
        if self.drawn.as_ref().is_some_and(is_drawn) {
            return Ok(false);
        }
        let image = self.mosaic.draw(tiles, &wanted)?;
        self.drawn = Some((Arc::clone(tiles), wanted));
        self.drawn_frames += 1;
        if self.image.as_ref().is_some_and(|(_, known)| Arc::ptr_eq(known, &image)) {
            return Ok(false);
        }
        // The frame that is laid out already shows the old one.
        self.retired.extend(self.image.take().map(|(old, _)| old));
        self.image = Some((self.screen.add_image(&image)?, image));
        Ok(true)
    }
}

impl ApplicationHandler<Wake> for App {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.shown.is_none() {
            match self.show(events) {
                Ok(shown) => {
                    shown.window.request_redraw();
                    self.shown = Some(shown);
                }
                Err(error) => self.fail(events, error),
            }
        }
    }

    fn new_events(&mut self, events: &ActiveEventLoop, cause: StartCause) {
        if matches!(cause, StartCause::ResumeTimeReached { .. })
            && let Some(shown) = &self.shown
        {
            shown.window.request_redraw();
        }
        events.set_control_flow(ControlFlow::Wait);
    }

    fn user_event(&mut self, _: &ActiveEventLoop, wake: Wake) {
        match wake {
            Wake::News => {}
            Wake::Answered(request, answer) => self.take_answer(&request, answer),
            Wake::Access(event) => {
                let Some(shown) = &mut self.shown else { return };
                match event.window_event {
                    accesskit_winit::WindowEvent::InitialTreeRequested => self.ctx.enable_accesskit(),
                    accesskit_winit::WindowEvent::ActionRequested(action) => {
                        shown.input.on_accesskit_action_request(action);
                    }
                    accesskit_winit::WindowEvent::AccessibilityDeactivated => self.ctx.disable_accesskit(),
                }
            }
        }
        if let Some(shown) = &self.shown {
            shown.window.request_redraw();
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(shown) = &mut self.shown else { return };
        let response = shown.input.on_window_event(&shown.window, &event);
        match event {
            WindowEvent::CloseRequested => {
                let now = self.ctx.input(|input| input.time);
                if self.interface.may_close(now) {
                    self.remember();
                    events.exit();
                } else {
                    shown.window.request_redraw();
                }
            }
            WindowEvent::Resized(size) => {
                shown.screen.resize([size.width, size.height]);
                shown.window.request_redraw();
            }
            WindowEvent::RedrawRequested => {
                if let Err(error) = self.draw(events) {
                    self.fail(events, error);
                }
                self.follow_requests();
            }
            WindowEvent::ModifiersChanged(modifiers) => {
                let keys = modifiers.state();
                shown.is_command = if cfg!(target_os = "macos") { keys.super_key() } else { keys.control_key() };
            }
            WindowEvent::KeyboardInput { event, .. } => {
                let is_v = event.logical_key.to_text().is_some_and(|text| text.eq_ignore_ascii_case("v"));
                let is_paste = event.state.is_pressed() && !event.repeat && is_v;
                let is_command = shown.is_command;
                let is_typing = self.ctx.text_edit_focused();
                if response.repaint {
                    shown.window.request_redraw();
                }
                if is_paste && is_command && !is_typing {
                    self.paste();
                }
            }
            WindowEvent::DroppedFile(ref path) => {
                let path: PathBuf = path.clone();
                self.remember_folder(&path);
                self.interface.open(path);
                if let Some(shown) = &self.shown {
                    shown.window.request_redraw();
                }
            }
            _ if response.repaint => shown.window.request_redraw(),
            _ => {}
        }
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        let next = self.shown.as_ref().and_then(|shown| shown.next);
        events.set_control_flow(next.map_or(ControlFlow::Wait, ControlFlow::WaitUntil));
    }
}
