//! From an experiment to jobs: the scene of every cell, every estimator on it, every sampler, and the streams
//! of all of them.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use serde_json::{Value, json};

use super::chi_square::Draws;
use super::clock::thread_cpu_time;
use super::comparisons;
use super::decidable;
use super::job::{Arm, BudgetTerms, Group, Job, Passes, SetUp, Task, band_groups};
use super::keys::{KEY_VERSION, Stage, StreamName};
use super::memory::MemoryEstimate;
use super::parallel::in_parallel;
use crate::error::{Error, Refusals, Result};
use crate::estimators::{Estimator, Layout};
use crate::experiment::build::{self, Builder, ShapeWords, Shapes};
use crate::experiment::registry::Registry;
use crate::experiment::schema::{Budget, CONTROL, ClaimEntry, CostMeasure, Faster, SamplerEntry};
use crate::experiment::{CellSpec, Experiment, titled};
use crate::results::json::{canonical, hash_bytes, hash_json};
use crate::results::provenance;
use crate::results::record::{Against, Band, Comparison, Observable};
use crate::samplers::Sampler;
use crate::sampling::stream::StreamKey;
use crate::scene::Scene;

/// Plan of a run.
pub(crate) struct Plan {
    /// Bands of the experiment.
    pub bands: Vec<Band>,
    /// One job per cell and arm of an estimator, cells outermost; then one per sampler.
    pub jobs: Vec<Job>,
    /// The claims on estimators, expanded.
    pub comparisons: Vec<Comparison>,
    /// Stage that the passes belong to.
    pub stage: Stage,
    /// What the scenes hold, and what making the largest takes beside it, bytes.
    scene_bytes: [usize; 2],
    /// Passes per job, where the budget states them.
    passes: Option<u64>,
}

impl Plan {
    /// Estimate of the run's memory, where the estimators of a cell are interleaved or not.
    pub(crate) fn memory(&self, threads: usize, is_interleaved: bool) -> MemoryEstimate {
        MemoryEstimate::new(&self.jobs, self.scene_bytes, threads, self.passes, is_interleaved)
    }
}

/// Observables per cell that a record holds at most.
const MOST_OBSERVABLES: usize = 4096;

/// Builds everything an experiment needs, on a number of threads; what cannot be built is found here, before any work.
///
/// # Errors
/// Everything that only shows when it is built: meshes, maps, sensors inside bodies, claims on
/// observables that do not exist, options that a sampler refuses.
pub(crate) fn plan(experiment: &Experiment, registry: &Registry, threads: usize) -> Result<Plan> {
    plan_stage(experiment, registry, threads, Stage::Main, None)
}

/// What plans of a file's settings have built, for the next one: settings often differ in budgets only.
#[derive(Default)]
pub(crate) struct Built {
    shapes: Shapes,
    estimators: Estimators,
}

/// Estimators by the hash of their scene, bands and options, with the CPU time of building each.
type Estimators = BTreeMap<String, (Arc<dyn Estimator>, Duration)>;

/// As [`plan`], for plans that are not run: equal parts are built once, those of the two arms of one estimator, too.
///
/// # Errors
/// Those of [`plan`].
pub(crate) fn plan_with(
    experiment: &Experiment,
    registry: &Registry,
    threads: usize,
    built: &mut Built,
) -> Result<Plan> {
    plan_stage(experiment, registry, threads, Stage::Main, Some(built))
}

