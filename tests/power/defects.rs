//! The catalogue of planted defects: where each is planted, and which tests are expected to see it.

use std::sync::OnceLock;

use super::{acceptance, cloud};

/// Defects that can be planted. Every place that can hold a defect tests for its own by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Defect {
    /// Nothing: the sham, which must be green.
    None,
    CosineMissing,
    EtaSquaredMissingInEval,
    EtaSquaredMissingOnEntry,
    EtaSquaredMissingBothWays,
    EtaInvertedInHalfVector,
    FresnelSideSwapped,
    ReflectionJacobian,
    SampleCountMissing,
    LightChoiceMissing,
    LightForgotten,
    MisOmitsInterface,
    MisSampleCountWrong,
    FlightDensity,
    RouletteUncompensated,
    ContributionClamped,
    PhaseFlipped,
    PhaseNormalisation,
    FailuresRedrawn,
    TotalReflectionDropped,
    DepthCutOff,
    ShadingNormal,
    ShadowIgnored,
    AbsoluteEpsilon,
    SinglePrecision,
    PathDropped,
    PathTwice,
    PassesShareStream,
    PurposesShareStream,
    OtherBand,
    BandMissing,
    SineMissing,
    EnvironmentScaled,
    NotANumber,
    ClassesSwapped,
    ScoresScaled,
    EmissionAfterAlbedo,
    EmissionPerAbsorption,
    EmissionOfFirstBand,
    // Subdivision next-event estimation.
    ReverseIndex,
    JacobianMissing,
    EscapeDensity,
    ProbeCosineOfLast,
    ProbeCosineMissing,
    WrongDistance,
    RadianceEtaSquaredMissing,
    SelectionMissing,
    SelectionInBottom,
    SurvivalMissing,
    FailedEndsRedrawn,
    FirstHitIgnored,
    TruncatedTop,
    TruncatedBottom,
    CallChanceMissing,
    MisOmitsBottom,
    ShadingCosineAtExit,
    // Samplers.
    DensityTilted,
    DensityDoubled,
    SamplerFlipped,
    DrawFlipped,
    Untruncated,
    ShareMissing,
    BoundSign,
    Unnormalised,
    ComponentDensity,
    LobeNumberReused,
    MassOff,
    DeltaLeaks,
    NullsRedrawn,
    SamplerSineMissing,
    NeighboursAlike,
    RefractionOtherIndex,
    RefractionOtherCosine,
    PlaneCosineMissing,
    BounceAzimuthMirrored,
    BounceThetaOff,
    // Acceptance of points by distance.
    ExponentOff,
    WeightClamped,
    WeightOfMean,
    CoarseUniform,
    BoundAtCentre,
    SharedNumber,
    GapFromOne,
    // The point-cloud method.
    FaceCountMissing,
    ExitTwice,
    EntryTwice,
    MeanWeighsBand,
    NoReweighting,
    CloudClamped,
    // The verifier.
    VarianceByDifference,
    DeviationForError,
    OneSided,
    PixelsForPasses,
}

/// Where a defect is planted, and so what is run to find it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// In the path tracer.
    Tracer,
    /// In subdivision next-event estimation.
    Subdivision,
    /// In a sampler of the catalogue.
    Sampler,
    /// In the acceptance of points by distance.
    Acceptance,
    /// In the point-cloud method.
    Cloud,
    /// In the verifier's arithmetic.
    Verifier,
    /// In no part: a control.
    Sham,
}

/// One row of the catalogue.
#[derive(Clone, Copy, Debug)]
pub struct Planted {
    /// Its name on the command line and in tables.
    pub name: &'static str,
    /// Defect that is planted.
    pub defect: Defect,
    /// Part of the program that it is planted in.
    pub family: Family,
    /// Description of the defect, in one line.
    pub what: &'static str,
    /// The tests, `experiment.claim`, `samplers.TEST` or `identity NAME`, of which each is expected to
    /// see it.
    pub expected: &'static [&'static str],
}

