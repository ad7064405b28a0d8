//! Merges shards into the record of the whole run.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use super::chi_square::Draws;
use super::interrupt::Interrupt;
use super::job::{Block, BudgetTerms, Job, Passes, Start, Task};
use super::shard::{self, Marker, Shard, ShardPiece};
use super::workers::{Completed, Output};
use super::{Options, Ran, checkpoint, conclude, take_passes};
use crate::error::{Error, Result};
use crate::experiment::Experiment;
use crate::experiment::picture;
use crate::experiment::registry::Registry;
use crate::results::json::hash_json;
use crate::results::store::RecordFolder;
use crate::results::{lock, provenance};
use crate::stats::tree::batch_level;

/// Joins the shards in `folders`, or all below the results folder where none is named, with what the results folder
/// keeps of earlier runs, and writes the record.
///
/// # Errors
/// Passes that no shard holds, or two of them; a shard of another experiment or program, or a damaged one; as
/// [`super::run`].
pub(crate) fn merge(
    experiment: &Experiment,
    registry: &Registry,
    options: &Options,
    folders: &[PathBuf],
    interrupt: &Interrupt,
) -> Result<Ran> {
    let mut plan = super::plan(experiment, registry, options.threads)?;
    let name = &experiment.file.name;
    if let Some(folder) = &options.passes_of {
        take_passes(&mut plan, experiment, &RecordFolder::new(folder.join(name)))?;
    }
    let root = options.folder(name);
    let lock = lock::lock(&root)?;
    checkpoint::prepare(&root)?;
    let identities: BTreeSet<&str> = plan.jobs.iter().map(|job| job.identity.as_str()).collect();
    let shards = Shards::read(experiment, &root, folders, &identities)?;
    let merger = Merger { experiment, root: &root, shards, interrupt };
    plan.jobs.iter().try_for_each(|job| merger.check(job))?;
    let completed = plan.jobs.iter().map(|job| merger.job(job)).collect::<Result<Vec<_>>>()?;
    let ran = conclude(experiment, &plan, &root, lock, completed, options, interrupt)?;
    ran.folder.write_pictures(&picture::wanted(&experiment.file.picture))?;
    Ok(ran)
}

/// Complete shards, and what they hold by job.
struct Shards {
    folders: Vec<PathBuf>,
    markers: Vec<Marker>,
    /// Folders without a marker.
    incomplete: Vec<PathBuf>,
    /// Of each job the shard, by index, and its piece.
    pieces: BTreeMap<String, Vec<(usize, ShardPiece)>>,
}

impl Shards {
    fn read(
        experiment: &Experiment,
        root: &Path,
        folders: &[PathBuf],
        identities: &BTreeSet<&str>,
    ) -> Result<Shards> {
        let named = if folders.is_empty() { found(root)? } else { folders.to_vec() };
        let mut all = Shards {
            folders: Vec::new(),
            markers: Vec::new(),
            incomplete: Vec::new(),
            pieces: BTreeMap::new(),
        };
        for folder in named {
            let Some(marker) = shard::read(&folder)? else {
                all.incomplete.push(folder);
                continue;
            };
            let index = all.folders.len();
            if let Some(what) = foreign(&marker, &experiment.file.name, identities) {
                let help = "move the folder away";
                return Err(Error::record(&folder, format!("shard {} {what}; {help}", marker.shard)));
            }
            if !marker.is_sound() {
                let what =
                    format!("shard {}: shard.json was changed after it was written", marker.shard);
                return Err(Error::record(&folder, format!("{what}; run the shard again")));
            }
            for piece in marker.pieces.iter().filter(|piece| piece.start < piece.end) {
                all.pieces.entry(piece.identity.clone()).or_default().push((index, piece.clone()));
            }
            all.folders.push(folder);
            all.markers.push(marker);
        }
        Ok(all)
    }