/// Plans the passes of `stage`.
pub(super) fn plan_stage(
    experiment: &Experiment,
    registry: &Registry,
    threads: usize,
    stage: Stage,
    mut built: Option<&mut Built>,
) -> Result<Plan> {
    if !experiment.cells.is_empty() && experiment.file.budget.is_none() {
        return Err(Error::input_help(
            "the experiment has no budget",
            "give it one, as `budget.passes = 64`",
        ));
    }
    let known = shapes(experiment, threads, built.as_deref());
    let mut builder = Builder::new(experiment, &known);
    let bands = builder.bands().to_vec();
    let cells = cells(experiment, &mut builder)?;
    let scene_bytes = [builder.memory_bytes(), builder.building_bytes(threads)];
    if let Some(built) = &mut built {
        built.shapes.extend(builder.into_shapes());
    }
    let observables: Vec<Vec<Observable>> = cells.iter().map(|cell| named(&cell.layout)).collect();
    let scenes: Vec<&Scene> = cells.iter().map(|cell| &*cell.scene).collect();
    let mut refusals = Refusals::default();
    let comparisons = comparisons::expand(experiment, &bands, &observables, &scenes);
    let comparisons = refusals.keep("", comparisons)?;
    let are_claims_sound = comparisons.is_some();
    let comparisons = comparisons.unwrap_or_default();
    let inputs = json!(build::inputs(experiment));
    let planner = Planner { experiment, registry, bands: &bands, inputs, stage };
    let arms = Duels::new(experiment);
    let mut planned = Vec::new();
    for (index, cell) in cells.iter().enumerate() {
        let wanted = claimed(experiment, index, &comparisons).filter(|_| are_claims_sound);
        for (entry, words) in experiment.file.estimator.iter().enumerate() {
            if wanted.as_ref().is_some_and(|names| !names.contains(words.name.as_str())) {
                continue;
            }
            let targets = targets(index, &words.name, &comparisons, &observables[index]);
            let share = share(experiment, cell.spec, &words.name);
            let terms = BudgetTerms { targets, share, budget: cell.spec.budget.clone() };
            for arm in arms.of(cell.spec, &words.name) {
                planned.push(PlannedPasses { index, cell, entry, arm, terms: terms.clone() });
            }
        }
    }
    let mut jobs =
        planner.passes(planned, threads, built.map(|built| &mut built.estimators), &mut refusals)?;
    for index in 0..experiment.file.sampler.len() {
        jobs.extend(refusals.keep("", planner.draws(index))?);
    }
    refusals.none_in(cells.len())?;
    if jobs.is_empty() && experiment.file.only_claimed {
        let error = Error::input_help(
            "no claim names an estimator, and `only_claimed` leaves nothing to run",
            "claim something, or leave `only_claimed` out",
        );
        return Err(error.at(experiment.sources.place(0, "only_claimed")));
    }
    decidable::check(experiment, &comparisons, &jobs)?;
    let budgets =
        experiment.cells.iter().map(|cell| cell.budget.as_ref().or(experiment.file.budget.as_ref()));
    let passes = budgets.map(|budget| match budget {
        Some(Budget::Passes(passes)) => Some(*passes),
        _ => None,
    });
    let passes = passes.collect::<Option<Vec<u64>>>().and_then(|passes| passes.into_iter().max());
    Ok(Plan { jobs, comparisons, stage, scene_bytes, passes, bands })
}

/// A cell with its scene.
struct BuiltCell<'a> {
    spec: &'a CellSpec,
    scene: Arc<Scene>,
    layout: Layout,
}

/// Builds every cell: no two are the same scene, and none has more observables than a record holds.
fn cells<'a>(experiment: &'a Experiment, builder: &mut Builder) -> Result<Vec<BuiltCell<'a>>> {
    let mut known: BTreeMap<String, &str> = BTreeMap::new();
    let mut cells = Vec::new();
    let mut refusals = Refusals::default();
    for (index, spec) in experiment.cells.iter().enumerate() {
        if let Some(twin) = known.insert(hash_json(&spec.content()), &spec.label) {
            let error = Error::input_help(
                format!("cells `{twin}` and `{}` are the same scene", spec.label),
                "equal scenes run on equal streams, so neither is evidence about the other: drop one",
            );
            refusals.keep::<()>("", Err(error.at(experiment.sources.place(index, "sweep.0"))))?;
        }
        let Some(scene) = refusals.keep(&spec.label, builder.scene(index).map(Arc::new))? else {
            continue;
        };
        let layout = Layout::new(&scene);
        let count = layout.observables().len();
        if count > MOST_OBSERVABLES {
            let error = Error::input_help(
                format!("the sensor has {count} observables"),
                format!("a record holds at most {MOST_OBSERVABLES}; lower the number of bins"),
            );
            refusals
                .keep::<()>(&spec.label, Err(error.at(experiment.sources.place(index, "sensor"))))?;
        }
        cells.push(BuiltCell { spec, scene, layout });
    }
    refusals.none_in(experiment.cells.len())?;
    Ok(cells)
}

