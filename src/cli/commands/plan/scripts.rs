//! The texts of the scripts that run a plan: for Slurm, Kubernetes and GNU parallel.
//!
//! All of them run the same command once for each shard manifest, and treat its exit codes alike. After 75 the shard
//! runs again. After 3 it does not, since a picture that cannot be read will not be readable next time.

use std::fmt::Write;

use crate::cli::terminal::words;
use crate::studio::quoted;

/// Least digits of the numbers in the names of shards.
const DIGITS_MIN: usize = 4;
/// Most pods at a time in a Kubernetes job, unless the user edits it.
const PARALLELISM_MAX: u32 = 8;
/// A prefix that keeps the configuration of the user who runs the script out of the results.
const OWN_FLAGS_ONLY: &str = "\
# All flags are written out below.
unset SMALTI_CONFIG";

/// The work that the scripts run.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    /// The folder that paths are relative to, absolute.
    pub work_folder: String,
    /// The folder of the plan, relative to `work_folder` or absolute.
    pub folder: String,
    /// The folder of the outputs, relative to `work_folder` or absolute.
    pub output_folder: String,
    /// The other flags for `smalti batch`.
    pub flags: Vec<String>,
    pub item_count: usize,
    pub shard_count: u32,
}

impl Plan {
    /// How many digits the number of a shard has in names.
    pub(super) fn digits(&self) -> usize {
        self.shard_count.to_string().len().max(DIGITS_MIN)
    }

    /// The name of the manifest of shard `index`, counted from 1.
    pub(super) fn shard_name(&self, index: u32) -> String {
        format!("shard-{index:0width$}.jsonl", width = self.digits())
    }

    /// The arguments of `smalti`, quoted for a shell. The shell has the number of the shard in `$index`, and with
    /// leading zeros in `$shard`.
    fn arguments(&self, indent: &str) -> String {
        let next = format!(" \\\n{indent}");
        let mut text = format!(
            "batch --manifest {}\"/shard-$shard.jsonl\"{next}-o {}{next}--results {}\"/results.$index-of-{}.jsonl\"",
            quoted(&self.folder),
            quoted(&self.output_folder),
            quoted(&self.output_folder),
            self.shard_count,
        );
        for flag in &self.flags {
            text.push_str(if flag.starts_with('-') { &next } else { " " });
            text.push_str(&quoted(flag));
        }
        text
    }

