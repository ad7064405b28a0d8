//! The record, which a campaign writes and which is the only input of verification and reports. It is
//! byte-identical for any number of threads, any block size, and after any kill and resume.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::sampler::SamplerRun;

/// Version of this layout; a reader refuses others.
pub const SCHEMA_VERSION: u32 = 4;

/// `record.json`: everything except the arrays, which are in `.npy` files beside it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// [`SCHEMA_VERSION`] of the writer.
    pub schema_version: u32,
    /// The experiment's name.
    pub experiment: String,
    /// `main`, or `retest` for a second look on new streams.
    pub stage: String,
    /// What determines the bits: numerical version, crates, target (see `results::provenance`).
    pub fingerprint: String,
    /// blake3 of the resolved experiment without claims, hex.
    pub experiment_hash: String,
    /// The resolved experiment without claims: every value that was used, defaults included.
    pub resolved: serde_json::Value,
    /// blake3 of `claims`, hex.
    pub claims_hash: String,
    /// The claims as the file states them.
    pub claims: serde_json::Value,
    /// Statement of each of `claims`, in their order.
    pub statements: Vec<Claim>,
    /// Indices of claims that were changed or added when passes had already been run: they are not
    /// evidence.
    pub post_hoc: Vec<usize>,
    /// The claims expanded over cells, bands and tables, with the values they are compared with.
    pub comparisons: Vec<Comparison>,
    /// The claims on samplers expanded: one entry for each sampler that a claim speaks of.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sampler_comparisons: Vec<SamplerComparison>,
    /// Passes run again for `reproduces` claims.
    pub replays: Vec<Replay>,
    /// The bands, in the order of every array's band axis.
    pub bands: Vec<Band>,
    /// The cells in the order of the sweep.
    pub cells: Vec<Cell>,
    /// Counts of each sampler.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub samplers: Vec<SamplerRun>,
    /// blake3 of every array file, hex, by its path relative to the record's folder.
    pub checksums: BTreeMap<String, String>,
}

/// The first passes of one measurement, run again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Replay {
    /// Index into [`Record::cells`].
    pub cell: usize,
    /// Estimator name.
    pub estimator: String,
    /// Passes that were run again.
    pub passes: u64,
    /// blake3 of their moments as recorded, hex.
    pub recorded: String,
    /// blake3 of the moments of the second run, hex.
    pub replayed: String,
}

/// One wavelength interval.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Band {
    /// `R`, `G`, `B`, `400-420nm`, or the name an explicit list gives.
    pub name: String,
    /// Lower and upper wavelength, nm, where the experiment states them.
    pub range_nm: Option<[f64; 2]>,
    /// Linear sRGB (D65) in which one unit of this band's radiance is displayed.
    pub display_rgb: [f64; 3],
}

/// One point of the sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cell {
    /// The axes' labels joined by `,`; empty where there is no sweep.
    pub label: String,
    /// Sweep axis -> this cell's label on it.
    pub axes: BTreeMap<String, String>,
    /// blake3 of the cell's physics in canonical form, hex.
    pub content_hash: String,
    /// The regions of the sensor, after which observables are named.
    pub regions: Vec<ObservedRegion>,
    /// Measurement of each estimator in this cell.
    pub runs: Vec<EstimatorRun>,
}

/// A cell by its place on the axes of the sweep, as `alpha = 0.1, g = 0.8`; the label itself where there is
/// no sweep.
pub(crate) fn titled(axes: &BTreeMap<String, String>, label: &str) -> String {
    let words: Vec<String> = axes.iter().map(|(axis, label)| format!("{axis} = {label}")).collect();
    if words.is_empty() { label.into() } else { words.join(", ") }
}

impl Cell {
    /// Its place on the axes of the sweep, for people.
    pub(crate) fn title(&self) -> String {
        titled(&self.axes, &self.label)
    }

    /// The region that an observable measures with all lights together; none for one light's share of a
    /// region.
    pub fn region_of(&self, observable: &Observable) -> Option<&ObservedRegion> {
        self.regions.iter().find(|region| region.name == observable.name)
    }
}

/// A region of a sensor.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObservedRegion {
    /// The name of its observables; that of one light's share has `@light` appended.
    pub name: String,
    /// Which part of an image it is the mean of; none where that is the whole, or where there is no
    /// image.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tile: Option<Tile>,
}

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tile {
    /// First column, and the one after the last.
    pub columns: [usize; 2],
    /// First row, and the one after the last.
    pub rows: [usize; 2],
}