/// The shapes of an experiment, as far as they can be built: the rest is refused in the cells that it is of.
fn shapes(experiment: &Experiment, threads: usize, built: Option<&Built>) -> Shapes {
    let mut known = built.map(|built| built.shapes.clone()).unwrap_or_default();
    let new: Vec<ShapeWords> = build::shape_words(experiment)
        .into_iter()
        .filter(|words| !known.contains_key(&words.name))
        .collect();
    let shapes = in_parallel(threads, new.len(), |i| new[i].build(experiment).ok());
    let named = new.iter().zip(shapes).filter_map(|(words, shape)| Some((words.name.clone(), shape?)));
    known.extend(named);
    known
}

/// An estimator to be measured in a cell.
struct PlannedPasses<'a> {
    index: usize,
    cell: &'a BuiltCell<'a>,
    entry: usize,
    arm: Arm,
    terms: BudgetTerms,
}

/// Input common to every job of a plan.
struct Planner<'a> {
    experiment: &'a Experiment,
    registry: &'a Registry,
    bands: &'a [Band],
    /// Hashes of the files that the scenes read.
    inputs: Value,
    stage: Stage,
}

impl Planner<'_> {
    /// The jobs of what is planned: each with an estimator of its own, unless plans share what they build.
    fn passes(
        &self,
        planned: Vec<PlannedPasses>,
        threads: usize,
        shared: Option<&mut Estimators>,
        refusals: &mut Refusals,
    ) -> Result<Vec<Job>> {
        let name = |(i, one): (usize, &PlannedPasses)| match shared {
            Some(_) => self.name(one),
            None => i.to_string(),
        };
        let names: Vec<String> = planned.iter().enumerate().map(name).collect();
        let mut own = Estimators::new();
        let known = shared.unwrap_or(&mut own);
        let mut seen = BTreeSet::new();
        let is_new = |&i: &usize| !known.contains_key(&names[i]) && seen.insert(&names[i]);
        let new: Vec<usize> = (0..planned.len()).filter(is_new).collect();
        let made = in_parallel(threads, new.len(), |i| self.estimator(&planned[new[i]]));
        for (i, made) in new.into_iter().zip(made) {
            let made = refusals.keep(&planned[i].cell.spec.label, made)?;
            known.extend(made.map(|made| (names[i].clone(), made)));
        }
        // Without those that are refused.
        let job = |(one, name)| Some(self.job(one, known.get(name)?));
        Ok(planned.into_iter().zip(&names).filter_map(job).collect())
    }

    /// The passes of an estimator in a cell.
    fn job(&self, planned: PlannedPasses, (estimator, set_up): &(Arc<dyn Estimator>, Duration)) -> Job {
        let PlannedPasses { index, cell, entry, arm, terms } = planned;
        let (estimator, set_up) = (Arc::clone(estimator), SetUp::built(*set_up));
        let words = self.experiment.estimator(index, entry);
        let groups = band_groups(estimator.band_use(), self.bands.len()).into_iter();
        let groups = groups.map(|group| self.group(cell.spec, &arm.name, group)).collect();
        let label = match cell.spec.label.as_str() {
            "" => arm.name.clone(),
            cell => format!("{cell} / {}", arm.name),
        };
        let title = match cell.spec.axes.is_empty() {
            true => arm.name.clone(),
            false => format!("{} / {}", titled(&cell.spec.axes, &cell.spec.label), arm.name),
        };
        let file = &self.experiment.file;
        let identity = json!({
            "build": provenance::build(),
            "experiment": file.name,
            "seed": file.seed,
            "fresh": file.fresh,
            "stage": self.stage.name(),
            "bands": self.bands,
            "content": cell.spec.content(),
            "pair": file.pair,
            "inputs": self.inputs,
            "estimator": words,
            "control": arm.is_control,
        });
        let (stage, layout) = (self.stage, cell.layout.clone());
        let passes = Passes {
            cell: index,
            entry,
            arm,
            stage,
            count: None,
            part: None,
            estimator,
            set_up,
            layout,
            groups,
            terms,
        };
        let task = Task::Estimate(Box::new(passes));
        Job { label, title, identity: hash_json(&identity), task }
    }

    /// Name of an estimator in a cell: another for every scene, set of bands, kind and option.
    fn name(&self, planned: &PlannedPasses) -> String {
        let words = self.experiment.estimator(planned.index, planned.entry);
        let content = planned.cell.spec.content();
        hash_json(&json!([content, self.inputs, self.bands, words.kind]))
    }

    /// A new estimator in a cell, and the CPU time of building it.
    fn estimator(&self, planned: &PlannedPasses) -> Result<(Arc<dyn Estimator>, Duration)> {
        let PlannedPasses { index, cell, entry, .. } = *planned;
        let words = self.experiment.estimator(index, entry);
        let no_kind = || Error::input(format!("estimator `{}` has no kind", words.name));
        let (kind, options) = words.choice().ok_or_else(no_kind)?;
        let unknown = || Error::input(format!("estimator `{}`: unknown kind `{kind}`", words.name));
        let registered = self.registry.get(kind).ok_or_else(unknown)?;
        let before = thread_cpu_time();
        let estimator = (registered.build)(options, Arc::clone(&cell.scene)).map_err(|error| {
            let place = self.experiment.sources.place(index, &format!("estimator.{entry}.{kind}"));
            error.about(&format!("estimator `{}`", words.name)).at(place)
        })?;
        Ok((Arc::from(estimator), thread_cpu_time().saturating_sub(before)))
    }

    /// Bands that run together, with their streams.
    fn group(&self, cell: &CellSpec, estimator: &str, group: Vec<usize>) -> Group {
        let file = &self.experiment.file;
        let content = match &file.pair {
            Some(pair) => cell.content_without(&pair.over),
            None => cell.content(),
        };
        let names: Vec<&str> = group.iter().map(|&band| self.bands[band].name.as_str()).collect();
        let fresh = file.fresh.as_deref();
        let key = |stage| {
            let (experiment, seed) = (file.name.as_str(), file.seed);
            StreamName { experiment, seed, fresh, content: &content, bands: &names, estimator, stage }
                .key()
        };
        Group { main: key(self.stage), pilot: key(Stage::Pilot), bands: group }
    }

    /// The draws from a sampler.
    fn draws(&self, index: usize) -> Result<Job> {
        let file = &self.experiment.file;
        let words = &file.sampler[index];
        let (kind, sampler) = build_sampler(words, self.registry).map_err(|error| {
            let place = self.experiment.sources.place(0, &format!("sampler.{index}"));
            error.about(&format!("sampler `{}`", words.name)).at(place)
        })?;
        // Intentionally absent: the number of draws, claims, threads, the order of the file.
        let mut name = json!({
            "version": KEY_VERSION,
            "experiment": file.name,
            "sampler": words.name,
            "content": words.kind,
            "stage": self.stage.name(),
        });
        if let Some(seed) = file.seed {
            name["seed"] = json!(seed);
        }
        if let Some(fresh) = &file.fresh {
            name["fresh"] = json!(fresh);
        }
        let identity = json!({ "build": provenance::build(), "streams": name, "index": index });
        let draws = Draws {
            index,
            name: words.name.clone(),
            kind: kind.to_string(),
            sampler,
            samples: file.samples.unwrap_or_default(),
            key: StreamKey::new(hash_bytes(canonical(&name).as_bytes())),
        };
        let (label, identity) = (words.name.clone(), hash_json(&identity));
        Ok(Job { title: label.clone(), label, identity, task: Task::Draw(Box::new(draws)) })
    }
}

