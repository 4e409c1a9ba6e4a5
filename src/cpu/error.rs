//! Twin of `glsl/shared/error.glsl`: the error metric.

/// Sum of absolute differences of the three channels.
#[inline(always)]
pub(super) fn error(a: u32, b: u32) -> i32 {
    let channel = |shift: u32| ((a >> shift & 255) as i32 - (b >> shift & 255) as i32).abs();
    channel(0) + channel(8) + channel(16)
}
