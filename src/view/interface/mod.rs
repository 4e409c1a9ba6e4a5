//! The interface: panels, stage and messages, as egui lays them out. It knows no device and no thread: it is given news
//! and gives orders, so that a test drives it without a display.

mod bar;
mod brush;
mod controls;
mod course;
mod files;
pub(super) mod looks;
mod masks;
mod messages;
mod saving;
mod stage;

use std::path::PathBuf;
use std::sync::Arc;

use egui::{Rect, TextureHandle, TextureId, Ui};

use self::brush::Brush;
pub(super) use self::brush::encoded as encoded_map;
pub(super) use self::files::Field;
use self::files::Fields;
use self::masks::Thumbnails;
use self::messages::Messages;
use self::saving::SaveForm;
pub(super) use self::stage::Compare;
use super::camera::Camera;
use super::news::{Ask, Doing, News, Note, Order, PictureNews};
use super::wishes::{History, Wishes};
use crate::gpu::LiveView;
use crate::model::Population;

/// The mosaic as it was drawn, for the stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Drawn {
    pub texture: TextureId,
    /// Width and height of the image in px, of which the upper left corner is used.
    pub image: [u32; 2],
}

/// What the desktop is asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Request {
    /// Choose what to open by a dialog of the desktop.
    Open,
    /// Choose where to save by such a dialog.
    Save(PathBuf),
    /// Choose the file of a field by such a dialog.
    Field(Field),
}

/// Everything that the window holds of its own.
pub(super) struct Interface {
    pub news: News,
    wishes: Wishes,
    /// What the worker knows of the wishes.
    asked: Wishes,
    history: History,
    camera: Camera,
    compare: Compare,
    /// The place of the divider, as a share of the stage.
    divider: f32,
    /// Whether a held key shows the photo.
    peek: bool,
    /// The moment of the run that is shown; none is the present.
    moment: Option<usize>,
    brush: Brush,
    open_path: String,
    /// Whether the field for a path is shown while something is open.
    wants_open_field: bool,
    /// Whether the cursor is to go into that field.
    wants_cursor: bool,
    fields: Fields,
    save: SaveForm,
    messages: Messages,
    thumbnails: Option<Thumbnails>,
    photo: Option<(Arc<PictureNews>, TextureHandle)>,
    error: Option<(Arc<Vec<u16>>, TextureHandle)>,
    /// Whether the desktop has dialogs for files.
    pub has_dialogs: bool,
    orders: Vec<Order>,
    requests: Vec<Request>,
    /// What the stage showed of the mosaic last, for whoever draws it.
    pub wanted: Option<LiveView>,
    /// Size of the picture, and the stage in physical pixels.
    on_stage: Option<([u32; 2], Rect)>,
    hovered: Option<usize>,
    /// Whether the user knows that closing the window loses something.
    is_warned: bool,
}

impl Interface {
    pub(super) fn new(wishes: Wishes) -> Self {
        Self {
            news: News::default(),
            asked: wishes.clone(),
            wishes,
            history: History::default(),
            camera: Camera::FITTED,
            compare: Compare::Mosaic,
            divider: 0.5,
            peek: false,
            moment: None,
            brush: Brush::default(),
            open_path: String::new(),
            wants_open_field: false,
            wants_cursor: false,
            fields: Fields::default(),
            save: SaveForm::default(),
            messages: Messages::default(),
            thumbnails: None,
            photo: None,
            error: None,
            has_dialogs: false,
            orders: Vec::new(),
            requests: Vec::new(),
            wanted: None,
            on_stage: None,
            hovered: None,
            is_warned: false,
        }
    }

    /// Takes the newest news; `now` is the time in seconds.
    pub(super) fn hear(&mut self, news: News, now: f64) {
        let serial = |news: &News| news.picture.as_ref().map(|picture| picture.serial);
        if serial(&self.news) != serial(&news) {
            self.camera = Camera::FITTED;
            self.moment = None;
            self.brush.forget();
            // What could not be opened before this one matters no more.
            self.messages.forget_failures();
            // What was painted belongs to the picture that it was painted on.
            self.history.drop_weights();
            (self.wishes.weight, self.asked.weight) = (None, None);
            let path = news.picture.as_ref().and_then(|picture| picture.path.clone());
            self.save.suggest(path.as_deref());
        } else if let (Some(picture), Some(map)) = (&news.picture, &self.wishes.weight)
            && map.size != picture.size
        {
            let resized = Some(Arc::new(map.resized(picture.size)));
            (self.wishes.weight, self.asked.weight) = (resized.clone(), resized);
            self.brush.forget();
        }
        // Moments are thinned out from time to time, so that their places change.
        let seen = self.moment.and_then(|place| self.news.course.get(place)).map(|moment| moment.evals);
        if let Some(evals) = seen {
            self.moment = news.course.iter().position(|moment| moment.evals >= evals);
        }
        if self.moment.is_some_and(|place| place + 1 >= news.course.len()) {
            self.moment = None;
        }
        self.messages.add(&news.notes, now);
        self.news = news;
    }

