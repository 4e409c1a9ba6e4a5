//! Which part of a batch a process does, and which items belong to it. The part comes from `--shard k/n`, or from a
//! scheduler by the environment.
//!
//! Nothing here reads the environment itself. Whatever is unclear is an error: if a process did everything instead of
//! its part, it would repeat the work of all others.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};
use std::fmt;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Most parts of a batch.
pub(crate) const SHARD_COUNT_MAX: u32 = 1_000_000;

/// One of `count` parts of a batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Shard {
    /// From 1 to `count`.
    index: u32,
    count: u32,
}

impl Shard {
    /// Part `index` of `count`.
    ///
    /// # Errors
    /// [`Error::Usage`] if there is no such part.
    pub(crate) fn new(index: u32, count: u32) -> Result<Self> {
        if (1..=count).contains(&index) && count <= SHARD_COUNT_MAX {
            return Ok(Self { index, count });
        }
        Err(Error::Usage(format!(
            "shard {index}/{count}: expected k/n with k from 1 to n, and n at most {SHARD_COUNT_MAX}"
        )))
    }

    /// The number of the part, from 1 to [`Shard::count`].
    pub(crate) fn index(self) -> u32 {
        self.index
    }

    /// How many parts there are.
    pub(crate) fn count(self) -> u32 {
        self.count
    }
}

impl fmt::Display for Shard {
    /// As typed: `3/8`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

/// The value of `--shard`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ShardChoice {
    /// This part.
    Given(Shard),
    /// The part that the environment names.
    Auto,
}

impl ShardChoice {
    /// The part to do. `variable` looks up a variable of the environment.
    ///
    /// # Errors
    /// [`Error::Usage`] if the part must come from the environment, and that names none or contradicts itself.
    pub(crate) fn resolve(self, variable: impl Fn(&str) -> Option<String>) -> Result<Shard> {
        match self {
            Self::Given(shard) => Ok(shard),
            Self::Auto => Environment { variable }.shard(),
        }
    }
}

/// `k/n`, or `auto`.
pub(crate) fn parse(text: &str) -> Result<ShardChoice, String> {
    if text == "auto" {
        return Ok(ShardChoice::Auto);
    }
    let parts = text.split_once('/').and_then(|(index, count)| Some((digits(index)?, digits(count)?)));
    let (index, count) = parts.ok_or("expected k/n with k from 1 to n, such as 3/8, or auto")?;
    Shard::new(index, count).map(ShardChoice::Given).map_err(|error| error.to_string())
}

/// A number that consists of digits only.
fn digits(text: &str) -> Option<u32> {
    if text.bytes().all(|byte| byte.is_ascii_digit()) { text.parse().ok() } else { None }
}

/// The environment of a process, where schedulers put their numbers.
struct Environment<F> {
    variable: F,
}

/// The numbers of a scheduler's array of tasks.
struct Tasks {
    /// The variable that `this` comes from.
    name: &'static str,
    this: u32,
    first: u32,
    /// How many tasks there are, numbered from `first` in steps of `step`. None if they are not evenly spaced.
    count: Option<u32>,
    step: u32,
}

impl<F: Fn(&str) -> Option<String>> Environment<F> {
    /// The part that the environment names. The first of these that is set counts: `SHARD_INDEX` (from 1) of
    /// `SHARD_COUNT`; a Slurm array; an indexed job of Kubernetes; an array of Grid Engine.
    ///
    /// If only `SHARD_COUNT` is set, it gives the number of parts, and the scheduler gives the part: the task's number,
    /// which Kubernetes counts from 0. This lets single parts run again.
    fn shard(&self) -> Result<Shard> {
        let count = self.number("SHARD_COUNT")?;
        if let Some(index) = self.number("SHARD_INDEX")? {
            let count = count.ok_or_else(|| usage("SHARD_INDEX is set but SHARD_COUNT is not; set both"))?;
            return Self::named(index, count, "SHARD_INDEX counts from 1 to SHARD_COUNT");
        }
        if let Some(tasks) = self.slurm()? {
            return tasks.shard(count);
        }
        if let Some(index) = self.number("JOB_COMPLETION_INDEX")? {
            let count = count.map_or_else(|| self.number("JOB_COMPLETIONS"), |count| Ok(Some(count)))?;
            let sentence =
                "Kubernetes does not tell a pod how many there are; set SHARD_COUNT in its env to spec.completions";
            let count = count.ok_or_else(|| usage(sentence))?;
            let sentence = "JOB_COMPLETION_INDEX counts from 0 to one less than SHARD_COUNT";
            return Self::named(index.saturating_add(1), count, sentence);
        }
        if let Some(tasks) = self.grid_engine()? {
            return tasks.shard(count);
        }
        Err(usage(
            "--shard auto: no scheduler names a shard here; submit an array (Slurm, Grid Engine) or an indexed job (Kubernetes), \
             set SHARD_INDEX and SHARD_COUNT, or give --shard k/n",
        ))
    }

