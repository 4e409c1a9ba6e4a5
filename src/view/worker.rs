//! The thread of the search. It owns the session, does what it is ordered to between two rounds, and tells the news.
//! It never waits for the window.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError};
use std::time::{Duration, Instant};

use super::course::Course;
use super::looking::{Looking, Wanted};
use super::news::{Ask, Desk, Doing, Moment, Note, Order, PictureNews, SaveOrder, Standing};
use super::opened::{Open, Origin, pasted};
use super::opening::{self, Found, Snapshots};
use super::rescue;
use super::saving::{self, Redraw};
use super::wishes::Wishes;
use crate::error::{Error, Result};
use crate::evolve::cells::EVALS_PER_FLY;
use crate::studio::{Device, Picture, Script, Session, Step, WrittenRecipe};

/// Time between two pieces of news about the tiles: ten frames a second at most. What they cost a search on the same
/// processors, benches/results/2026-11-window.md tells.
const BETWEEN_NEWS: Duration = Duration::from_millis(98);
/// How often a search that rests looks whether the window wants to know more.
const BETWEEN_LOOKS: Duration = Duration::from_millis(80);

/// What the worker is given for what only the command line can do.
pub(super) struct Tools {
    pub snapshots: Snapshots,
    pub redraw: Redraw,
}

/// Does what it is ordered to until the window is gone.
pub(super) fn work(device: &Device, tools: &Tools, orders: &Receiver<Order>, desk: &Arc<Desk>) {
    let mut worker = Worker::new(device, tools, desk);
    desk.tell(|news| news.device = device.label().to_owned());
    loop {
        let order = if worker.is_running {
            match orders.try_recv() {
                Ok(order) => Some(order),
                Err(TryRecvError::Empty) => None,
                Err(TryRecvError::Disconnected) => return,
            }
        } else {
            match orders.recv_timeout(BETWEEN_LOOKS) {
                Ok(order) => Some(order),
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => return,
            }
        };
        let done = match order {
            Some(order) => {
                let batch = latest(order, orders);
                let quits = batch.iter().any(|order| matches!(order, Order::Quit));
                worker.follow(batch);
                if quits {
                    return;
                }
                Ok(())
            }
            None => worker.go_on(),
        };
        if let Err(error) = done {
            worker.fail(&error);
        }
    }
}

/// The order, or where it is a wish that newer wishes follow, the newest of them.
fn latest(mut order: Order, orders: &Receiver<Order>) -> Vec<Order> {
    let mut all = Vec::new();
    while matches!(order, Order::Ask(_)) {
        let Ok(next) = orders.try_recv() else { break };
        if !matches!(next, Order::Ask(_)) {
            all.push(order);
        }
        order = next;
    }
    all.push(order);
    all
}

struct Worker<'d> {
    device: &'d Device,
    tools: &'d Tools,
    desk: &'d Arc<Desk>,
    open: Option<Open>,
    wishes: Wishes,
    session: Option<Session<'d>>,
    script: Script,
    /// The file of the tiles that are shown without a search.
    shown: Option<PathBuf>,
    /// Evals of this many tiles, unless another number is asked for.
    usual_evals: u64,
    course: Course,
    is_running: bool,
    told: Instant,
    /// What was told last of: evals, what was looked at, and what was going on.
    told_of: Option<(u64, Wanted, Doing)>,
    looking: Looking,
    clock: (Instant, u64),
    /// How many pictures were opened.
    serial: u64,
    /// Whether the tiles were saved since the device was lost.
    is_rescued: bool,
}

impl<'d> Worker<'d> {
    fn new(device: &'d Device, tools: &'d Tools, desk: &'d Arc<Desk>) -> Self {
        Self {
            device,
            tools,
            desk,
            open: None,
            wishes: Wishes::default(),
            session: None,
            script: Script::default(),
            shown: None,
            usual_evals: 0,
            course: Course::default(),
            is_running: false,
            told: Instant::now(),
            told_of: None,
            looking: Looking::default(),
            clock: (Instant::now(), 0),
            serial: 0,
            is_rescued: false,
        }
    }