    /// Lays out everything.
    pub(super) fn show(&mut self, ui: &mut Ui, drawn: Option<Drawn>) {
        self.keys(ui);
        egui::Panel::top("bar").show(ui, |ui| self.show_bar(ui));
        egui::Panel::left("controls")
            .default_size(296.0)
            .size_range(240.0..=420.0)
            .show(ui, |ui| self.show_controls(ui));
        egui::Panel::bottom("course").exact_size(128.0).show(ui, |ui| self.show_course(ui));
        egui::CentralPanel::no_frame().show(ui, |ui| self.show_stage(ui, drawn));
        self.show_saving(ui);
        self.show_open_window(ui);
        self.messages.show(ui);
        self.send_wishes(ui);
    }

    /// The orders since the last time.
    pub(super) fn take_orders(&mut self) -> Vec<Order> {
        std::mem::take(&mut self.orders)
    }

    /// The requests since the last time.
    pub(super) fn take_requests(&mut self) -> Vec<Request> {
        std::mem::take(&mut self.requests)
    }

    /// The tiles on the stage: those of the present, or of the moment that was chosen.
    pub(super) fn tiles(&self) -> Option<&Arc<Population>> {
        let moment = self.moment.and_then(|place| self.news.course.get(place));
        moment.map(|moment| &moment.tiles).or(self.news.tiles.as_ref())
    }

    /// Whether marginal fitness and the error of each pixel are looked at.
    pub(super) fn looks_at(&self) -> (bool, bool) {
        let is_live = self.moment.is_none();
        (is_live && self.hovered.is_some(), is_live && self.compare == Compare::Error)
    }

    /// Opens a file or folder.
    pub(super) fn open(&mut self, path: PathBuf) {
        self.orders.push(Order::Open(path));
    }

    /// Takes a picture that is no file: four bytes for each pixel.
    pub(super) fn take(&mut self, size: [u32; 2], rgba: Vec<u8>) {
        self.orders.push(Order::Take { size, rgba });
    }

    /// Learns that the desktop has no dialog, so that fields for paths serve.
    pub(super) fn without_dialogs(&mut self, request: &Request) {
        self.has_dialogs = false;
        match request {
            Request::Open => self.begin_typing(),
            // Its form has a field.
            Request::Save(_) => {}
            Request::Field(field) => self.fields.open(*field),
        }
    }

    /// Takes a path that a dialog gave.
    pub(super) fn choose(&mut self, request: &Request, path: PathBuf) {
        match request {
            Request::Open => self.open(path),
            Request::Save(_) => self.save.choose(&path),
            Request::Field(field) => self.fields.choose(*field, path),
        }
    }

    /// Whether the window may be closed: at once if nothing would be lost, else when that is asked for again.
    pub(super) fn may_close(&mut self, now: f64) -> bool {
        let is_warned = self.is_warned;
        if self.news.is_unsaved && !is_warned {
            let text = "This mosaic was steered and is not saved: save it (Ctrl+S), or close the window again";
            self.messages.add(&[Note::failure(text)], now);
        }
        self.is_warned = self.news.is_unsaved;
        !self.news.is_unsaved || is_warned
    }

    /// Says something that happened outside.
    pub(super) fn say(&mut self, note: Note, now: f64) {
        self.messages.add(&[note], now);
    }

    fn is_at_work(&self) -> bool {
        self.news.doing == Doing::Running
    }

    /// Changes of the wishes by hand become an order once nothing is dragged or typed any more.
    fn send_wishes(&mut self, ui: &Ui) {
        let is_busy = ui.input(|input| input.pointer.any_down()) || ui.ctx().text_edit_focused();
        if self.wishes == self.asked || is_busy {
            return;
        }
        self.history.note(std::mem::replace(&mut self.asked, self.wishes.clone()));
        self.order_wishes();
    }

    fn order_wishes(&mut self) {
        self.moment = None;
        let serial = self.news.picture.as_ref().map_or(0, |picture| picture.serial);
        self.orders.push(Order::Ask(Box::new(Ask { wishes: self.wishes.clone(), serial })));
    }

    fn undo(&mut self) {
        self.history.undo(&mut self.wishes);
        self.follow_history();
    }

    fn redo(&mut self) {
        self.history.redo(&mut self.wishes);
        self.follow_history();
    }

    fn follow_history(&mut self) {
        if self.asked != self.wishes {
            self.asked = self.wishes.clone();
            self.brush.forget();
            self.order_wishes();
        }
    }
}

#[cfg(test)]
mod tests;