    fn named(index: u32, count: u32, rule: &str) -> Result<Shard> {
        Shard::new(index, count).map_err(|error| usage(&format!("{error}; {rule}")))
    }

    fn slurm(&self) -> Result<Option<Tasks>> {
        let Some(this) = self.number("SLURM_ARRAY_TASK_ID")? else { return Ok(None) };
        let needed =
            |name| self.number(name)?.ok_or_else(|| usage(&format!("SLURM_ARRAY_TASK_ID is set but {name} is not")));
        let first = needed("SLURM_ARRAY_TASK_MIN")?;
        let (last, count) = (needed("SLURM_ARRAY_TASK_MAX")?, needed("SLURM_ARRAY_TASK_COUNT")?);
        let step = self.number("SLURM_ARRAY_TASK_STEP")?.unwrap_or(1).max(1);
        // An array such as 1,2,7 has gaps, and no variable tells where.
        let is_even = last.checked_sub(first).is_some_and(|span| span % step == 0 && span / step + 1 == count);
        Ok(Some(Tasks { name: "SLURM_ARRAY_TASK_ID", this, first, count: is_even.then_some(count), step }))
    }

    fn grid_engine(&self) -> Result<Option<Tasks>> {
        if (self.variable)("SGE_TASK_ID").is_some_and(|id| id == "undefined") {
            return Ok(None); // A job that is not an array.
        }
        let Some(this) = self.number("SGE_TASK_ID")? else { return Ok(None) };
        let needed = |name| self.number(name)?.ok_or_else(|| usage(&format!("SGE_TASK_ID is set but {name} is not")));
        let (first, last) = (needed("SGE_TASK_FIRST")?, needed("SGE_TASK_LAST")?);
        let step = needed("SGE_TASK_STEPSIZE")?.max(1);
        let count = last.checked_sub(first).map(|span| span / step + 1);
        Ok(Some(Tasks { name: "SGE_TASK_ID", this, first, count, step }))
    }

    /// The number in a variable. None if the variable is not set, or empty.
    fn number(&self, name: &str) -> Result<Option<u32>> {
        let Some(text) = (self.variable)(name).filter(|text| !text.is_empty()) else { return Ok(None) };
        digits(&text).map(Some).ok_or_else(|| usage(&format!("{name}={text}: expected a whole number")))
    }
}

impl Tasks {
    /// The part of this task. If `count` gives the number of parts, it is the task's number. Otherwise it is the task's
    /// place in the array, which must then begin at 0 or 1 and have no gaps: an array that begins elsewhere is probably
    /// a rerun of some tasks of another.
    fn shard(&self, count: Option<u32>) -> Result<Shard> {
        if let Some(count) = count {
            return Shard::new(self.this, count)
                .map_err(|error| usage(&format!("{error}; {} must be 1 to SHARD_COUNT", self.name)));
        }
        let Tasks { name, this, first, step, .. } = *self;
        let count = self.count.filter(|_| first <= 1);
        let offset = this.checked_sub(first).filter(|offset| offset % step == 0);
        match (count, offset) {
            (Some(count), Some(offset)) => Shard::new(offset / step + 1, count),
            _ => Err(usage(&format!(
                "{name}={this}: the tasks of this array are not numbered evenly from 0 or 1, so nothing tells how \
                 many shards there are; submit a whole array, or set SHARD_COUNT to run some shards again by their numbers"
            ))),
        }
    }
}

fn usage(sentence: &str) -> Error {
    Error::Usage(sentence.to_owned())
}

/// The items of `shard`, in ascending order. `groups` has the group of each item. Items of one group stay together, and
/// every item is in exactly one shard.
///
/// Groups come first, the largest ahead; then items without a group. Each goes to the shard that has the fewest items
/// so far. The result depends on the order of the items and on nothing else, so callers must sort them the same way
/// everywhere.
pub(crate) fn assign(groups: &[Option<&str>], shard: Shard) -> Vec<usize> {
    divide(groups, shard.count).swap_remove(shard.index as usize - 1)
}