/// A row of the tracer's.
pub const fn row(
    name: &'static str,
    defect: Defect,
    what: &'static str,
    expected: &'static [&'static str],
) -> Planted {
    Planted { name, defect, family: Family::Tracer, what, expected }
}

/// The same of another family.
pub const fn of(family: Family, row: Planted) -> Planted {
    Planted { family, ..row }
}

/// Every defect of the path tracer.
pub const TRACER: &[Planted] = &[
    row(
        "cosine-missing",
        Defect::CosineMissing,
        "light samples at a rough surface lack the cosine",
        &["rough.sun", "identity sample-weight"],
    ),
    row(
        "eta2-missing-in-eval",
        Defect::EtaSquaredMissingInEval,
        "the value of rough refraction lacks radiance's eta^2, its sampling has it",
        &["rough.sun", "identity reciprocity", "identity sample-weight"],
    ),
    row(
        "eta2-missing-on-entry",
        Defect::EtaSquaredMissingOnEntry,
        "refraction into the body lacks radiance's eta^2, refraction out of it has it",
        &["furnace.smooth", "slab.UR1", "slab.UT1", "rough.sun", "identity reciprocity"],
    ),
    row(
        "eta2-missing-both-ways",
        Defect::EtaSquaredMissingBothWays,
        "radiance's eta^2 is missing at every refraction: it cancels for a sensor and a light outside",
        &["identity reciprocity"],
    ),
    row(
        "eta-inverted",
        Defect::EtaInvertedInHalfVector,
        "the half vector of rough refraction is made with 1/eta",
        &["rough.sun", "identity sample-density"],
    ),
    row(
        "fresnel-side-swapped",
        Defect::FresnelSideSwapped,
        "reflectance is computed with the index of the other side",
        &["slab.UR1", "slab.UT1", "rough.sun", "identity fresnel"],
    ),
    row(
        "reflection-jacobian",
        Defect::ReflectionJacobian,
        "the density of rough refraction has reflection's Jacobian 1 / (4 w.h)",
        &["rough.sun", "identity sample-density"],
    ),
    row(
        "sample-count-missing",
        Defect::SampleCountMissing,
        "two light samples a vertex are added up, not averaged",
        &["rough.sun", "matched.sun"],
    ),
    row(
        "light-choice-missing",
        Defect::LightChoiceMissing,
        "light samples are not divided by the probability of the light",
        &["rough.sun", "rough.lamp", "matched.sun"],
    ),
    row(
        "light-forgotten",
        Defect::LightForgotten,
        "the last light is never chosen",
        &["rough.lamp", "matched.sky"],
    ),
    row(
        "mis-omits-interface",
        Defect::MisOmitsInterface,
        "the MIS denominator of light samples lacks the interface's (the phase function's) density",
        &["rough.lamp", "matched.sky", "furnace.matched"],
    ),
    row(
        "mis-sample-count",
        Defect::MisSampleCountWrong,
        "MIS weights interface samples as if one light sample were drawn, not two",
        &["rough.lamp", "matched.sky", "furnace.matched"],
    ),
    row(
        "flight-density",
        Defect::FlightDensity,
        "a flight to the boundary has the density sigma_t T in MIS, not the probability T",
        &["furnace.matched"],
    ),
    row(
        "roulette-uncompensated",
        Defect::RouletteUncompensated,
        "survivors of roulette are not divided by their probability",
        &["slab.UR1", "rough.multiple"],
    ),
    row(
        "contribution-clamped",
        Defect::ContributionClamped,
        "no contribution is above a third of the light's strength",
        &["rough.sun"],
    ),
    row(
        "phase-flipped",
        Defect::PhaseFlipped,
        "the phase function scatters about -g",
        &["slab.UR1", "matched.single"],
    ),
    row(
        "phase-normalisation",
        Defect::PhaseNormalisation,
        "the phase function's density has 1/(2 pi) for 1/(4 pi)",
        &["matched.sun", "furnace.matched"],
    ),
    row(
        "failures-redrawn",
        Defect::FailuresRedrawn,
        "microfacet samples that fail are drawn again",
        &["sky.sphere"],
    ),
    row(
        "tir-dropped",
        Defect::TotalReflectionDropped,
        "totally reflected paths end",
        &["furnace.smooth", "slab.UR1"],
    ),
    row("depth-cut-off", Defect::DepthCutOff, "paths end after 32 scattering events", &["slab.UT1"]),
    row(
        "shading-normal",
        Defect::ShadingNormal,
        "the side of a direction is asked of the shading normal alone",
        &["sky.bumpy"],
    ),
    row(
        "shadow-ignored",
        Defect::ShadowIgnored,
        "light samples are not tested for occlusion by the body",
        &["sky.cavity"],
    ),
    row(
        "absolute-epsilon",
        Defect::AbsoluteEpsilon,
        "rays start 1e-4 mm off their surface",
        &["scale.same"],
    ),
    row("single-precision", Defect::SinglePrecision, "scores add up in f32", &["furnace.smooth"]),
    row("path-dropped", Defect::PathDropped, "one path a pass is not scored", &["furnace.smooth"]),
    row("path-twice", Defect::PathTwice, "one path a pass is scored twice", &["furnace.smooth"]),
    row(
        "passes-share-stream",
        Defect::PassesShareStream,
        "every pass has the random numbers of the first",
        &["rough.sun", "slab.UR1"],
    ),
    row(
        "purposes-share-stream",
        Defect::PurposesShareStream,
        "light samples have the random numbers of the walk: a short flight chooses the sun",
        &["matched.single"],
    ),
    row("other-band", Defect::OtherBand, "every band has the albedo of the first", &["rough.multiple"]),
    row("band-missing", Defect::BandMissing, "the last of several bands is not traced", &["rough.sun"]),
    row(
        "sine-missing",
        Defect::SineMissing,
        "the density of a latitude-longitude map lacks its sine",
        &["map.sky"],
    ),
    row(
        "environment-scaled",
        Defect::EnvironmentScaled,
        "light that a path meets by itself counts 0.1 % too much",
        &["furnace.smooth"],
    ),
    row(
        "not-a-number",
        Defect::NotANumber,
        "one path in a thousand scores NaN",
        &["rough.sun", "slab.UR1"],
    ),
    row(
        "scores-scaled",
        Defect::ScoresScaled,
        "every score is 5 % too high: as much as furnace.matched claims to detect",
        &["furnace.matched", "furnace.smooth"],
    ),
    row(
        "classes-swapped",
        Defect::ClassesSwapped,
        "single and multiple scattering change names",
        &["rough.single", "rough.multiple", "matched.single"],
    ),
    row(
        "emission-after-albedo",
        Defect::EmissionAfterAlbedo,
        "emission is scored with the albedo of its collision",
        &["emission.a", "emission.b"],
    ),
    row(
        "emission-per-absorption",
        Defect::EmissionPerAbsorption,
        "emission at collisions is divided by sigma_a for sigma_t",
        &["emission.a", "emission.b"],
    ),
    row(
        "emission-of-first-band",
        Defect::EmissionOfFirstBand,
        "every band has the emission of the first",
        &["emission.b"],
    ),
];