    /// Follows orders; where one fails, that is told, and the next one is followed all the same.
    fn follow(&mut self, orders: Vec<Order>) {
        for order in orders {
            if let Err(error) = self.follow_one(order) {
                self.fail(&error);
            }
        }
    }

    fn follow_one(&mut self, order: Order) -> Result<()> {
        match order {
            Order::Open(path) => {
                self.say_opening();
                match opening::find(&path, self.tools.snapshots)? {
                    Found::Picture(picture) => self.take(picture, Origin::file(path)),
                    Found::Tiles { moments, file } => {
                        self.show(&path, moments, file);
                        Ok(())
                    }
                }
            }
            Order::Take { size, rgba } => {
                self.say_opening();
                let (picture, origin) = pasted(size, &rgba)?;
                self.take(picture, origin)
            }
            Order::Ask(ask) => {
                let Ask { mut wishes, serial } = *ask;
                if self.serial != serial {
                    // It was painted on another picture.
                    wishes.weight = None;
                }
                self.ask(wishes)
            }
            Order::Go => self.run(true),
            Order::Pause => self.run(false),
            Order::Step => {
                self.is_running = false;
                self.advance()?;
                self.tell(Instant::now())
            }
            Order::Restart => {
                if self.open.is_some() {
                    self.begin()?;
                }
                Ok(())
            }
            Order::Save(save) => {
                self.desk.tell(|news| news.is_saving = true);
                let saved = self.save(&save);
                self.desk.tell(|news| news.is_saving = false);
                let text = saved?;
                self.desk.tell(|news| news.notes.push(Note::done(text)));
                Ok(())
            }
            Order::Quit => Ok(()),
        }
    }

    fn say_opening(&self) {
        self.desk.tell(|news| news.doing = Doing::Opening);
    }

    /// Takes a picture and begins to evolve it. What was open stays if that fails.
    fn take(&mut self, picture: Picture, origin: Origin) -> Result<()> {
        let wishes = Wishes { weight: None, ..self.wishes.clone() };
        let session = self.session_of(&wishes, &picture)?;
        let warnings: Vec<Note> = picture.warnings().iter().map(Note::hint).collect();
        self.serial += 1;
        let open = Open::new(picture, origin, self.serial, &session.0);
        let news = Arc::clone(&open.news);
        (self.open, self.shown, self.wishes) = (Some(open), None, wishes);
        self.desk.tell(|told| {
            told.picture = Some(news);
            told.tiles = None;
            told.notes.extend(warnings);
        });
        self.put_on(session);
        self.run(true)
    }

    /// Shows saved tiles, which no search works on.
    fn show(&mut self, path: &Path, moments: Vec<Moment>, file: PathBuf) {
        (self.open, self.session, self.shown, self.is_running) = (None, None, Some(file), false);
        self.course = Course::of(moments);
        let Some(last) = self.course.moments().last().cloned() else { return };
        let size = [last.tiles.width_px, last.tiles.height_px];
        self.serial += 1;
        let (name, path) = (super::name_of(path), Some(path.to_owned()));
        let picture = PictureNews { serial: self.serial, name, path, size, rgba: Vec::new() };
        let moments = Arc::clone(self.course.moments());
        self.desk.tell(|news| {
            news.standing.evals = last.evals;
            news.standing.tile_count = last.tiles.flies.iter().filter(|fly| fly.alive).count();
            news.standing.error = last.error;
            news.picture = Some(Arc::new(picture));
            news.tiles = Some(last.tiles);
            (news.marginal, news.error_map) = (None, None);
            news.course = moments;
            news.doing = Doing::Showing;
            (news.command, news.is_unsaved) = (String::new(), false);
        });
    }

    /// A session by these wishes, and what was written of them.
    fn session_of(&self, wishes: &Wishes, picture: &Picture) -> Result<(Session<'d>, WrittenRecipe)> {
        let written = wishes.written(picture.size_px())?;
        Ok((Session::begin(&written.recipe()?, picture, self.device)?, written))
    }