impl ObservedRegion {
    /// The indices of its pixels, row by row, in an image of this size.
    pub fn pixels(&self, width: usize, height: usize) -> Vec<usize> {
        let whole = Tile { columns: [0, width], rows: [0, height] };
        let Tile { columns, rows } = self.tile.unwrap_or(whole);
        let row = |row: usize| (columns[0]..columns[1]).map(move |column| row * width + column);
        (rows[0]..rows[1]).flat_map(row).collect()
    }
}

/// One estimator's measurement of one cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EstimatorRun {
    /// The name the experiment gives it.
    pub estimator: String,
    /// The estimator of which this is a second arm, for comparisons of CPU time: the same estimator on separate
    /// streams, so that the two differ only by chance and by noise of the machine.
    pub control_of: Option<String>,
    /// Its kind, as `path`.
    pub kind: String,
    /// How its mean is related to the integral.
    pub bias: StatedBias,
    /// The model whose integral it estimates; none where it is light transport itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
    /// The bands and classes in which its mean is known beforehand to be far from normal.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub heavy_tails: Vec<StatedTail>,
    /// Notes for the reader, such as transport that it cannot sample.
    pub notes: Vec<String>,
    /// Number of independent passes.
    pub passes: u64,
    /// The observables, in the order of the observables array's observable axis.
    pub observables: Vec<Observable>,
    /// Path of the moments of the observables, `[batch][observable][band][5]` f64: count, mean, and the
    /// sums of second, third and fourth powers of deviations from the mean.
    pub moments: String,
    /// Path of the counts of work, `[batch][counter]` f64: the batches of `moments`, the counters in the
    /// order of `cost`'s names. Their sums over batches are `cost`.
    pub costs: String,
    /// The image, where the sensor has pixels.
    pub image: Option<Image>,
    /// The guide of its walks, if they are guided.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub guide: Option<GuidePlane>,
    /// Deterministic counts of work done, summed over bands and passes.
    pub cost: BTreeMap<String, u64>,
    /// Counts of anomalies, by name (`nonfinite`, `lost_ray`, `wrong_side`).
    pub anomalies: BTreeMap<String, u64>,
}

/// Scores whose sample mean has no valid interval.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StatedTail {
    /// Index into [`Record::bands`].
    pub band: usize,
    /// In this class, and in `all`.
    pub class: String,
    /// Why the mean has no valid interval.
    pub reason: String,
}

/// How an estimator's mean is related to the integral.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StatedBias {
    /// The expectation is the integral.
    Unbiased,
    /// The expectation tends to the integral as passes grow.
    Consistent,
    /// The expectation differs, for this reason.
    Biased(String),
}

/// A quantity that claims and tables speak of.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Observable {
    /// `mean`, `tile_0_3`, `probe`, `top_0`, ...; with `@light` appended for one light's share.
    pub name: String,
    /// `all`, or a transport class: `surface`, `single`, `single_internal`, `multiple`,
    /// `multiple_internal`.
    pub class: String,
}

/// The observable of claims of efficiency that denotes all pixels at once: its variance is that of a
/// pixel, averaged over the pixels. It has no mean; that of the sensor's first observable is reported
/// for it.
pub const PIXELS: &str = "pixels";

impl Observable {
    /// [`PIXELS`], of all classes together: images are not kept by class.
    pub fn pixels() -> Observable {
        Observable { name: PIXELS.into(), class: "all".into() }
    }

    /// Whether this is [`Observable::pixels`].
    pub fn is_pixels(&self) -> bool {
        self.name == PIXELS
    }
}

/// The guide of the walks of a run, in the plane of x and z through the middle of the body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GuidePlane {
    /// The x that it reaches from and to, mm.
    pub x_mm: [f64; 2],
    /// The z that it reaches from and to, mm.
    pub z_mm: [f64; 2],
    /// Path of the `[band][row][column][3]` f64 array, rows from the largest z down: importance over its largest (0 outside,
    /// where nothing is known, and in bands without a guide), and its growth per mean free path along x and z.
    pub array: String,
}

/// The pixel arrays of one run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Image {
    /// Pixels per row.
    pub width: usize,
    /// Rows, from the top.
    pub height: usize,
    /// Path of the `[2][row][column][band]` f64 array: mean over passes, and its standard error.
    pub pixels: String,
    /// Path of the `[batch][band][5]` f64 array: the moments, as of `moments`, of half the squared
    /// difference of passes 2i and 2i + 1, averaged over the pixels. Its mean is the variance of a pixel
    /// in one pass, averaged over the pixels. The batches are those of `moments`, but at least 2 passes
    /// each; a last pass without a partner is in none.
    pub spread: String,
}

/// Which number of a record: one band of one observable of one estimator in one cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Quantity {
    /// Index into [`Record::cells`].
    pub cell: usize,
    /// Estimator name.
    pub estimator: String,
    /// Observable that is measured.
    pub observable: Observable,
    /// Index into [`Record::bands`].
    pub band: usize,
}