/// The kind of a sampler, and the sampler.
fn build_sampler<'a>(
    words: &'a SamplerEntry,
    registry: &Registry,
) -> Result<(&'a str, Box<dyn Sampler>)> {
    let no_kind = || Error::input(format!("sampler `{}` has no kind", words.name));
    let (kind, options) = words.choice().ok_or_else(no_kind)?;
    let unknown = || Error::input(format!("sampler `{}`: unknown kind `{kind}`", words.name));
    let registered = registry.samplers.iter().find(|known| known.kind == kind).ok_or_else(unknown)?;
    Ok((kind, (registered.build)(options)?))
}

/// Claims of efficiency by CPU time: their baselines run twice, on streams of their own, because the same
/// estimator against itself shows whether clock and jackknife can be trusted.
struct Duels(Vec<Faster>);

impl Duels {
    fn new(experiment: &Experiment) -> Duels {
        let duels = experiment.file.claim.iter().filter_map(ClaimEntry::duel);
        Duels(duels.filter(|duel| duel.cost == CostMeasure::Cpu).collect())
    }

    /// The runs of an estimator in a cell.
    fn of(&self, cell: &CellSpec, name: &str) -> Vec<Arm> {
        let mut here = self.0.iter().filter(|duel| comparisons::is_in(cell, &duel.only));
        let mut arms = vec![Arm { name: name.into(), is_control: false }];
        if here.any(|duel| duel.baseline == name) {
            arms.push(Arm { name: format!("{name}{CONTROL}"), is_control: true });
        }
        arms
    }
}