/// Every defect of subdivision next-event estimation.
pub const SUBDIVISION: &[Planted] = &[
    subdivision(
        "snee-reverse-index",
        Defect::ReverseIndex,
        "the density of refraction into the medium has n1^2 for n2^2",
        &["alone.rough sky", "identity entry-density"],
    ),
    subdivision(
        "snee-jacobian-missing",
        Defect::JacobianMissing,
        "a smooth surface's density of refraction into the medium lacks dw_L / dw_kj",
        &["alone.smooth sky", "subdivision.smooth sun"],
    ),
    subdivision(
        "snee-escape-density",
        Defect::EscapeDensity,
        "the flight to the boundary has the density sigma_t T, not the probability T",
        &["alone.rough sky"],
    ),
    subdivision(
        "snee-probe-cosine-of-last",
        Defect::ProbeCosineOfLast,
        "the density of x_k from x_i has the cosine of w_jk for that of w_ik",
        &["subdivision.smooth sun"],
    ),
    subdivision(
        "snee-probe-cosine-missing",
        Defect::ProbeCosineMissing,
        "the density of x_k from x_i lacks its cosine",
        &["alone.rough sky"],
    ),
    subdivision(
        "snee-wrong-distance",
        Defect::WrongDistance,
        "the density of top to bottom has 1 / d_ij^2 for 1 / d_jk^2",
        &["alone.rough sky"],
    ),
    subdivision(
        "snee-eta2-missing",
        Defect::RadianceEtaSquaredMissing,
        "the integrand lacks radiance's eta^2 at the exit, whoever draws",
        &["subdivision.rough sky", "identity exit-value"],
    ),
    subdivision(
        "snee-selection-missing",
        Defect::SelectionMissing,
        "the density of interface samples lacks 1 - F, the chance of refraction",
        &["alone.rough sky"],
    ),
    subdivision(
        "snee-selection-in-bottom",
        Defect::SelectionInBottom,
        "the density of bottom to top has 1 - F, where refraction is forced",
        &["alone.rough sky"],
    ),
    subdivision(
        "snee-survival-missing",
        Defect::SurvivalMissing,
        "the densities of interface and light samples lack the survival of roulette",
        &["alone.rough sky"],
    ),
    subdivision(
        "snee-failures-redrawn",
        Defect::FailedEndsRedrawn,
        "samples from the bottom to the top that fail are drawn again",
        &["alone.rough sky"],
    ),
    subdivision(
        "snee-first-hit-ignored",
        Defect::FirstHitIgnored,
        "where x_i does not see x_k, calls have a density all the same",
        &["bumpy.all"],
    ),
    subdivision(
        "snee-truncated-top",
        Defect::TruncatedTop,
        "distances from x_k end in the body, their density does not",
        &["alone.rough sky"],
    ),
    subdivision(
        "snee-truncated-bottom",
        Defect::TruncatedBottom,
        "distances from x_i end in the body, their density does not",
        &["alone.rough sky"],
    ),
    subdivision(
        "snee-call-chance-missing",
        Defect::CallChanceMissing,
        "the densities of a call lack the chance of a call",
        &["alone.rough sky"],
    ),
    subdivision(
        "snee-mis-omits-bottom",
        Defect::MisOmitsBottom,
        "the MIS denominator lacks the density of bottom to top",
        &["bumpy.all"],
    ),
    subdivision(
        "snee-shading-cosine",
        Defect::ShadingCosineAtExit,
        "the cosine of w_jk at the exit, a matter of area, is that to the shading normal",
        &["bumpy.all"],
    ),
];

