//! Many pictures on one device: side by side on the cores of the CPU, as lanes of a Vulkan device.

use std::collections::HashMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::time::Duration;

use super::device::Device;
use super::job::Job;
use super::make::{PICTURE, made};
use super::making::finish_on;
use super::mosaic::Mosaic;
use super::picture::Picture;
use super::progress::Caller;
use super::recipe::Recipe;
use super::settings::Settings;
use crate::engine::Crew;
use crate::error::{Error, Result};
use crate::threads;
use crate::vk::DeviceKind;

/// Most pictures that evolve at the same time on a GPU, and on software Vulkan.
const LANES: (usize, usize) = (256, 16);
/// Time after which a thread that waits for mosaics asks whether they are still wanted.
const BETWEEN_QUESTIONS: Duration = Duration::from_millis(50);

/// Makes many mosaics. `done` is called with the number of a picture, from 0, and what became of it, as pictures end:
/// in any order. When it returns false, all work ends, too. Each mosaic has the bytes that [`Recipe::make`] gives it,
/// whatever else is made beside it. A picture that fails does not stop the others.
///
/// `goes_on` is asked between two steps of the work, some twenty times a second; when it returns false, all work ends.
///
/// `tasks` gives pictures as they are needed: one for each thread of the CPU, up to 256 that share a device. So a
/// folder of any size can be made; `tasks` must not wait for `done`. An error in the place of a picture is handed to
/// `done`.
///
/// # Errors
/// If the device fails, which ends all.
pub fn make_all(
    device: &Device,
    tasks: impl Iterator<Item = Result<(Picture, Recipe)>> + Send,
    mut goes_on: impl FnMut() -> bool,
    mut done: impl FnMut(usize, Result<Mosaic>) -> bool,
) -> Result<()> {
    match device.open_crew() {
        Ok(Some(crew)) => as_lanes(device, crew, tasks, &mut goes_on, &mut done),
        Ok(None) => side_by_side(device, tasks, &mut goes_on, &mut done),
        // As for one picture, the CPU stands in for a device that nobody asked for.
        Err(_) if !device.is_asked_for() => side_by_side(&Device::cpu(), tasks, &mut goes_on, &mut done),
        Err(error) => Err(error),
    }
}

/// What there is to do about a picture, and by which settings.
struct Work {
    settings: Settings,
    job: Job,
}

impl Work {
    fn new(task: Result<(Picture, Recipe)>) -> Result<Self> {
        let (picture, recipe) = task?;
        let (settings, job) = recipe.job(&picture)?;
        Ok(Self { settings, job })
    }
}

/// Ends the work of all threads when it is dropped, be it by a panic.
struct EndsAll<'a>(&'a AtomicBool);

impl Drop for EndsAll<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// A picture for each thread of the current pool, each with a pool of one thread: waiting for a share of work, a thread
/// of a common pool might begin another whole picture.
fn side_by_side(
    device: &Device,
    tasks: impl Iterator<Item = Result<(Picture, Recipe)>> + Send,
    is_wanted: &mut dyn FnMut() -> bool,
    done: &mut dyn FnMut(usize, Result<Mosaic>) -> bool,
) -> Result<()> {
    let tasks = Mutex::new(tasks.fuse().enumerate());
    let has_ended = AtomicBool::new(false);
    threads::start(None)?;
    let pools = threads::pools(rayon::current_num_threads(), 1);
    let goes_on = || !has_ended.load(Ordering::Relaxed);
    // Where `tasks` panicked in another thread, it has nothing more to give.
    let next = || if goes_on() { tasks.lock().ok().and_then(|mut tasks| tasks.next()) } else { None };
    let make = |task: Result<(Picture, Recipe)>, goes_on: &mut dyn FnMut() -> bool| {
        task.and_then(|(picture, recipe)| recipe.make(&picture, device, |_| goes_on()))
    };
    std::thread::scope(|scope| {
        let (made_in, made) = sync_channel(0);
        let start = |pool| {
            let made_in = made_in.clone();
            let work = move || {
                while let Some((number, task)) = next() {
                    let mosaic = rayon::ThreadPool::install(pool, || make(task, &mut { goes_on }));
                    if made_in.send((number, mosaic)).is_err() {
                        return;
                    }
                }
            };
            threads::spawn_in(scope, work).ok()
        };
        if pools.iter().map_while(start).count() == 0 {
            while let Some((number, task)) = next() {
                if !done(number, make(task, is_wanted)) || !is_wanted() {
                    return;
                }
            }
        }
        drop(made_in);
        let _ends_all = EndsAll(&has_ended);
        loop {
            let goes_on = match made.recv_timeout(BETWEEN_QUESTIONS) {
                Ok((number, mosaic)) => done(number, mosaic) && is_wanted(),
                Err(RecvTimeoutError::Timeout) => is_wanted(),
                Err(RecvTimeoutError::Disconnected) => false,
            };
            if !goes_on {
                return;
            }
        }
    });
    Ok(())
}

/// Lanes of a device, which are refilled as they end.
fn as_lanes(
    device: &Device,
    mut crew: Crew,
    tasks: impl Iterator<Item = Result<(Picture, Recipe)>>,
    goes_on: &mut dyn FnMut() -> bool,
    done: &mut dyn FnMut(usize, Result<Mosaic>) -> bool,
) -> Result<()> {
    let is_software = device.vulkan().is_some_and(|device| device.info().kind == DeviceKind::Cpu);
    let lanes_max = if is_software { LANES.1 } else { LANES.0 };
    let mut tasks = tasks.fuse().enumerate();
    let mut aboard: HashMap<u64, Work> = HashMap::new();
    let mut held = None;
    loop {
        while aboard.len() < lanes_max {
            if !goes_on() {
                return Ok(());
            }
            let next = held.take().or_else(|| tasks.next().map(|(number, task)| (number, Work::new(task))));
            let Some((number, work)) = next else { break };
            let refused = match work {
                Err(error) => error,
                Ok(work) => match crew.admit(number as u64, work.job.task()) {
                    Ok(true) => {
                        aboard.insert(number as u64, work);
                        continue;
                    }
                    Err(error @ Error::DeviceLost { .. }) => return Err(error),
                    // There is room once others have ended.
                    Ok(false) | Err(Error::OutOfDeviceMemory { .. }) if !aboard.is_empty() => {
                        held = Some((number, Ok(work)));
                        break;
                    }
                    Ok(false) => Error::Internal("a device without a picture has no room for one".to_owned()),
                    // As for one picture, the CPU stands in for a device that nobody asked for.
                    Err(_) if !device.is_asked_for() => {
                        let mut watched = Caller::new(&work.job, |_| goes_on());
                        if !done(number, made(&work.settings, &work.job, &Device::cpu(), &mut watched)) {
                            return Ok(());
                        }
                        continue;
                    }
                    Err(error) => error,
                },
            };
            if !done(number, Err(refused)) {
                return Ok(());
            }
        }
        if aboard.is_empty() {
            return Ok(());
        }
        if !goes_on() {
            return Ok(());
        }
        for finished in crew.step()? {
            let Some(Work { settings, job }) = aboard.remove(&finished.ticket) else { continue };
            let ended = finished.outcome.and_then(|ended| finish_on(device, &job, ended, None, PICTURE));
            if !done(finished.ticket as usize, ended.map(|finished| Mosaic::new(&settings, &job, finished))) {
                return Ok(());
            }
        }
    }
}