    /// Begins anew with the present wishes.
    fn begin(&mut self) -> Result<()> {
        let Some(open) = &self.open else { return Ok(()) };
        let session = self.session_of(&self.wishes, &open.picture)?;
        self.put_on(session);
        self.run(true)
    }

    fn put_on(&mut self, (session, written): (Session<'d>, WrittenRecipe)) {
        let input_sha256 = self.open.as_ref().map(|open| open.picture.sha256().to_owned()).unwrap_or_default();
        self.script = Script { input_sha256, steps: vec![Step { evals: 0, recipe: written }], until: None };
        self.usual_evals = EVALS_PER_FLY * session.fly_count() as u64;
        self.session = Some(session);
        self.course = Course::default();
        self.clock = (Instant::now(), 0);
        self.told_of = None;
        self.looking.forget();
        self.renew_picture();
        self.desk.tell(|news| news.is_unsaved = false);
    }

    /// Tells the picture anew where it is evolved at another size or in other colours.
    fn renew_picture(&mut self) {
        if let (Some(open), Some(session)) = (&mut self.open, &self.session)
            && let Some(news) = open.follow(session)
        {
            self.desk.tell(|told| told.picture = Some(news));
        }
    }

    /// Goes on by other wishes, or begins anew where they need that.
    fn ask(&mut self, wishes: Wishes) -> Result<()> {
        let Some(open) = &self.open else {
            self.wishes = wishes;
            if self.shown.is_some() {
                let hint = "These are saved tiles; open a picture, and it is made with these settings";
                self.desk.tell(|news| news.notes.push(Note::hint(hint)));
            }
            return Ok(());
        };
        let Some(session) = &mut self.session else {
            self.wishes = wishes;
            return self.begin();
        };
        let mut written = wishes.written(open.picture.size_px())?;
        if session.evals() > 0 {
            let keeps_effort = wishes.evals_per_tile == self.wishes.evals_per_tile;
            written.evals = budget(session, self.usual_evals, written.evals, keeps_effort);
            if session.change(&written.recipe()?).is_ok() {
                self.script.steps.push(Step { evals: session.evals(), recipe: written });
                self.wishes = wishes;
                self.told_of = None;
                self.renew_picture();
                self.desk.tell(|news| news.is_unsaved = true);
                return self.run(true);
            }
        }
        let was_at_work = session.evals() > 0;
        let before = std::mem::replace(&mut self.wishes, wishes);
        if let Err(error) = self.begin() {
            self.wishes = before;
            return Err(error);
        }
        if was_at_work {
            // Another number of tiles, another size, or tiles that show through: that needs a new beginning.
            let hint = "The picture begins again, as this change needs";
            self.desk.tell(|news| news.notes.push(Note::hint(hint)));
        }
        Ok(())
    }

    fn run(&mut self, is_running: bool) -> Result<()> {
        self.is_running = is_running && self.session.as_ref().is_some_and(|session| session.stop_reason().is_none());
        if let Some(session) = &mut self.session {
            self.clock = (Instant::now(), session.evals());
        }
        self.tell(Instant::now())
    }

    /// What there is to do without an order.
    fn go_on(&mut self) -> Result<()> {
        if self.is_running {
            self.advance()?;
        }
        let now = Instant::now();
        let is_due = now.duration_since(self.told) >= BETWEEN_NEWS;
        if self.session.is_some() && (is_due || !self.is_running) { self.tell(now) } else { Ok(()) }
    }

    /// One round.
    fn advance(&mut self) -> Result<()> {
        let Some(session) = &mut self.session else { return Ok(()) };
        if session.step()?.is_some() {
            self.is_running = false;
        }
        Ok(())
    }

    /// Tells how far the search is, unless that is known.
    fn tell(&mut self, now: Instant) -> Result<()> {
        let Some(session) = &mut self.session else { return Ok(()) };
        let evals = session.evals();
        let wanted = Wanted {
            marginal: self.desk.wants_marginal.load(Ordering::Relaxed),
            error_map: self.desk.wants_error_map.load(Ordering::Relaxed),
        };
        let doing = match session.stop_reason() {
            Some(reason) => Doing::Done(reason),
            None if self.is_running => Doing::Running,
            None => Doing::Paused,
        };
        self.told = now;
        let known = Some((evals, wanted, doing));
        if self.told_of == known {
            // A window that nothing happens in is not woken.
            return Ok(());
        }
        // Before anything can fail, so that a failure is told once.
        self.told_of = known;
        let tiles = Arc::new(session.population()?);
        let pixel_count = u64::from(tiles.width_px) * u64::from(tiles.height_px);
        let error = session.sae()? as f64 / (pixel_count * 3) as f64;
        let looked = self.looking.look(session, &tiles, wanted, self.is_running)?;
        let (since, before) = self.clock;
        let seconds = now.duration_since(since).as_secs_f64();
        self.course.add(evals, error, &tiles);
        let standing = Standing {
            evals,
            evals_planned: session.evals_planned(),
            tile_count: tiles.flies.iter().filter(|fly| fly.alive).count(),
            error,
            evals_per_s: if seconds > 0.2 { (evals - before) as f64 / seconds } else { 0.0 },
        };
        let is_at_end = session.stop_reason().is_some();
        let input = self.open.as_ref().and_then(Open::path);
        let command = saving::command(&self.script, is_at_end, input, None);
        let course = Arc::clone(self.course.moments());
        self.desk.tell(|news| {
            (news.tiles, news.marginal, news.error_map) = (Some(tiles), looked.marginal, looked.error_map);
            (news.standing, news.doing, news.course, news.command) = (standing, doing, course, command);
        });
        Ok(())
    }

    /// Writes a file; a sentence about it.
    fn save(&mut self, save: &SaveOrder) -> Result<String> {
        let Some(session) = &mut self.session else {
            // Tiles that were opened and not evolved are drawn again, as they lie in their file.
            let shown = self.shown.as_deref().ok_or_else(|| Error::Internal("there is nothing to save".to_owned()))?;
            (self.tools.redraw)(shown, &save.path, save.long_side_px)?;
            return Ok(format!("Wrote {}", save.path.display()));
        };
        let Some(open) = &self.open else { return Err(Error::Internal("no picture is open".to_owned())) };
        let said = saving::save(session, &self.script, open, self.device, save)?;
        self.desk.tell(|news| news.is_unsaved = false);
        Ok(said)
    }

    /// Says what failed. The tiles that there are stay on the screen.
    fn fail(&mut self, error: &Error) {
        let is_lost = matches!(error, Error::DeviceLost { .. });
        let doing = match &mut self.session {
            None if self.course.moments().is_empty() => Doing::Nothing,
            None => Doing::Showing,
            Some(session) => session.stop_reason().map_or(Doing::Paused, Doing::Done),
        };
        self.is_running = self.is_running && !is_lost && self.session.is_some();
        let doing = if self.is_running { Doing::Running } else { doing };
        let mut text = error.to_string();
        if is_lost && !std::mem::replace(&mut self.is_rescued, true) {
            // Nothing more comes from this device, and what was shown last is still here.
            if let Ok(Some(path)) = rescue::rescue(&self.desk.peek()) {
                text += &format!("; the tiles were saved as {}", path.display());
            }
        }
        self.desk.tell(|news| {
            news.doing = doing;
            news.notes.push(Note::failure(text));
        });
    }
}

/// The evals to ask for where a session goes on; none is `usual`. What was granted before stays granted unless another
/// `effort` is asked for, and what is changed at the end gets some time to show.
fn budget(session: &mut Session<'_>, usual: u64, effort: Option<u64>, keeps_effort: bool) -> Option<u64> {
    let (spent, planned) = (session.evals(), session.evals_planned());
    let mut evals = effort.unwrap_or(usual);
    if keeps_effort {
        evals = evals.max(planned);
    }
    if session.stop_reason().is_some() {
        evals = evals.max(spent + (usual / 4).max(1));
    }
    Some(evals).filter(|&evals| effort.is_some() || evals != usual)
}