/// What a claim states.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Claim {
    /// Its name, or its kind and place in the file.
    pub label: String,
    /// Kind of statement.
    pub kind: ClaimKind,
    /// The outcome that makes it green.
    pub expects: ExpectedOutcome,
    /// It speaks of each class or observable that there is: some may be dark.
    pub each: bool,
}

/// Kinds of statements that claims make.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ClaimKind {
    /// A quantity equals a known value.
    Equals,
    /// Two measurements of one integral agree.
    Agree,
    /// Two measurements differ.
    Differs,
    /// The record is reproduced bit for bit.
    Reproduces {
        /// The checksum that the record's numbers must have.
        numbers: Option<String>,
    },
    /// A sampler draws from the density that it states.
    Sampler,
    /// An estimator is more efficient than another.
    Faster,
    /// An estimator is not much less efficient than another.
    NotSlower,
}

impl ClaimKind {
    /// As an experiment file calls it.
    pub fn name(&self) -> &'static str {
        match self {
            ClaimKind::Equals => "equals",
            ClaimKind::Agree => "agree",
            ClaimKind::Differs => "differs",
            ClaimKind::Reproduces { .. } => "reproduces",
            ClaimKind::Sampler => "sampler",
            ClaimKind::Faster => "faster",
            ClaimKind::NotSlower => "not_slower",
        }
    }
}

/// The outcome that makes a claim green; any except a pass makes it a control.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ExpectedOutcome {
    /// The claim holds.
    Pass,
    /// The test finds a difference.
    Differs,
    /// The claim is found not to hold.
    Fails,
    /// The test is refused as statistically invalid, for this reason and no other.
    Invalid(InvalidReason),
}

/// Reasons for which a test of means is refused and that a control may expect. Any other reason that makes a
/// test invalid, such as lost rays or missing passes, is a defect and makes no control green.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum InvalidReason {
    /// The scores have a heavy tail: known beforehand, or by their skewness, or by one batch's share.
    HeavyTail,
    /// The mean rests on fewer passes than the test needs.
    TooFewPasses,
    /// An estimator states a bias and is claimed to agree.
    Biased,
    /// The estimators estimate different integrals.
    DifferentModels,
    /// Neither side scored anything.
    NothingScored,
}

impl InvalidReason {
    /// As a phrase.
    pub fn words(self) -> &'static str {
        match self {
            InvalidReason::HeavyTail => "heavy tail",
            InvalidReason::TooFewPasses => "too few passes",
            InvalidReason::Biased => "bias",
            InvalidReason::DifferentModels => "different models",
            InvalidReason::NothingScored => "nothing scored",
        }
    }
}

/// A sampler that a claim speaks of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SamplerComparison {
    /// Index of the claim in the file.
    pub claim: usize,
    /// The sampler's name.
    pub sampler: String,
    /// The largest relative error of the density that coarse bins may miss; a weaker test is
    /// underpowered.
    pub detect: Option<f64>,
    /// The same for fine bins.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub detect_fine: Option<f64>,
    /// The same for bins of pairs of consecutive draws.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub detect_serial: Option<f64>,
}

/// One elementary statement of a claim.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Comparison {
    /// Index of the claim in the file.
    pub claim: usize,
    /// The number under test.
    pub quantity: Quantity,
    /// What it is compared with.
    pub against: Against,
    /// The largest relative defect that may go unseen; a coarser test is underpowered.
    pub detect: Option<f64>,
}

/// What a quantity is compared with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Against {
    /// A published or computed value with its stated error (one standard error; 0 = exact).
    Value {
        /// Expected value.
        value: f64,
        /// Stated error of the expected value.
        error: f64,
        /// Where it comes from.
        source: String,
    },
    /// Another quantity of this record.
    Quantity {
        /// The other quantity.
        other: Quantity,
        /// True where both were run on the same random streams, pass by pass.
        paired: bool,
    },
    /// Another estimator of the same integral, by efficiency: the baseline's variance times cost over
    /// this quantity's must exceed a bound.
    Efficiency {
        /// The same quantity of the baseline.
        baseline: Quantity,
        /// The bound of the ratio.
        exceeds: f64,
        /// Measure of cost.
        cost: CostMeasure,
    },
}

/// The measure of an estimator's work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CostMeasure {
    /// Counts of rays, events and paths with fixed weights: the same on every machine.
    #[default]
    Counters,
    /// CPU time. The estimators of a cell are interleaved, and the baseline is run twice, to measure effects of
    /// the machine.
    Cpu,
}
