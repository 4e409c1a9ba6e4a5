//! The scripts of a plan and the files of videos under names that a shell, a scheduler, YAML or ffmpeg could misread.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::workshop::{Ran, Workshop};

/// Names that may be in scripts. Each would make a file called `pwned` if any of it was run.
const HOSTILE: [&str; 9] = [
    "with space",
    "it's $(touch pwned) `touch pwned`",
    "{} {.} {#} {1} {%}",
    "{= system('touch pwned') =}",
    "a;touch pwned;&|<>*?[x]!#~",
    "$HOME ${HOME} $$ $(HOME) %A_%a %% 50%d",
    "+plus: - colon",
    "-dash --force",
    "caf\u{e9} \u{1f3a8} \u{202e}txt",
];

fn workshop_in(name: &str) -> (Workshop, PathBuf) {
    let workshop = Workshop::new();
    let folder = workshop.path(name);
    std::fs::create_dir(&folder).unwrap();
    for number in [1, 2] {
        std::fs::copy(workshop.path("photo.png"), folder.join(format!("p{number}.png"))).unwrap();
    }
    (workshop, folder)
}

fn smalti(folder: &Path, arguments: &[&str]) -> Ran {
    let mut command = Command::new(env!("CARGO_BIN_EXE_smalti"));
    let output = command.args(arguments).current_dir(folder).env("SMALTI_DEVICE", "cpu").stdin(Stdio::null()).output();
    let output = output.expect("the program starts");
    let stderr = String::from_utf8(output.stderr).expect("messages are UTF-8");
    Ran { code: output.status.code(), stdout: output.stdout, stderr }
}

/// A folder on the `PATH` with the program, and with stand-ins for what is not here.
fn programs(workshop: &Workshop) -> String {
    let folder = workshop.path("programs");
    std::fs::create_dir_all(&folder).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink(env!("CARGO_BIN_EXE_smalti"), folder.join("smalti")).unwrap();
    format!("{}:{}", folder.display(), std::env::var("PATH").unwrap_or_default())
}

/// What Kubernetes makes of a command: `$(NAME)` is a variable, if there is one, and two dollars are one.
fn expanded(text: &str) -> String {
    let mut made = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once('$') {
        made.push_str(before);
        rest = if let Some(after) = after.strip_prefix('$') {
            made.push('$');
            after
        } else if let Some((name, after)) = after.strip_prefix('(').and_then(|after| after.split_once(')')) {
            let is_variable = name == "JOB_COMPLETION_INDEX" || name == "HOME";
            made.push_str(&if is_variable { "EXPANDED".to_owned() } else { format!("$({name})") });
            after
        } else {
            made.push('$');
            after
        };
    }
    made + rest
}

/// The text of the block after `- |`, without its indentation.
fn block(yaml: &str) -> String {
    let lines = yaml.lines().skip_while(|line| line.trim() != "- |").skip(1);
    lines.map_while(|line| line.strip_prefix("              ")).map(|line| format!("{line}\n")).collect()
}

#[cfg(unix)]
#[test]
fn every_script_of_a_plan_does_its_work_under_hostile_names_and_nothing_else() {
    for name in HOSTILE {
        let (workshop, work) = workshop_in(name);
        let (into, out) = (format!("p{name}"), format!("./{name}"));
        let mask = format!("{name}.png");
        std::fs::copy(workshop.path("photo.png"), work.join(&mask)).unwrap();
        let arguments = ["plan", "p1.png", "p2.png", "--shards=2", "--picture-time=1s", "--evals=200", "-n20"];
        let (into_flag, out_flag) = (format!("--into={into}"), format!("--output={out}"));
        let mask_flag = format!("--weight={mask}");
        let ran = smalti(&work, &[&arguments[..], &[&into_flag, &out_flag, &mask_flag]].concat());
        assert_eq!(ran.code, Some(0), "{name}: {}", ran.stderr);
        let path = programs(&workshop);
        let (plan, outputs) = (work.join(&into), work.join(&out));
        let check = |script: &str, command: &mut Command| {
            let output = command.env("PATH", &path).env("SMALTI_DEVICE", "cpu").stdin(Stdio::null()).output().unwrap();
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            assert!(output.status.success(), "{name}: {script}: {said}");
            for number in [1, 2] {
                let made = outputs.join(format!("p{number}.png"));
                assert!(made.is_file(), "{name}: {script} made no {}: {said}", made.display());
                std::fs::remove_file(made).unwrap();
            }
            let pwned =
                [&work, &plan, &outputs, &workshop.path(".")].iter().any(|folder| folder.join("pwned").exists());
            assert!(!pwned, "{name}: {script} ran a part of a name");
        };
        check("parallel.sh", Command::new("sh").arg(plan.join("parallel.sh")).current_dir("/"));
        let log = std::fs::read_to_string(plan.join("parallel.log")).unwrap();
        assert_eq!(log.lines().count(), 3, "a heading and two shards: {log}");

        let slurm = plan.join("submit.slurm");
        let both = "for task in 1 2; do SLURM_ARRAY_TASK_ID=$task bash \"$0\" || exit; done";
        check("submit.slurm", Command::new("bash").args(["-c", both]).arg(&slurm).current_dir("/"));

        let yaml = std::fs::read_to_string(plan.join("kubernetes.yaml")).unwrap();
        assert!(!yaml.chars().any(|char| char != '\n' && char.is_control()), "{yaml:?}");
        let folder: serde_json::Value = yaml
            .lines()
            .find_map(|line| line.trim().strip_prefix("workingDir: "))
            .map(|text| serde_json::from_str(text).unwrap())
            .unwrap();
        assert_eq!(Path::new(folder.as_str().unwrap()), work.canonicalize().unwrap());
        let script = expanded(&block(&yaml));
        let both = "for JOB_COMPLETION_INDEX in 0 1; do export JOB_COMPLETION_INDEX; sh -c \"$0\" || exit; done";
        check("kubernetes.yaml", Command::new("sh").args(["-c", both, &script]).current_dir(&work));
    }
}