    /// Which shards are missing, as a sentence with the command that runs the first of them.
    fn missing(&self, file: &Path) -> String {
        let unfinished: Vec<Shard> =
            self.incomplete.iter().filter_map(|folder| shard::named(folder)).collect();
        let counts: BTreeSet<u64> = self
            .markers
            .iter()
            .map(|m| m.shard.count)
            .chain(unfinished.iter().map(|s| s.count))
            .collect();
        let there: BTreeSet<Shard> = self.markers.iter().map(|marker| marker.shard).collect();
        if counts.is_empty() {
            return format!(
                "there is no shard yet; run `scatterproof run {} --shard 1/N`",
                file.display()
            );
        }
        let mut missing = Vec::new();
        for count in counts {
            let all = (1..=count).map(|index| Shard { index, count });
            missing.extend(all.filter(|shard| !there.contains(shard)));
        }
        let Some(first) = missing.first() else {
            return "the shards are complete, but of another budget; run them again".into();
        };
        let state = |shard: &Shard| match unfinished.contains(shard) {
            true => format!("{shard} (not complete)"),
            false => shard.to_string(),
        };
        let mut words: Vec<String> = missing.iter().take(10).map(state).collect();
        if missing.len() > words.len() {
            words.push(format!("and {} more", missing.len() - words.len()));
        }
        let of = if missing.len() == 1 { "shard" } else { "shards" };
        let command = format!("scatterproof run {} --shard {first}", file.display());
        format!("missing: {of} {}; run `{command}`", words.join(", "))
    }
}

/// The folders below `shards/`.
fn found(root: &Path) -> Result<Vec<PathBuf>> {
    let folder = shard::all_in(root);
    let entries = match fs::read_dir(&folder) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.map_err(Error::io(&folder, "read the shards"))?,
    };
    let mut folders = Vec::new();
    for entry in entries {
        let path = entry.map_err(Error::io(&folder, "read the shards"))?.path();
        if path.is_dir() {
            folders.push(path);
        }
    }
    folders.sort();
    Ok(folders)
}

/// Why a shard is not one of this experiment, as a predicate.
fn foreign(marker: &Marker, experiment: &str, identities: &BTreeSet<&str>) -> Option<String> {
    if marker.experiment != experiment {
        return Some(format!("is of the experiment `{}`", marker.experiment));
    }
    if marker.fingerprint != provenance::fingerprint() {
        return Some(format!("was run by another version of the program ({})", marker.fingerprint));
    }
    if marker.build != provenance::build() {
        return Some("was run by another build of the program".into());
    }
    let piece = marker.pieces.iter().find(|piece| !identities.contains(piece.identity.as_str()))?;
    Some(format!(
        "holds {}, which the experiment does not have: the file was changed",
        quoted(&piece.label)
    ))
}

fn quoted(label: &str) -> String {
    format!("`{label}`")
}

/// Why pieces do not make up a run.
enum Gap {
    Missing([u64; 2]),
    Doubled([usize; 2], [u64; 2]),
    Beyond(usize, u64),
}

struct Merger<'a> {
    experiment: &'a Experiment,
    root: &'a Path,
    shards: Shards,
    interrupt: &'a Interrupt,
}

/// What makes up the passes of a job.
struct PassSources<'a> {
    start: Start,
    base: Block,
    chain: Vec<&'a (usize, ShardPiece)>,
}

