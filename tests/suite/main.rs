//! The test suite of the engine: one binary, so that it links once.

#![allow(missing_docs, reason = "test names are sentences; only code that others call needs docs")]
#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test that it is in")]

mod exactness;
mod files;
mod reference;
mod scenarios;