/// A layout's observables as the record names them.
pub(super) fn named(layout: &Layout) -> Vec<Observable> {
    let name = |o: &crate::estimators::ObservableName| Observable {
        name: o.name.clone(),
        class: o.class.to_string(),
    };
    layout.observables().iter().map(name).collect()
}

/// The estimators that claims name in a cell, where no others run.
fn claimed<'a>(
    experiment: &Experiment,
    cell: usize,
    comparisons: &'a [Comparison],
) -> Option<BTreeSet<&'a str>> {
    let quantities = comparisons.iter().flat_map(|comparison| {
        let other = match &comparison.against {
            Against::Value { .. } => None,
            Against::Quantity { other, .. } => Some(other),
            Against::Efficiency { baseline, .. } => Some(baseline),
        };
        [Some(&comparison.quantity), other]
    });
    let here = quantities.flatten().filter(|quantity| quantity.cell == cell);
    experiment.file.only_claimed.then(|| here.map(|quantity| quantity.estimator.as_str()).collect())
}

/// The multiple of the budget that an estimator takes in a cell.
fn share(experiment: &Experiment, cell: &CellSpec, estimator: &str) -> f64 {
    let shares = experiment.file.budget_share.iter();
    let of_estimator = |names: &[String]| names.is_empty() || names.iter().any(|name| name == estimator);
    let mine = shares.filter(|row| comparisons::is_in(cell, &row.only) && of_estimator(&row.estimators));
    mine.map(|row| row.share).product()
}

/// The observables that claims name of an estimator in a cell; the sensor's first where none does.
fn targets(
    cell: usize,
    estimator: &str,
    comparisons: &[Comparison],
    observables: &[Observable],
) -> Vec<usize> {
    let claimed = comparisons.iter().map(|comparison| &comparison.quantity);
    let mine = claimed.filter(|q| q.cell == cell && q.estimator == estimator);
    let mut indices: Vec<usize> =
        mine.filter_map(|q| observables.iter().position(|o| *o == q.observable)).collect();
    indices.sort_unstable();
    indices.dedup();
    if indices.is_empty() { vec![0] } else { indices }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::{self, LoadOptions};

    /// Plans share estimators of one scene in the same bands by the same options, and no others.
    #[test]
    fn plans_share_what_is_the_same() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/experiments/compare/nine-cells.toml");
        let registry = Registry::builtin();
        let mut built = Built::default();
        let mut estimators = |set: &str| -> Vec<Arc<dyn Estimator>> {
            let options = LoadOptions { sets: vec![set.into()], setting: None };
            let experiment =
                experiment::load(file.as_ref(), &options, &registry).expect("an experiment");
            let plan = plan_with(&experiment, &registry, 2, &mut built).expect("a plan");
            plan.jobs.iter().filter_map(Job::passes).map(|passes| passes.estimator.clone()).collect()
        };
        let first = estimators("budget.passes=2");
        let is_shared = |other: &Arc<dyn Estimator>| first.iter().any(|one| Arc::ptr_eq(one, other));
        assert!(estimators("budget.passes=3").iter().all(is_shared), "another budget");
        for set in [
            "bands={ rgb = {} }",
            "object.medium.coefficients={ sigma_t_per_mm = 3, albedo = 0.5, g = 0 }",
            "object.shape.sphere.radius_mm=1.5",
            "estimator.0.path.roulette={ analog = {} }",
            "sensor.orthographic.resolution=[4,4]",
        ] {
            let others = estimators(set);
            assert!(!others.is_empty() && !others.iter().any(is_shared), "{set}");
        }
    }
}
