//! Bad input at the command line: one sentence, the right exit code, and nothing left behind.

use crate::workshop::{Ran, Workshop};

/// Runs the program, which must fail with `code` and one sentence that holds `words`, and leave no file.
pub fn refused(workshop: &Workshop, line: &str, code: i32, words: &str) -> Ran {
    let before = workshop.files();
    let ran = workshop.run(line);
    assert_eq!(ran.code, Some(code), "{line}: {}", ran.stderr);
    let sentence = ran.stderr.strip_prefix("smalti: ").unwrap_or_else(|| panic!("{line}: {:?}", ran.stderr));
    assert_eq!(sentence.lines().count(), 1, "{line}: {sentence}");
    assert!(sentence.contains(words), "{line}: {words:?} is not in {sentence:?}");
    assert_eq!(workshop.files(), before, "{line} left something behind");
    ran
}

#[test]
fn inputs_that_are_no_picture_are_refused_by_name() {
    let workshop = Workshop::new();
    workshop.paint("whole.png", 64, 64);
    workshop.paint("whole.jpg", 64, 64);
    let (png, jpeg) = (workshop.read("whole.png"), workshop.read("whole.jpg"));
    workshop.write("cut.png", &png[..png.len() / 2]);
    workshop.write("cut.jpg", &jpeg[..jpeg.len() / 2]);
    workshop.write("empty.png", b"");
    workshop.write("text.png", b"This is no picture, whatever its name says.");
    workshop.write("bomb.png", &png_header(60_000, 60_000));
    workshop.write("flat.png", &png_header(0, 5));
    std::fs::create_dir(workshop.path("folder")).unwrap();
    for name in
        ["missing.png", "folder", "cut.png", "cut.jpg", "empty.png", "text.png", "bomb.png", "flat.png", "photo.png/x"]
    {
        refused(&workshop, &format!("evolve {name} -o out.png"), 2, name);
    }
}

/// The start of a PNG file that claims to have this size.
fn png_header(width_px: u32, height_px: u32) -> Vec<u8> {
    let mut header = b"IHDR".to_vec();
    header.extend(width_px.to_be_bytes());
    header.extend(height_px.to_be_bytes());
    header.extend([8, 2, 0, 0, 0]);
    let mut file = b"\x89PNG\r\n\x1a\n\0\0\0\x0d".to_vec();
    file.extend(&header);
    file.extend(crc32(&header).to_be_bytes());
    file
}

fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| if crc & 1 == 1 { crc >> 1 ^ 0xEDB8_8320 } else { crc >> 1 };
    !bytes.iter().fold(!0, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), step))
}

#[test]
fn values_out_of_range_are_refused_with_their_flag() {
    let workshop = Workshop::new();
    for (rest, words) in [
        ("-n 0", "--tiles 0"),
        ("-n 1000001", "--tiles 1000001"),
        ("-n many", "--tiles"),
        ("-n -3", "-3"),
        ("--size 0", "--size 0"),
        ("--size 65536", "--size 65536"),
        ("--output-size 0", "--output-size 0"),
        ("--births 1.5", "--births"),
        ("--batch-births 0", "--batch-births 0"),
        ("-n 60 --batch-births 61", "--batch-births 61"),
        ("--cool 0.5", "--restarts"),
        ("--cool 0 --restarts 1", "--cool 0"),
        ("--cool 0.000000001 --restarts 1", "must be 0.00001 to 1"),
        ("--cool 1.5 --restarts 1", "--cool 1.5"),
        ("--cool NaN --restarts 1", "--cool NaN"),
        ("--patience 0", "--patience 0"),
        ("--time soon", "--time"),
        ("--background reddish", "--background"),
        ("--threads 0", "--threads 0"),
        ("--scheme quick", "--scheme"),
        ("--device gpu", "--device gpu"),
        ("--validate", "--validate"),
        ("--sed 1", "--seed"),
        ("-q -v", "--verbose"),
    ] {
        refused(&workshop, &format!("evolve photo.png --scheme paper -o out.png {rest}"), 2, words);
    }
    refused(&workshop, "evolve photo.png --scheme paper", 2, "--output");
}

