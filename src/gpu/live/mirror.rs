//! A list that the device holds a copy of: only what changed is uploaded.

use std::ops::Range;
use std::sync::Arc;

use bytemuck::Pod;

use crate::error::Result;
use crate::vk::{Buffer, BufferUse, Device, Recorder, Residence};

/// Fewest entries that room is made for.
const FIRST_ENTRIES: usize = 1024;

/// A list of entries, here and in a buffer that only grows.
pub(super) struct Mirror<T> {
    name: &'static str,
    entries: Vec<T>,
    /// Places that differ from the buffer, in rising order.
    changed: Vec<Range<usize>>,
    buffer: Arc<Buffer>,
}

impl<T: Pod> Mirror<T> {
    /// An empty list.
    pub fn create(device: &Arc<Device>, name: &'static str) -> Result<Self> {
        let buffer = create_buffer::<T>(device, name, FIRST_ENTRIES)?;
        Ok(Self { name, entries: Vec::new(), changed: Vec::new(), buffer })
    }

    /// All entries.
    pub fn entries(&self) -> &[T] {
        &self.entries
    }

    /// The buffer. [`Self::reserve`] may put another one in its place.
    pub fn buffer(&self) -> &Arc<Buffer> {
        &self.buffer
    }

    /// Sets an entry, or adds one at the end. Between two uploads, places must rise.
    pub fn put(&mut self, place: usize, entry: T) {
        match self.entries.get_mut(place) {
            Some(old) if bytemuck::bytes_of(old) == bytemuck::bytes_of(&entry) => return,
            Some(old) => *old = entry,
            None => self.entries.push(entry),
        }
        match self.changed.last_mut() {
            Some(last) if last.end == place => last.end = place + 1,
            _ => self.changed.push(place..place + 1),
        }
    }

    /// Removes the entries from `count` on.
    pub fn truncate(&mut self, count: usize) {
        self.entries.truncate(count);
    }

    /// Makes room for `count` entries; whether that took another buffer, to which everything is uploaded again.
    pub fn reserve(&mut self, device: &Arc<Device>, count: usize) -> Result<bool> {
        if (count * size_of::<T>()) as u64 <= self.buffer.size_bytes() {
            return Ok(false);
        }
        // A list as long as a device can take must not ask for twice that.
        let larger = create_buffer::<T>(device, self.name, count.next_power_of_two());
        self.buffer = larger.or_else(|_| create_buffer::<T>(device, self.name, count))?;
        self.forget();
        Ok(true)
    }

    /// Takes it that the buffer holds nothing of the list.
    pub fn forget(&mut self) {
        self.entries.clear();
        self.changed.clear();
    }

    /// Records the upload of what changed; returns its bytes.
    pub fn upload(&mut self, recorder: &mut Recorder) -> Result<u64> {
        let mut bytes = 0;
        for range in self.changed.drain(..) {
            let entries: &[u8] = bytemuck::cast_slice(&self.entries[range.start..range.end.min(self.entries.len())]);
            recorder.write_buffer(&self.buffer, (range.start * size_of::<T>()) as u64, entries)?;
            bytes += entries.len() as u64;
        }
        Ok(bytes)
    }
}

fn create_buffer<T>(device: &Arc<Device>, name: &str, count: usize) -> Result<Arc<Buffer>> {
    Buffer::create(device, name, (count * size_of::<T>()) as u64, BufferUse::Storage, Residence::Device)
}