/// The items of each of `count` shards, as [`assign`] gives them.
pub(crate) fn divide(groups: &[Option<&str>], count: u32) -> Vec<Vec<usize>> {
    let mut units = units(groups);
    // A stable sort: units of one size keep the order of their first items.
    units.sort_by_key(|unit| Reverse(unit.len()));
    let mut loads: BinaryHeap<Reverse<(usize, usize)>> = (0..count as usize).map(|index| Reverse((0, index))).collect();
    let mut shards = vec![Vec::new(); count as usize];
    for unit in units {
        let Some(Reverse((load, index))) = loads.pop() else { break };
        loads.push(Reverse((load + unit.len(), index)));
        shards[index].extend(unit);
    }
    for shard in &mut shards {
        shard.sort_unstable();
    }
    shards
}

/// How many shards can get an item at all.
pub(crate) fn unit_count(groups: &[Option<&str>]) -> u32 {
    u32::try_from(units(groups).len()).unwrap_or(u32::MAX)
}

/// The sets of items that stay together, in the order of their first items.
fn units(groups: &[Option<&str>]) -> Vec<Vec<usize>> {
    let mut units: Vec<Vec<usize>> = Vec::new();
    let mut unit_of_group: HashMap<&str, usize> = HashMap::new();
    for (item, group) in groups.iter().enumerate() {
        let unit = group.map_or(units.len(), |group| *unit_of_group.entry(group).or_insert(units.len()));
        if unit == units.len() {
            units.push(Vec::new());
        }
        units[unit].push(item);
    }
    units
}

#[cfg(test)]
mod tests {
    use super::*;

    fn auto(variables: &[(&str, &str)]) -> Result<String, String> {
        let variable =
            |name: &str| variables.iter().find(|(known, _)| *known == name).map(|(_, value)| (*value).to_owned());
        let shard = ShardChoice::Auto.resolve(variable);
        shard.map(|shard| shard.to_string()).map_err(|error| error.to_string())
    }

    /// What Slurm tells task `id` of an array from `first` to `last`.
    fn slurm<'a>(id: &'a str, [first, last, count, step]: [&'a str; 4]) -> [(&'static str, &'a str); 5] {
        [
            ("SLURM_ARRAY_TASK_ID", id),
            ("SLURM_ARRAY_TASK_MIN", first),
            ("SLURM_ARRAY_TASK_MAX", last),
            ("SLURM_ARRAY_TASK_COUNT", count),
            ("SLURM_ARRAY_TASK_STEP", step),
        ]
    }

    fn grid_engine<'a>(id: &'a str, [first, last, step]: [&'a str; 3]) -> [(&'static str, &'a str); 4] {
        [("SGE_TASK_ID", id), ("SGE_TASK_FIRST", first), ("SGE_TASK_LAST", last), ("SGE_TASK_STEPSIZE", step)]
    }

    #[test]
    fn a_shard_is_typed_as_k_of_n_or_as_auto() {
        assert_eq!(parse("auto"), Ok(ShardChoice::Auto));
        for text in ["1/1", "3/8", "1000000/1000000"] {
            assert_eq!(
                parse(text).map(|choice| choice.resolve(|_| None).expect("given").to_string()),
                Ok(text.to_owned())
            );
        }
        for text in
            ["", "3", "0/8", "9/8", "1/0", "-1/8", "+1/8", "1/8/2", "1 / 8", "all", "1/1000001", "1/99999999999"]
        {
            assert!(parse(text).is_err(), "{text:?}");
        }
    }

    #[test]
    fn without_a_scheduler_auto_is_an_error_and_never_everything() {
        let refusal = auto(&[]).expect_err("nothing names a shard");
        assert!(refusal.contains("SHARD_INDEX and SHARD_COUNT"), "{refusal}");
        // A Slurm job that is not an array, and such a job of Grid Engine.
        auto(&[("SLURM_JOB_ID", "7"), ("SLURM_NTASKS", "1"), ("SLURM_PROCID", "0")]).expect_err("no array");
        auto(&[("SGE_TASK_ID", "undefined"), ("SGE_TASK_FIRST", "undefined")]).expect_err("no array");
        auto(&[("SHARD_COUNT", "4")]).expect_err("which one is not said");
        auto(&[("SHARD_INDEX", ""), ("SHARD_COUNT", "4")]).expect_err("empty is not set");
    }

    #[test]
    fn our_own_variables_come_first_and_count_from_1() {
        let own = |index, count| auto(&[("SHARD_INDEX", index), ("SHARD_COUNT", count), ("SLURM_ARRAY_TASK_ID", "9")]);
        assert_eq!(own("1", "4"), Ok("1/4".to_owned()));
        assert_eq!(own("4", "4"), Ok("4/4".to_owned()));
        for (index, count) in [("0", "4"), ("5", "4"), ("one", "4"), ("1", "many"), ("1", ""), ("-1", "4")] {
            own(index, count).expect_err("no such shard");
        }
        let refusal = own("0", "4").expect_err("it counts from 1");
        assert!(refusal.contains("SHARD_INDEX counts from 1"), "{refusal}");
    }