impl Merger<'_> {
    fn job(&self, job: &Job) -> Result<Completed> {
        match &job.task {
            Task::Estimate(passes) => self.passes(job, passes),
            Task::Draw(draws) => self.draws(job, draws),
        }
    }

    fn pieces(&self, job: &Job) -> &[(usize, ShardPiece)] {
        self.shards.pieces.get(&job.identity).map_or(&[], Vec::as_slice)
    }

    /// The passes of a job, what is kept of them, and the pieces that make up the rest.
    fn sources(&self, job: &Job, passes: &Passes) -> Result<PassSources<'_>> {
        let own = checkpoint::path(self.root, &job.identity);
        let budget = budget_hash(self.experiment, &passes.terms);
        let pieces = self.pieces(job);
        let starts = pieces.iter().map(|(shard, _)| self.state(*shard, job));
        let starts = std::iter::once(own.clone()).chain(starts);
        let starts: Vec<Start> =
            starts.filter_map(|path| checkpoint::start(&path, &job.identity)).collect();
        let fixed = starts.iter().find(|start| start.budget == budget).map(|start| start.passes);
        let count = match (passes.count, fixed) {
            (Some(count), _) | (None, Some(count)) => count,
            (None, None) => shard::count(self.experiment, passes, self.interrupt)?,
        };
        let start = Start { claims: claims(&starts), budget, passes: count };
        let keep_level = batch_level(count);
        // A state does not hold the number of bands, by which a pair of images across two states is compared.
        let bands = passes.layout.bands();
        let empty = || Block { bands, ..Block::empty(0, keep_level) };
        let kept = checkpoint::load_passes(&own, &job.identity, 0, keep_level);
        let kept = kept
            .filter(|block| block.next_pass() <= count)
            .map_or_else(empty, |block| Block { bands, ..block });
        // What is kept already, and then what is new; or shards from the first pass on.
        let next = kept.next_pass();
        match chain(pieces, next, count) {
            Ok(chain) => Ok(PassSources { start, base: kept, chain }),
            Err(gap) => match chain(pieces, 0, count) {
                Ok(chain) => Ok(PassSources { start, base: empty(), chain }),
                Err(first) => Err(self.refusal(job, if next > 0 { gap } else { first })),
            },
        }
    }

    fn state(&self, shard: usize, job: &Job) -> PathBuf {
        checkpoint::path(&self.shards.folders[shard], &job.identity)
    }

    /// Whether all that is needed of a job is there, by what the shards say.
    fn check(&self, job: &Job) -> Result<()> {
        job.passes().map_or(Ok(()), |passes| self.sources(job, passes).map(drop))
    }

    fn passes(&self, job: &Job, passes: &Passes) -> Result<Completed> {
        let PassSources { start, base: mut block, chain } = self.sources(job, passes)?;
        let (keep_level, bands) = (batch_level(start.passes), passes.layout.bands());
        for (shard, piece) in &chain {
            let path = self.state(*shard, job);
            let part = checkpoint::load_passes(&path, &job.identity, piece.start, keep_level)
                .filter(|part| part.next_pass() == piece.end)
                .ok_or_else(|| self.damaged(job, *shard))?;
            block.append(Block { bands, ..part });
        }
        if !chain.is_empty() {
            let own = checkpoint::path(self.root, &job.identity);
            checkpoint::save_passes(&own, &job.identity, &start, &block)?;
        }
        Ok(Completed { start, output: Output::Passes(Box::new(block.finish())) })
    }

    fn draws(&self, job: &Job, draws: &Draws) -> Result<Completed> {
        let own = checkpoint::path(self.root, &job.identity);
        let load = |path: &Path| {
            let sampled = checkpoint::load_draws(path, &job.identity, draws.samples)?;
            Some((checkpoint::start(path, &job.identity)?, sampled))
        };
        let finished = |(start, sampled)| Completed { start, output: Output::Draws(Box::new(sampled)) };
        if let Some(kept) = load(&own) {
            return Ok(finished(kept));
        }
        let shard = match self.pieces(job) {
            [] => return Err(self.refusal(job, Gap::Missing([0, draws.samples]))),
            [(shard, _)] => *shard,
            [(a, _), (b, _), ..] => {
                return Err(self.refusal(job, Gap::Doubled([*a, *b], [0, draws.samples])));
            }
        };
        let path = self.state(shard, job);
        let (start, sampled) = load(&path).ok_or_else(|| self.damaged(job, shard))?;
        checkpoint::save_draws(&own, &job.identity, &start, &sampled)?;
        Ok(finished((start, sampled)))
    }

    fn damaged(&self, job: &Job, shard: usize) -> Error {
        let (folder, number) = (&self.shards.folders[shard], self.shards.markers[shard].shard);
        let file = self.experiment.path.display();
        let what = format!("shard {number}: the state of {} is missing or damaged", quoted(&job.label));
        Error::record(folder, format!("{what}; run `scatterproof run {file} --shard {number}` again"))
    }

    fn refusal(&self, job: &Job, gap: Gap) -> Error {
        let label = quoted(&job.label);
        let name = |shard: usize| {
            format!(
                "shard {} ({})",
                self.shards.markers[shard].shard,
                self.shards.folders[shard].display()
            )
        };
        let what = match gap {
            Gap::Missing([from, to]) => {
                let missing = self.shards.missing(&self.experiment.path);
                format!("no shard holds {label}, {from} to {to}; {missing}")
            }
            Gap::Doubled([a, b], [from, to]) => {
                format!(
                    "{} and {} both hold {label}, {from} to {to}; move one of them away",
                    name(a),
                    name(b)
                )
            }
            Gap::Beyond(shard, end) => {
                format!("{} holds {label} up to {end}, more than the budget has", name(shard))
            }
        };
        Error::record(self.root, what)
    }
}

