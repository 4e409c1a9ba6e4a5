//! primg, which places one rotated rectangle after the other, at equal numbers of shapes.

use std::path::Path;
use std::process::Command;

use smalti::metrics::Difference;

use crate::report::{Report, Wanted};
use crate::{Gallery, Options, Task, common};

/// Shapes, our evals, and by how many per cent our SAE is to be lower.
const BOUTS: [(usize, u64, f64); 3] = [(2_500, 2_000_000, 23.0), (1_000, 4_000_000, 15.0), (500, 4_000_000, 10.0)];

pub fn measure(gallery: &Gallery, options: &Options, report: &mut Report) {
    let temporary = tempfile::tempdir().expect("a temporary folder");
    let folder = options.primg_outputs.as_deref().unwrap_or(temporary.path());
    for (fly_count, evals, wanted_percent) in BOUTS {
        report.section(&format!("SAE below primg's in per cent, 256 px, N={fly_count}, {} M evals", evals / 1_000_000));
        for name in common::cells::PICTURES {
            let (input, target) = &gallery.small[name];
            let output = folder.join(format!("{name}-{fly_count}.png"));
            if !output.exists() && !run(options.primg.as_deref(), (input, &output), fly_count) {
                continue;
            }
            let rival = common::cells::read(&output, 256);
            let rival = Difference::between(target.pixels(), rival.pixels()).sae() as f64;
            let own = Task { target, fly_count, candidates: 1, evals }.free_sae() as f64;
            let what = format!("{name}: primg {rival:.0}, smalti {own:.0}");
            report.row(&what, (1.0 - own / rival) * 100.0, Wanted::AtLeast(wanted_percent), 1);
        }
    }
}

/// Runs primg, which takes minutes; false if there is none to run.
fn run(primg: Option<&Path>, (input, output): (&Path, &Path), shape_count: usize) -> bool {
    let Some(primg) = primg else { return false };
    let mut command = Command::new(primg);
    command.args(["-a", "255", "-s", "256", "-t", "rotated-rectangle", "-n", &shape_count.to_string()]);
    let status = command.arg(input).arg(output).stdout(std::process::Stdio::null()).status();
    assert!(status.is_ok_and(|status| status.success()), "primg failed on {}", input.display());
    true
}