    /// The last line of the arguments in a Slurm task: it sets as many threads as the task has processors, unless the
    /// plan's flags set them.
    fn slurm_threads(&self) -> &'static str {
        let is_said = self.flags.iter().any(|flag| flag == "--threads" || flag.starts_with("--threads="));
        if is_said { "" } else { " \\\n    ${SLURM_CPUS_PER_TASK:+--threads \"$SLURM_CPUS_PER_TASK\"}" }
    }

    fn heading(&self, how: &str) -> String {
        let version = env!("CARGO_PKG_VERSION");
        let pictures = words::counted(self.item_count as u64, "picture");
        let shards = words::counted(self.shard_count.into(), "shard");
        format!("# Written by smalti {version}: {pictures} in {shards}.\n{how}")
    }

    /// A job array of Slurm.
    pub(super) fn slurm(&self) -> String {
        let (count, digits) = (self.shard_count, self.digits());
        let heading = self.heading(
            "# Submit it with sbatch, whose flags override those below: sbatch --gres=gpu:1 --time=4:00:00 submit.slurm\n\
             # Set SMALTI to the program if it is not on the PATH of the nodes.",
        );
        // Slurm takes % for the beginning of a field, and reads quotes as a shell does.
        let log = format!("{}/slurm-%A_%a.log", self.absolute(&self.folder).replace('%', "%%"));
        let work_folder = quoted(&self.work_folder);
        let arguments = self.arguments("    ");
        let threads = self.slurm_threads();
        format!(
            r#"#!/bin/bash
{heading}
#SBATCH --job-name=smalti
#SBATCH --array=1-{count}
#SBATCH --output="{log}"
#SBATCH --open-mode=append
#SBATCH --requeue
# A minute before the time limit smalti is asked to end: it finishes what is begun on the device, keeps every whole picture
# and exits with 75, upon which the task goes back into the queue and goes on where it was.
#SBATCH --signal=B:USR1@60

cd {work_folder} || exit 1
{OWN_FLAGS_ONLY}
index=$SLURM_ARRAY_TASK_ID
shard=$(printf '%0{digits}d' "$index")
"${{SMALTI:-smalti}}" {arguments}{threads} &
pid=$!
cancelled=no
trap 'trapped=yes; kill -USR1 "$pid" 2>/dev/null' USR1
# A task that is cancelled must not come back, and one that Slurm itself requeues comes back without help.
trap 'trapped=yes; cancelled=yes; kill -TERM "$pid" 2>/dev/null' TERM INT
while :; do
    trapped=no
    wait "$pid"
    code=$?
    # A trap ends the wait, not the process, whose code the next wait gives.
    [ "$trapped" = yes ] && [ "$code" -gt 128 ] || break
done
if [ "$code" -eq 75 ] && [ "$cancelled" = no ] && [ "${{SLURM_RESTART_COUNT:-0}}" -lt "${{RESTARTS_MAX:-20}}" ]; then
    scontrol requeue "${{SLURM_ARRAY_JOB_ID}}_$SLURM_ARRAY_TASK_ID"
fi
exit "$code"
"#
        )
    }

    /// The arguments for the command of a container, in which Kubernetes puts variables in the place of `$(NAME)`, and
    /// one dollar in the place of two.
    fn arguments_in_container(&self, indent: &str) -> String {
        let twice = |text: &String| text.replace('$', "$$");
        let names = Self {
            folder: twice(&self.folder),
            output_folder: twice(&self.output_folder),
            flags: self.flags.iter().map(twice).collect(),
            ..self.clone()
        };
        names.arguments(indent)
    }

    /// An indexed job of Kubernetes.
    pub(super) fn kubernetes(&self) -> String {
        let heading = self.heading(
            "# Needs Kubernetes 1.29 or later. Before `kubectl create -f kubernetes.yaml`, set the image and the volume, which\n\
             # must hold inputs, plan and outputs at the path they have here, and resources such as nvidia.com/gpu.",
        );
        let (count, digits) = (self.shard_count, self.digits());
        let work_folder = json(&self.work_folder);
        let mut script = String::new();
        let command = format!(
            "{OWN_FLAGS_ONLY}\nindex=$((JOB_COMPLETION_INDEX + 1))\nshard=$(printf '%0{digits}d' \"$index\")\nexec smalti {}",
            self.arguments_in_container("  ")
        );
        for line in command.lines() {
            let _ = writeln!(script, "              {line}");
        }
        format!(
            r#"{heading}
apiVersion: batch/v1
kind: Job
metadata:
  generateName: smalti-
spec:
  completionMode: Indexed
  completions: {count}
  parallelism: {parallelism}
  backoffLimitPerIndex: 3
  podFailurePolicy:
    rules:
      # 75: interrupted. The pod is made anew and goes on; this is no failure.
      - action: Ignore
        onExitCodes:
          operator: In
          values: [75]
      - action: Ignore
        onPodConditions:
          - type: DisruptionTarget
      # 3: some pictures failed; 2: wrong usage. Another try would end the same way.
      - action: FailIndex
        onExitCodes:
          operator: In
          values: [2, 3]
  template:
    spec:
      restartPolicy: Never
      terminationGracePeriodSeconds: 60
      containers:
        - name: smalti
          image: smalti:latest
          workingDir: {work_folder}
          command:
            - /bin/sh
            - -c
            - |
{script}          resources:
            requests:
              cpu: "4"
              memory: 4Gi
          volumeMounts:
            - name: pictures
              mountPath: {work_folder}
      volumes:
        - name: pictures
          persistentVolumeClaim:
            claimName: pictures
"#,
            parallelism = count.min(PARALLELISM_MAX),
        )
    }

    /// A script for GNU parallel.
    pub(super) fn parallel(&self) -> String {
        let heading = self.heading(
            "# Needs GNU parallel. Arguments go to it: sh parallel.sh --jobs 2\n\
             # One job at a time is the default, since smalti uses all processors by itself.",
        );
        let (count, digits) = (self.shard_count, self.digits());
        let work_folder = quoted(&self.work_folder);
        // Parallel adds to a log whose name begins with a plus.
        let log = quoted(&format!("{}/parallel.log", self.absolute(&self.folder)));
        let arguments = self.arguments("        ");
        // Absolute, since a remote machine starts in another folder.
        let script = quoted(&format!("{}/parallel.sh", self.absolute(&self.folder)));
        format!(
            r#"#!/bin/sh
{heading}
cd {work_folder} || exit 1
{OWN_FLAGS_ONLY}
if [ "$1" = --shard ]; then
    index=$2
    shard=$(printf '%0{digits}d' "$index")
    exec "${{SMALTI:-smalti}}" {arguments}
fi
command -v parallel >/dev/null || {{ echo "parallel.sh: install GNU parallel" >&2; exit 1; }}
log={log}
# Parallel would read a name such as {{}} or {{= =}} in a command, so the script's own goes through the environment.
SMALTI_PLAN_SCRIPT={script}
export SMALTI_PLAN_SCRIPT
seq 1 {count} | parallel --will-cite --env SMALTI_PLAN_SCRIPT --jobs 1 --line-buffer --joblog "$log" --termseq TERM,60000,KILL,25 "$@" \
    'sh "$SMALTI_PLAN_SCRIPT" --shard' {{}}
# Columns 7 and 8 are exit code and signal of a shard. 75: run it again, as for one that a signal ended or that was not begun;
# 3: some pictures failed.
awk 'NR > 1 {{ if ($8 != 0 || $7 == 75) again = 1; else if ($7 == 3) some = 3; else if ($7 != 0) worst = $7 }}
    END {{ if (NR - 1 < {count}) again = 1; exit worst ? worst : again ? 75 : some + 0 }}' "$log"
"#
        )
    }

    /// A path that is valid in any folder.
    fn absolute(&self, path: &str) -> String {
        if path.starts_with('/') { path.to_owned() } else { format!("{}/{path}", self.work_folder) }
    }
}