const fn subdivision(
    name: &'static str,
    defect: Defect,
    what: &'static str,
    expected: &'static [&'static str],
) -> Planted {
    of(Family::Subdivision, row(name, defect, what, expected))
}

/// Every defect of a sampler.
pub const SAMPLERS: &[Planted] = &[
    sampler(
        "density-tilted",
        Defect::DensityTilted,
        "a density is off by the claim's `detect`",
        &["samplers.chi2 coarse"],
    ),
    sampler(
        "density-doubled",
        Defect::DensityDoubled,
        "1/(2 pi) for 1/(4 pi) in a phase function",
        &["samplers.identity D7"],
    ),
    sampler(
        "sampler-flipped",
        Defect::SamplerFlipped,
        "draws and density are those of -g",
        &["samplers.contrast mean cosine"],
    ),
    sampler(
        "draw-flipped",
        Defect::DrawFlipped,
        "draws are those of -g",
        &["samplers.chi2 coarse", "samplers.contrast mean cosine"],
    ),
    sampler(
        "untruncated",
        Defect::Untruncated,
        "draws go beyond the end that the density has",
        &["samplers.outside"],
    ),
    sampler(
        "share-missing",
        Defect::ShareMissing,
        "a truncated density is not divided by its share",
        &["samplers.identity D7"],
    ),
    sampler(
        "bound-sign",
        Defect::BoundSign,
        "the sign of an equiangular bound is wrong",
        &["samplers.chi2 coarse", "samplers.identity D7"],
    ),
    sampler(
        "unnormalised",
        Defect::Unnormalised,
        "equiangular draws along a direction 1.1 long",
        &["samplers.chi2 coarse"],
    ),
    sampler(
        "component-density",
        Defect::ComponentDensity,
        "a lobe's density is told for the mixture's",
        &["samplers.identity D5"],
    ),
    sampler(
        "lobe-number-reused",
        Defect::LobeNumberReused,
        "the number that chose a lobe is not rescaled",
        &["samplers.chi2 coarse"],
    ),
    sampler(
        "mass-off",
        Defect::MassOff,
        "a delta lobe is drawn 10 % too often",
        &["samplers.delta delta"],
    ),
    sampler(
        "delta-leaks",
        Defect::DeltaLeaks,
        "a delta lobe's mass leaks into the density",
        &["samplers.identity D7"],
    ),
    sampler("nulls-redrawn", Defect::NullsRedrawn, "failed draws are drawn again", &["samplers.null"]),
    sampler(
        "sampler-sine-missing",
        Defect::SamplerSineMissing,
        "theta is uniform, the density is not",
        &["samplers.chi2 coarse", "samplers.contrast cos^2"],
    ),
    sampler(
        "neighbours-alike",
        Defect::NeighboursAlike,
        "every other draw nearly repeats the last",
        &["samplers.serial"],
    ),
    sampler(
        "refraction-index",
        Defect::RefractionOtherIndex,
        "the density of refraction has the squared index of the known side, not of the sampled one",
        &["samplers.identity D7"],
    ),
    sampler(
        "refraction-cosine",
        Defect::RefractionOtherCosine,
        "the density of refraction has the cosine of the sampled side, not of the known one",
        &["samplers.identity D7", "samplers.chi2 coarse"],
    ),
    sampler(
        "plane-cosine-missing",
        Defect::PlaneCosineMissing,
        "an area's density becomes one of directions without the cosine",
        &["samplers.identity D7"],
    ),
    sampler(
        "bounce-azimuth",
        Defect::BounceAzimuthMirrored,
        "a table's azimuth is drawn from the far side of the plane of arrival",
        &["samplers.chi2 coarse"],
    ),
    sampler(
        "bounce-theta",
        Defect::BounceThetaOff,
        "the density of theta is 1 % too high",
        &["samplers.identity D7"],
    ),
];

