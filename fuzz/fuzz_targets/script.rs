//! libFuzzer on scripts; without it, files once more.

#![cfg_attr(fuzzing, no_main)]

#[cfg(fuzzing)]
libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    smalti_fuzz::targets::script(data);
});

#[cfg(not(fuzzing))]
fn main() -> std::process::ExitCode {
    smalti_fuzz::again(smalti_fuzz::targets::script)
}