/// Whether a script can contain a text: no shell, no scheduler and no YAML sees the end of a line in it, or anything
/// that is not printed.
pub(super) fn can_hold(text: &str) -> bool {
    !text.chars().any(|char| char.is_control() || "\u{2028}\u{2029}\u{FEFF}\u{FFFE}\u{FFFF}".contains(char))
}

/// A string for YAML. JSON strings are valid there.
fn json(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan() -> Plan {
        Plan {
            work_folder: "/home/me/my 100% photos".to_owned(),
            folder: "a plan".to_owned(),
            output_folder: "out".to_owned(),
            flags: ["--style=mosaic", "--palette=it's.gpl"].map(str::to_owned).to_vec(),
            item_count: 24_000,
            shard_count: 12,
        }
    }

    #[test]
    fn shards_are_named_so_that_they_sort_and_with_more_digits_if_there_are_more() {
        assert_eq!(plan().shard_name(3), "shard-0003.jsonl");
        let large = Plan { shard_count: 123_456, ..plan() };
        assert_eq!(large.shard_name(3), "shard-000003.jsonl");
    }

    #[cfg(unix)]
    #[test]
    fn a_shell_can_read_every_script() {
        use std::process::{Command, Stdio};

        let plan = plan();
        for (shell, script) in [("bash", plan.slurm()), ("sh", plan.parallel())] {
            let checked = Command::new(shell).args(["-n", "-c", &script]).stderr(Stdio::inherit()).status();
            assert!(checked.expect("there is a shell").success(), "{script}");
        }
    }

    #[test]
    fn threads_are_said_once_by_the_plan_or_else_by_slurm() {
        assert_eq!(plan().slurm().matches("--threads").count(), 1);
        let said = Plan { flags: vec!["--threads=2".to_owned()], ..plan() };
        let script = said.slurm();
        assert!(script.contains("--threads=2 &\n") && !script.contains("SLURM_CPUS_PER_TASK"), "{script}");
    }

    #[test]
    fn slurm_reads_the_log_of_a_folder_with_a_percent_sign_as_it_is() {
        let script = plan().slurm();
        assert!(script.contains("#SBATCH --output=\"/home/me/my 100%% photos/a plan/slurm-%A_%a.log\"\n"), "{script}");
        assert!(script.contains("#SBATCH --array=1-12\n"), "{script}");
        // Slurm reads directives only before the first command.
        let (_, commands) = script.split_once("\ncd '/home/me/my 100% photos'").expect("it goes to the folder");
        assert!(!commands.contains("#SBATCH"), "{script}");
    }
}