const fn sampler(
    name: &'static str,
    defect: Defect,
    what: &'static str,
    expected: &'static [&'static str],
) -> Planted {
    of(Family::Sampler, row(name, defect, what, expected))
}

/// Every defect of the verifier's arithmetic.
pub const VERIFIER: &[Planted] = &[
    verifier(
        "variance-by-difference",
        Defect::VarianceByDifference,
        "variance as E[x^2] - E[x]^2 in f32",
        &["calibration fixed-data"],
    ),
    verifier(
        "deviation-for-error",
        Defect::DeviationForError,
        "the standard deviation is taken for the standard error",
        &["calibration false-alarms"],
    ),
    verifier("one-sided", Defect::OneSided, "a one-sided p-value", &["calibration false-alarms"]),
    verifier(
        "pixels-for-passes",
        Defect::PixelsForPasses,
        "pixels of a pass are counted as independent",
        &["calibration false-alarms"],
    ),
];

const fn verifier(
    name: &'static str,
    defect: Defect,
    what: &'static str,
    expected: &'static [&'static str],
) -> Planted {
    of(Family::Verifier, row(name, defect, what, expected))
}

/// Defects in places where this program cannot plant them, and the test of the library that holds the
/// code to the opposite.
pub const UNIT_TESTED: &[(&str, &str)] = &[
    (
        "a block is dropped or counted twice in the merge",
        "stats::tree::tests::a_missing_block_is_noticed",
    ),
    (
        "a record holds fewer passes than it says",
        "verify::judge::tests::what_a_test_cannot_rest_on_is_invalid",
    ),
    (
        "the order of blocks enters a sum",
        "tests/reproducibility.rs::threads_blocks_and_folders_change_no_byte",
    ),
    (
        "streams of neighbouring ids are correlated",
        "sampling::stream::tests::neighbouring_streams_are_independent",
    ),
    (
        "two passes or pixels share a stream",
        "sampling::stream::tests::no_two_streams_of_a_run_start_alike",
    ),
    (
        "a false alarm is more frequent than its level",
        "stats::hypothesis::tests::false_alarms_have_their_level",
    ),
    (
        "Welch's test has the error of one arm alone",
        "verify::trial::tests::two_means_are_tested_by_welch",
    ),
    (
        "the limit of skewness is three times as high",
        "verify::trial::tests::skewness_has_the_stated_limit",
    ),
    (
        "a control that expects an invalid test takes any reason",
        "verify::judge::tests::a_control_takes_the_reason_that_it_names_and_no_other",
    ),
    (
        "one number of the haemoglobin table is ten times too small",
        "optics::skin::tests::the_table_is_whole",
    ),
    (
        "two numbers of the Bradford transform are exchanged",
        "optics::colour::tests::whites_are_adapted_as_published",
    ),
    (
        "pixels look half a pixel aside",
        "experiment::tests::units::pixels_of_a_pinhole_look_where_they_have_to",
    ),
    (
        "a wide disc's irradiance is that of a small one",
        "experiment::tests::units::lights_have_the_irradiance_that_they_state",
    ),
    (
        "light enters a point of a cloud by the geometric cosine",
        "estimators::point_cloud::tests::points_take_in_the_flux_of_their_shading_normals",
    ),
    (
        "boxes of the hierarchy are rounded to nearest",
        "sampling::thinning::tree::tests::boxes_hold_their_points",
    ),
    (
        "the weight of a rarely accepted point has a limit",
        "sampling::thinning::tests::rare_acceptances_weigh_as_much_as_they_have_to",
    ),
];

/// No defect: everything has to be green.
pub const SHAM: Planted = of(Family::Sham, row("sham", Defect::None, "nothing is wrong", &[]));

/// The sham, then every defect.
pub fn all() -> Vec<Planted> {
    let planted = [TRACER, SUBDIVISION, SAMPLERS, acceptance::ROWS, cloud::ROWS, VERIFIER];
    let planted = planted.into_iter().flatten();
    std::iter::once(SHAM).chain(planted.copied()).collect()
}

/// Names of all defects.
pub fn names() -> Vec<&'static str> {
    all().iter().map(|row| row.name).collect()
}

/// The row of a name.
pub fn named(name: &str) -> Option<Planted> {
    all().into_iter().find(|row| row.name == name)
}

static PLANTED: OnceLock<Defect> = OnceLock::new();

/// Plants a defect in this process, once and for all.
pub fn plant(defect: Defect) {
    assert!(PLANTED.set(defect).is_ok(), "one defect a process");
}

/// The defect of this process.
pub fn planted() -> Defect {
    *PLANTED.get().unwrap_or(&Defect::None)
}