    #[test]
    fn a_slurm_array_divides_the_work_among_its_tasks() {
        assert_eq!(auto(&slurm("0", ["0", "7", "8", "1"])), Ok("1/8".to_owned()));
        assert_eq!(auto(&slurm("7", ["0", "7", "8", "1"])), Ok("8/8".to_owned()));
        assert_eq!(auto(&slurm("3", ["1", "8", "8", "1"])), Ok("3/8".to_owned()));
        assert_eq!(auto(&slurm("9", ["1", "9", "3", "4"])), Ok("3/3".to_owned()));
        assert_eq!(auto(&slurm("1", ["1", "1", "1", "1"])), Ok("1/1".to_owned()));
    }

    #[test]
    fn a_slurm_array_with_gaps_or_another_beginning_needs_the_count() {
        // --array=2,5,9, --array=1,2,7, and a rerun of the tasks 3 and 7 of an array.
        let sparse =
            [slurm("5", ["2", "9", "3", "1"]), slurm("2", ["1", "7", "3", "1"]), slurm("7", ["3", "7", "2", "4"])];
        for variables in sparse {
            let refusal = auto(&variables).expect_err("it has gaps");
            assert!(refusal.contains("SHARD_COUNT"), "{refusal}");
        }
        let with_count = |id, count| {
            let task = slurm(id, ["3", "7", "2", "4"]);
            auto(&[task.as_slice(), &[("SHARD_COUNT", count)]].concat())
        };
        assert_eq!(with_count("7", "10"), Ok("7/10".to_owned()));
        with_count("7", "6").expect_err("there is no seventh of six");
        with_count("0", "6").expect_err("they count from 1");
        auto(&slurm("3", ["1", "8", "8", "1"])[..3]).expect_err("an array without its count");
        auto(&slurm("2", ["1", "9", "3", "4"])).expect_err("no task of this array has that number");
    }

    #[test]
    fn a_pod_of_kubernetes_needs_to_be_told_how_many_there_are() {
        let pod = |index, name, count| auto(&[("JOB_COMPLETION_INDEX", index), (name, count)]);
        assert_eq!(pod("0", "SHARD_COUNT", "4"), Ok("1/4".to_owned()));
        assert_eq!(pod("3", "JOB_COMPLETIONS", "4"), Ok("4/4".to_owned()));
        pod("4", "SHARD_COUNT", "4").expect_err("pods count from 0");
        pod("0", "HOSTNAME", "pod").expect_err("how many is not said");
    }

    #[test]
    fn an_array_of_grid_engine_divides_the_work_among_its_tasks() {
        assert_eq!(auto(&grid_engine("3", ["1", "8", "1"])), Ok("3/8".to_owned()));
        assert_eq!(auto(&grid_engine("7", ["1", "9", "3"])), Ok("3/3".to_owned()));
        auto(&grid_engine("3", ["3", "8", "1"])).expect_err("it repeats a part of an array");
    }

    fn shards(groups: &[Option<&str>], count: u32) -> Vec<Vec<usize>> {
        (1..=count).map(|index| assign(groups, Shard::new(index, count).expect("it is one of them"))).collect()
    }

    #[test]
    fn every_item_is_in_exactly_one_shard_and_shards_differ_by_one_item_at_most() {
        for item_count in [0, 1, 7, 64, 1000] {
            for count in [1, 2, 3, 8, 70] {
                let shards = shards(&vec![None; item_count], count);
                let mut all: Vec<usize> = shards.iter().flatten().copied().collect();
                all.sort_unstable();
                assert_eq!(all, (0..item_count).collect::<Vec<_>>());
                let sizes = shards.iter().map(Vec::len);
                let spread = sizes.clone().max().unwrap_or(0) - sizes.min().unwrap_or(0);
                assert!(spread <= 1, "{item_count} items in {count} shards differ by {spread}");
            }
        }
    }

    #[test]
    fn a_group_stays_in_one_shard_and_the_largest_ones_are_spread_first() {
        let groups = [None, Some("a"), Some("b"), Some("a"), None, Some("b"), Some("a"), Some("c"), None];
        assert_eq!(shards(&groups, 2), [vec![1, 3, 4, 6, 8], vec![0, 2, 5, 7]]);
        assert_eq!(shards(&groups, 3), [vec![1, 3, 6], vec![2, 5, 7], vec![0, 4, 8]]);
        let one_group = [Some("all"); 5];
        assert_eq!(shards(&one_group, 2), [vec![0, 1, 2, 3, 4], vec![]]);
    }
}
