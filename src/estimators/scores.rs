//! Scores of one pass: `[observable][band]`, and counts of work and of anomalies.
//!
//! Observables: for each region of the sensor that is split, its total, its transport classes, and
//! (with more than one source of light) the share of each; for the other regions the total. Pixels
//! beside them.

use std::sync::Arc;

use super::TransportClass;
use crate::scene::sensor::SensorRegion;
use crate::scene::{Scene, Sensor};

/// Deterministic counts of work done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cost {
    /// Paths started, at the sensor or (photons) at a light.
    Paths,
    /// Closest-hit queries.
    Rays,
    /// Occlusion queries.
    ShadowRays,
    /// Scattering events in the medium.
    MediumEvents,
    /// Reflections and refractions at the boundary.
    BoundaryEvents,
    /// Points of a surface with the light that enters there.
    CloudPoints,
    /// Nodes of a hierarchy over them that a query looked at.
    Nodes,
    /// Points that a query by the hierarchy looked at.
    Candidates,
    /// Points that a query without hierarchy looked at.
    Scanned,
    /// Evaluated BSSRDFs, one a band.
    Evaluations,
}

impl Cost {
    /// All counters, in the order of [`Scores::cost`].
    pub const ALL: [Cost; 10] = [
        Cost::Paths,
        Cost::Rays,
        Cost::ShadowRays,
        Cost::MediumEvents,
        Cost::BoundaryEvents,
        Cost::CloudPoints,
        Cost::Nodes,
        Cost::Candidates,
        Cost::Scanned,
        Cost::Evaluations,
    ];

    /// Its name in records.
    pub fn name(self) -> &'static str {
        match self {
            Cost::Paths => "paths",
            Cost::Rays => "rays",
            Cost::ShadowRays => "shadow_rays",
            Cost::MediumEvents => "medium_events",
            Cost::BoundaryEvents => "boundary_events",
            Cost::CloudPoints => "cloud_points",
            Cost::Nodes => "cloud_nodes",
            Cost::Candidates => "cloud_candidates",
            Cost::Scanned => "cloud_scanned",
            Cost::Evaluations => "bssrdf_evaluations",
        }
    }
}

/// Counts of anomalies, which reports always show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anomaly {
    /// A score that is not a finite number; it is not added and voids the claims that rest on it.
    NonFinite,
    /// A path that left the body without crossing its boundary; it scores 0 from there on and voids
    /// the claims that rest on it.
    LostRay,
    /// A direction on one side of the geometric and on the other of the shading surface; it scores 0.
    /// This is what interpolated normals mean here, not an error.
    WrongSide,
}

impl Anomaly {
    /// All anomalies, in the order of [`Scores::anomalies`].
    pub const ALL: [Anomaly; 3] = [Anomaly::NonFinite, Anomaly::LostRay, Anomaly::WrongSide];

    /// Its name in records.
    pub fn name(self) -> &'static str {
        match self {
            Anomaly::NonFinite => "nonfinite",
            Anomaly::LostRay => "lost_ray",
            Anomaly::WrongSide => "wrong_side",
        }
    }
}

/// Name of an observable: region (and light), and transport class.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ObservableName {
    /// `mean`, `mean@sun`, `tile_0_0`, ...
    pub name: String,
    /// `all` or a class.
    pub class: &'static str,
}

/// Which observables a scene has, in which order.
#[derive(Clone, Debug)]
pub struct Layout {
    sensor: Sensor,
    bands: usize,
    /// Sources of light whose shares are kept; 0 where there is only one.
    sources: usize,
    regions: Vec<SensorRegion>,
    split_regions: usize,
    names: Vec<ObservableName>,
}

impl Layout {
    /// The layout of a scene.
    pub fn new(scene: &Scene) -> Layout {
        let mut names = Vec::new();
        let sources: Vec<&str> = scene.sources().collect();
        let sources = if sources.len() > 1 { &sources[..] } else { &[] };
        let observable = |name: &str, class| ObservableName { name: name.into(), class };
        let regions = scene.sensor.regions();
        for region in &regions {
            names.push(observable(&region.name, "all"));
            if region.split {
                names.extend(TransportClass::ALL.map(|class| observable(&region.name, class.name())));
                names.extend(sources.iter().map(|source| ObservableName {
                    name: format!("{}@{source}", region.name),
                    class: "all",
                }));
            }
        }
        Layout {
            sensor: scene.sensor.clone(),
            bands: scene.bands(),
            sources: sources.len(),
            split_regions: regions.iter().filter(|region| region.split).count(),
            regions,
            names,
        }
    }

    /// The regions of the sensor, those that are split first.
    pub fn regions(&self) -> &[SensorRegion] {
        &self.regions
    }

    /// Names of the observables, in the order of their scores.
    pub fn observables(&self) -> &[ObservableName] {
        &self.names
    }

    /// Number of bands.
    pub fn bands(&self) -> usize {
        self.bands
    }