/// The pieces that make up the passes from `from` to `to`, in their order. Pieces that end before are merged already.
fn chain(
    pieces: &[(usize, ShardPiece)],
    from: u64,
    to: u64,
) -> std::result::Result<Vec<&(usize, ShardPiece)>, Gap> {
    let mut left: Vec<&(usize, ShardPiece)> =
        pieces.iter().filter(|(_, piece)| piece.end > from).collect();
    left.sort_by_key(|(_, piece)| (piece.start, piece.end));
    let (mut at, mut before) = (from, None);
    for (shard, piece) in &left {
        match before {
            Some(earlier) if piece.start < at => {
                return Err(Gap::Doubled([earlier, *shard], [piece.start, at.min(piece.end)]));
            }
            _ if piece.start != at => return Err(Gap::Missing([at, piece.start.max(at)])),
            _ if piece.end > to => return Err(Gap::Beyond(*shard, piece.end)),
            _ => (at, before) = (piece.end, Some(*shard)),
        }
    }
    if at < to { Err(Gap::Missing([at, to])) } else { Ok(left) }
}

/// The claims that were made before every first pass.
fn claims(starts: &[Start]) -> Vec<String> {
    let Some((first, others)) = starts.split_first() else { return Vec::new() };
    let in_all = |claim: &&String| others.iter().all(|start| start.claims.contains(*claim));
    first.claims.iter().filter(in_all).cloned().collect()
}

fn budget_hash(experiment: &Experiment, terms: &BudgetTerms) -> String {
    hash_json(&(experiment.file.budget.as_ref(), terms))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pieces(ranges: &[[u64; 2]]) -> Vec<(usize, ShardPiece)> {
        let piece = |&[start, end]: &[u64; 2]| ShardPiece {
            label: String::new(),
            identity: String::new(),
            start,
            end,
        };
        ranges.iter().map(piece).enumerate().collect()
    }

    #[test]
    fn pieces_make_up_a_run() {
        let joined =
            |ranges: &[[u64; 2]], from: u64, to: u64| -> std::result::Result<Vec<usize>, String> {
                let pieces = pieces(ranges);
                match chain(&pieces, from, to) {
                    Ok(chain) => Ok(chain.into_iter().map(|(shard, _)| *shard).collect()),
                    Err(Gap::Missing(range)) => Err(format!("missing {range:?}")),
                    Err(Gap::Doubled(shards, range)) => Err(format!("doubled {shards:?} {range:?}")),
                    Err(Gap::Beyond(shard, end)) => Err(format!("beyond {shard} {end}")),
                }
            };
        assert_eq!(joined(&[[5, 9], [0, 3], [3, 5]], 0, 9), Ok(vec![1, 2, 0]));
        assert_eq!(joined(&[[5, 9], [0, 3], [3, 5]], 5, 9), Ok(vec![0]));
        assert_eq!(joined(&[[0, 3]], 9, 9), Ok(vec![]));
        assert_eq!(joined(&[[5, 9], [0, 3]], 0, 9), Err("missing [3, 5]".into()));
        assert_eq!(joined(&[[0, 3], [3, 5]], 0, 9), Err("missing [5, 9]".into()));
        assert_eq!(joined(&[], 0, 9), Err("missing [0, 9]".into()));
        assert_eq!(joined(&[[0, 5], [3, 9]], 0, 9), Err("doubled [0, 1] [3, 5]".into()));
        assert_eq!(joined(&[[0, 9], [0, 9]], 0, 9), Err("doubled [0, 1] [0, 9]".into()));
        assert_eq!(joined(&[[0, 5], [5, 12]], 0, 9), Err("beyond 1 12".into()));
    }
}