#[test]
fn a_device_that_is_not_there_is_no_suitable_device() {
    let workshop = Workshop::new();
    for device in
        ["name:no-such-gpu", "99", "99999999999999999999", "uuid:00000000000000000000000000000000", "pci:ffff:ff:1f.7"]
    {
        refused(&workshop, &format!("evolve photo.png --scheme paper -o out.png --device {device}"), 4, device);
    }
}

#[test]
fn an_empty_variable_asks_for_no_device() {
    let workshop = Workshop::new();
    let mut command = workshop.command("evolve photo.png --scheme paper -o out.png --dry-run");
    let output = command.env("SMALTI_DEVICE", "").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn outputs_that_cannot_be_or_make_no_sense_are_refused_before_the_work() {
    let workshop = Workshop::new();
    std::fs::create_dir(workshop.path("folder.png")).unwrap();
    let births = "--births 1000M";
    for (outputs, code, words) in [
        ("-o out.gif", 2, "out.gif"),
        ("-o out", 2, "out"),
        ("-o a.png -o ./a.png", 2, "named twice"),
        ("-o - -o -", 2, "named twice"),
        ("-o a.png --save-target a.png", 2, "named twice"),
        ("-o a.png --save-target a.jpg", 2, "a.jpg"),
        ("-o photo.png --force", 2, "is an input"),
        ("-o a.png --save-target ./photo.png --force", 2, "is an input"),
        ("-o - --json", 2, "stdout"),
        ("-o a.npz -o a.csv -o a.json --output-size 9", 2, "--output-size 9: a population has no size"),
        ("-o a.webp --output-size 16384", 2, "a.webp: a WebP has at most 16383 px a side"),
        ("-o nowhere/a.png", 1, "nowhere/a.png"),
        ("-o folder.png", 1, "folder.png"),
        ("-o new.png/", 1, "new.png/: is a folder"),
        ("-o new.npz/.", 1, "new.npz/.: is a folder"),
        ("-o a.png --save-target new.png/", 1, "new.png/: is a folder"),
    ] {
        refused(&workshop, &format!("evolve photo.png --scheme paper {outputs} {births}"), code, words);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn an_output_that_cannot_be_written_takes_no_other_with_it_and_the_row_lists_what_is_there() {
    let workshop = Workshop::new();
    std::os::unix::fs::symlink("/dev/full", workshop.path("full.png")).unwrap();
    let line = "evolve photo.png --scheme paper -n 60 --births 100 -q --json -o a.npz -o full.png -o b.png --save-target t.png";
    let ran = workshop.run(line);
    assert_eq!(ran.code, Some(1), "{}", ran.stderr);
    assert!(ran.stderr.starts_with("smalti: full.png: the disk is full"), "{}", ran.stderr);
    let row = ran.row();
    assert_eq!(row["status"], "failed");
    assert_eq!(row["output"], serde_json::json!(["a.npz", "b.png", "t.png"]));
    assert_eq!(workshop.pixels("b.png").dimensions(), (40, 30));
    assert!(workshop.path("a.npz").is_file() && workshop.path("t.png").is_file());
}

#[test]
fn populations_that_do_not_fit_are_refused() {
    let workshop = Workshop::new();
    workshop.paint("other.png", 50, 30);
    workshop.evolve("-o flies.npz");
    let npz = workshop.read("flies.npz");
    workshop.write("cut.npz", &npz[..npz.len() / 2]);
    refused(&workshop, "evolve other.png --scheme paper -o a.png --init flies.npz", 2, "40x30");
    refused(&workshop, "evolve photo.png --scheme paper -o a.png --init flies.npz --size 20", 2, "20x15");
    refused(&workshop, "evolve photo.png --scheme paper -o a.png --init flies.npz -n 60", 2, "--tiles");
    refused(&workshop, "evolve photo.png --scheme paper -o a.png --init photo.png", 2, "photo.png");
    refused(&workshop, "evolve photo.png --scheme paper -o a.png --init missing.npz", 2, "missing.npz");
    refused(&workshop, "evolve photo.png --scheme paper -o a.png --init cut.npz", 2, "cut.npz");
    std::fs::create_dir(workshop.path("folder")).unwrap();
    refused(&workshop, "evolve photo.png --scheme paper -o a.png --init folder", 2, "folder: is a folder");
}

#[test]
fn only_force_replaces_what_the_same_command_would_not_have_written() {
    let workshop = Workshop::new();
    let command = "evolve photo.png --scheme paper -n 60 --births 100";
    for ending in ["png", "jpg", "webp", "svg", "ora", "npz", "json"] {
        let name = format!("a.{ending}");
        workshop.write(&name, b"written by somebody else");
        refused(&workshop, &format!("{command} -o {name}"), 2, &format!("{name} exists and was not made by smalti"));
        assert_eq!(workshop.read(&name), b"written by somebody else");
        assert_eq!(workshop.run(&format!("{command} -o {name} --force")).code, Some(0));

        let first = workshop.read(&name);
        assert_eq!(workshop.run(&format!("{command} -o {name} --threads 1")).code, Some(0), "same key");
        assert_eq!(workshop.read(&name), first);
        refused(&workshop, &format!("{command} -o {name} --seed 1"), 2, "made with other options");
        assert_eq!(workshop.read(&name), first);
        assert_eq!(workshop.run(&format!("{command} -o {name} --seed 1 --force")).code, Some(0));
        assert_ne!(workshop.read(&name), first);
    }
}

#[test]
fn a_saved_target_is_replaced_whatever_evolved_towards_it() {
    let workshop = Workshop::new();
    workshop.evolve("-o a.png --save-target t.png");
    workshop.evolve("-o b.png --save-target t.png --seed 1");
    refused(&workshop, "evolve photo.png --scheme paper -o c.png --save-target t.png --size 20", 2, "t.png exists");
    refused(&workshop, "evolve photo.png --scheme paper -o c.png --save-target a.png", 2, "a.png exists");
}

#[cfg(target_os = "linux")]
#[test]
fn a_picture_for_a_closed_stdout_is_refused_before_the_work_and_the_null_device_may_have_it() {
    let workshop = Workshop::new();
    for (redirection, births, code, message) in
        [(">&-", "1000M", 1, "smalti: stdout: is closed"), ("> /dev/null", "100", 0, "")]
    {
        let line = format!(
            "exec {} evolve photo.png --scheme paper -q -n 60 --births {births} -o - {redirection}",
            env!("CARGO_BIN_EXE_smalti")
        );
        let mut command = std::process::Command::new("sh");
        command.args(["-c", &line]).current_dir(workshop.path("")).env("SMALTI_DEVICE", "cpu");
        let output = command.output().unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{stderr}");
        assert!(stderr.starts_with(message) && stderr.lines().count() == usize::from(code == 1), "{stderr:?}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_row_that_cannot_be_printed_is_a_failure_with_a_sentence() {
    let workshop = Workshop::new();
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    let mut command = workshop.command("evolve photo.png --scheme paper -n 60 --births 100 -q --json -o a.png");
    let output = command.stdout(full).output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(stderr.starts_with("smalti: stdout: cannot be written") && stderr.lines().count() == 1, "{stderr:?}");
}

#[test]
fn a_map_of_weights_is_refused_where_the_scheme_has_no_use_for_it() {
    let workshop = Workshop::new();
    let words = "--weight: the paper's scheme weighs all pixels alike; use --scheme cells";
    refused(&workshop, "evolve photo.png --scheme paper -o a.png --weight photo.png", 2, words);
    refused(&workshop, "evolve photo.png -o a.png --scheme paper --weight missing.png", 2, words);
}

#[test]
fn a_failure_has_a_row_of_json_too() {
    let workshop = Workshop::new();
    let ran = refused(&workshop, "evolve missing.png -o a.png --json", 2, "missing.png");
    let row = ran.row();
    assert_eq!([&row["id"], &row["status"]], ["missing", "failed"]);
    assert!(row["error"].as_str().is_some_and(|error| error.starts_with("missing.png: ")), "{row}");
    assert_eq!(row["output"].as_array().map(Vec::len), Some(0));
}