#[test]
fn a_name_that_no_script_can_hold_is_refused_in_one_sentence() {
    for name in ["a\nb", "a\rb", "a\u{1b}[2Jb", "a\u{85}b", "a\u{2028}b", "a\u{7f}b", "\u{feff}a"] {
        let (workshop, work) = workshop_in(name);
        let of_folder = smalti(&work, &["plan", "p1.png", "--shards=1", "--output=out", "--picture-time=1s"]);
        let into = format!("--into={name}");
        let line = ["plan", "photo.png", "--shards=1", "--output=out", "--picture-time=1s"];
        let of_plan = smalti(&workshop.path("."), &[&line[..], &[&into]].concat());
        let mask = format!("--mask={name}/p1.png");
        let of_flag = smalti(&workshop.path("."), &[&line[..], &[&mask]].concat());
        for ran in [of_folder, of_plan, of_flag] {
            assert_eq!(ran.code, Some(2), "{name:?}: {}", ran.stderr);
            assert!(ran.stderr.contains("a script can only contain"), "{name:?}: {}", ran.stderr);
        }
        assert!(!workshop.files().contains("plan") && !work.join("plan").exists(), "{name:?}");
    }
}

/// A clip of a few frames.
fn clip(workshop: &Workshop, name: &str) {
    let made = Command::new("ffmpeg")
        .args(["-v", "error", "-f", "lavfi", "-i", "testsrc=size=64x48:rate=5:duration=1", "-y"])
        .arg(workshop.path(name))
        .status();
    assert!(made.expect("the tests need ffmpeg; tools/test installs it").success());
}

#[test]
fn a_playlist_or_a_script_of_ffmpeg_opens_no_other_file() {
    let workshop = Workshop::new();
    clip(&workshop, "secret.ts");
    clip(&workshop, "secret.mp4");
    let path = workshop.path("secret.ts").display().to_string();
    let playlist = format!("#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1.0,\n{path}\n#EXT-X-ENDLIST\n");
    let script = "ffconcat version 1.0\nfile secret.mp4\n";
    for (name, text) in [
        ("list.m3u8", playlist.as_str()),
        ("list.mp4", &playlist),
        ("list.ffconcat", script),
        ("list.mkv", script),
        ("list.sdp", "v=0\no=- 0 0 IN IP4 127.0.0.1\nc=IN IP4 127.0.0.1\nm=video 5004 RTP/AVP 96\n"),
    ] {
        workshop.write(name, text.as_bytes());
        let ran = workshop.run(&format!("video {name} -o frames -n 20 --evals 100"));
        assert_eq!(ran.code, Some(2), "{name}: {}", ran.stderr);
        assert!(
            ran.stderr.starts_with(&format!("smalti: {name}: ")) && ran.stderr.lines().count() == 1,
            "{}",
            ran.stderr
        );
        let taken = workshop.path("frames/populations/input");
        assert!(!taken.exists(), "{name}: a frame of another file is read");
    }
    // The same files are opened by an ffmpeg that nobody holds back, so this test can fail.
    for name in ["list.m3u8", "list.ffconcat"] {
        let free = ["-v", "error", "-y", "-i"];
        let read = Command::new("ffmpeg").args(free).arg(workshop.path(name)).arg(workshop.path("free.mp4")).status();
        assert!(read.unwrap().success(), "{name}");
    }
    let ran = workshop.run("video secret.mp4 -o frames -n 20 --evals 100 --frames 0..1");
    assert_eq!(ran.code, Some(0), "a video itself is read: {}", ran.stderr);
}

#[test]
fn a_video_in_a_folder_with_a_percent_sign_is_taken_apart() {
    let workshop = Workshop::new();
    let name = "50%d of 100%";
    std::fs::create_dir(workshop.path(name)).unwrap();
    clip(&workshop, &format!("{name}/clip.mp4"));
    let line = ["video", "clip.mp4", "-oframes", "-n20", "--evals=100", "--frames=0..1", "--quiet"];
    let ran = smalti(&workshop.path(name), &line);
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    assert_eq!(std::fs::read_dir(workshop.path(name).join("frames/populations/input")).unwrap().count(), 6);
}