    /// Pixels per row and rows of the image, where the sensor has one.
    pub fn image(&self) -> Option<(usize, usize)> {
        self.sensor.pixels()
    }

    /// Pixels of the image, 0 where the sensor has none.
    pub fn pixels(&self) -> usize {
        self.sensor.pixels().map_or(0, |(width, height)| width * height)
    }

    /// Observables of one split region: total, classes, sources.
    fn stride(&self) -> usize {
        1 + TransportClass::ALL.len() + self.sources
    }
}

/// The scores of one pass.
#[derive(Clone, Debug)]
pub struct Scores {
    layout: Arc<Layout>,
    /// Scores of the pass, `[observable][band]`.
    pub observables: Vec<f64>,
    /// `[pixel][band]`; empty where the sensor has no pixels.
    pub pixels: Vec<f64>,
    /// Work counted, indexed by [`Cost`].
    pub cost: [u64; Cost::ALL.len()],
    /// Anomalies counted, indexed by [`Anomaly`].
    pub anomalies: [u64; Anomaly::ALL.len()],
    /// Contributions in their order, if they are held back; nothing is added then.
    held: Option<Vec<Contribution>>,
}

/// What [`Scores::add`] adds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Contribution {
    slot: usize,
    band: usize,
    class: TransportClass,
    source: usize,
    value: f64,
}

impl Scores {
    /// Scores of an empty pass: all zero.
    pub fn new(layout: Layout) -> Scores {
        Scores {
            observables: vec![0.0; layout.names.len() * layout.bands],
            pixels: vec![0.0; layout.pixels() * layout.bands],
            cost: [0; Cost::ALL.len()],
            anomalies: [0; Anomaly::ALL.len()],
            layout: Arc::new(layout),
            held: None,
        }
    }

    /// Scores that hold contributions back, and count. Paths that are traced side by side have such scores each, so that
    /// sums are formed in the order of paths, however these overtake each other.
    pub(super) fn holding(&self) -> Scores {
        Scores {
            layout: self.layout.clone(),
            observables: Vec::new(),
            pixels: Vec::new(),
            cost: [0; Cost::ALL.len()],
            anomalies: [0; Anomaly::ALL.len()],
            held: Some(Vec::new()),
        }
    }

    /// Takes what has been held back, and leaves `empty`, a list whose memory is used again.
    pub(super) fn take_held(&mut self, empty: Vec<Contribution>) -> Vec<Contribution> {
        self.held.replace(empty).unwrap_or_default()
    }

    /// Adds contributions that were held back, and empties them.
    pub(super) fn add_held(&mut self, held: &mut Vec<Contribution>) {
        for Contribution { slot, band, class, source, value } in held.drain(..) {
            self.add(slot, band, class, source, value);
        }
    }

    /// Adds the counts of other scores, and sets these to zero.
    pub(super) fn take_counts(&mut self, others: &mut Scores) {
        let counts = others.cost.iter_mut().chain(&mut others.anomalies);
        let sums = self.cost.iter_mut().chain(&mut self.anomalies);
        sums.zip(counts).for_each(|(sum, count)| *sum += std::mem::take(count));
    }

    /// Resets scores to zero for the next pass; counts continue.
    pub fn clear(&mut self) {
        self.observables.fill(0.0);
        self.pixels.fill(0.0);
    }

    /// Adds a contribution to a slot of the sensor: its pixel, its regions, its class, its source: the
    /// index of a light, or the number of lights for the medium's emission.
    #[inline]
    pub fn add(&mut self, slot: usize, band: usize, class: TransportClass, source: usize, value: f64) {
        if let Some(held) = &mut self.held {
            held.push(Contribution { slot, band, class, source, value });
            return;
        }
        if !value.is_finite() {
            self.anomalies[Anomaly::NonFinite as usize] += 1;
            return;
        }
        let layout = &self.layout;
        let bands = layout.bands;
        if !self.pixels.is_empty() {
            self.pixels[slot * bands + band] += value;
        }
        for (region, factor) in layout.sensor.regions_of(slot) {
            let share = factor * value;
            if region < layout.split_regions {
                let first = region * layout.stride();
                self.observables[first * bands + band] += share;
                self.observables[(first + 1 + class as usize) * bands + band] += share;
                if layout.sources > 0 {
                    self.observables[(first + 1 + TransportClass::ALL.len() + source) * bands + band] +=
                        share;
                }
            } else {
                let first = layout.split_regions * layout.stride() + region - layout.split_regions;
                self.observables[first * bands + band] += share;
            }
        }
    }

    /// Adds one unit of this work.
    #[inline]
    pub fn count(&mut self, cost: Cost) {
        self.count_many(cost, 1);
    }

    /// Counts much work at once.
    #[inline]
    pub fn count_many(&mut self, cost: Cost, times: u64) {
        self.cost[cost as usize] += times;
    }

    /// Adds one anomaly of this kind.
    #[inline]
    pub fn note(&mut self, anomaly: Anomaly) {
        self.anomalies[anomaly as usize] += 1;
    }
}
