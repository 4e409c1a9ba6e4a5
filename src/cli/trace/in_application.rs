//! RenderDoc's in-application interface, where there is one: RenderDoc does not run on macOS.

use std::path::PathBuf;

pub(super) use self::interface::InApplication;

#[cfg(not(target_os = "macos"))]
mod interface {
    use std::ptr::null;

    use renderdoc::{RenderDoc, V110};

    use super::PathBuf;

    /// The RenderDoc that was loaded with the program.
    #[derive(Debug)]
    pub(in crate::cli::trace) struct InApplication(RenderDoc<V110>);

    impl InApplication {
        pub(in crate::cli::trace) fn find() -> Option<Self> {
            RenderDoc::new().ok().map(Self)
        }

        pub(in crate::cli::trace) fn start(&mut self) {
            self.0.start_frame_capture(null(), null());
        }

        pub(in crate::cli::trace) fn end(&mut self) {
            self.0.end_frame_capture(null(), null());
        }

        /// How many captures there are.
        pub(in crate::cli::trace) fn count(&self) -> u32 {
            self.0.get_num_captures()
        }

        /// The file of a capture, counted from 0.
        pub(in crate::cli::trace) fn file(&self, number: u32) -> Option<PathBuf> {
            self.0.get_capture(number).map(|(path, _)| path)
        }
    }
}

#[cfg(target_os = "macos")]
mod interface {
    use super::PathBuf;

    /// Nobody has one.
    #[derive(Debug)]
    pub(in crate::cli::trace) enum InApplication {}

    impl InApplication {
        pub(in crate::cli::trace) fn find() -> Option<Self> {
            None
        }

        pub(in crate::cli::trace) fn start(&mut self) {
            match *self {}
        }

        pub(in crate::cli::trace) fn end(&mut self) {
            match *self {}
        }

        pub(in crate::cli::trace) fn count(&self) -> u32 {
            match *self {}
        }

        pub(in crate::cli::trace) fn file(&self, _number: u32) -> Option<PathBuf> {
            match *self {}
        }
    }
}
