//! Subdivision next-event estimation (Koerner, Novak, Kutz, Habel & Jarosz 2016, "Subdivision next-event
//! estimation for path-traced subsurface scattering"), and extensions that make it efficient.
//!
//! At every medium vertex x_i of a camera walk a boundary point x_k is probed, and the edge between them
//! is subdivided by a vertex x_j, from the light's end or from the walk's end (`subdivision`). Both are
//! weighted by MIS against the techniques by which the walk makes the same path. The extensions of the talk
//! are probes guided to where light probably enters (`guess`, `probe`), a last vertex guided by the light
//! (`last_vertex`), and a probability of subdivision that falls with depth. Lights that are not concentrated
//! are skipped and left to the walk (`guide`); where every light is skipped, the estimator is `path` to the
//! last bit.
//!
//! The estimator is unbiased for all paths that the walk or a rival can sample. Through a smooth boundary
//! only subdivision from the light's end finds parallel light, and paths without two medium vertices before
//! the exit are missing. `snee_connect` adds specular connections (`specular`), which find these paths, too.

mod bidirectional;
mod connections;
mod end;
mod expected;
mod extra_turns;
mod guess;
mod guide;
mod last_vertex;
mod learned_calls;
mod left_out;
mod options;
mod photons;
mod probe;
mod snee_connect;
mod specular;
mod state;
mod subdivision;
mod two_bounce;

use std::cell::RefCell;
use std::slice::{from_mut, from_ref};
use std::sync::{Arc, OnceLock};

use super::bands::{MAX_SHARED, OneBand, SharedBands, WalkBands};
use super::connection::{self, Conic};
use super::field::Path;
use super::guidance::{Finder, GuidedBand};
use super::illumination::unscattered_notes;
use super::walk::{CameraWalk, Unrivalled, passes_at_once, trace_passes};
use super::warm_up::TaughtField;
use super::{BandUse, Estimator, EstimatorKind, GuideSlice, Scores, Serves, read_options};
use crate::error::{Error, Result};
use crate::optics::boundary::Boundary;
use crate::optics::joint::{JointDirections, JointTable};
use crate::sampling::stream::{PassKey, Purpose};
use crate::scene::{Light, Scene};

use guide::Guide;
use learned_calls::{CallNotes, ChosenCalls};
use photons::{PhotonGuide, PhotonMap};
use specular::Specular;
use state::Connections;

pub use bidirectional::Bidirectional;
pub use end::Call;
pub use last_vertex::LastVertex;
pub use learned_calls::LearnedCalls;
pub use options::{EdgeTechnique, JointKind, SneeChoices, SneeOptions, SneePreset, Strategies};
pub use photons::Photons;
pub use probe::ProbeShares;
pub use specular::ConnectionCall;
pub use two_bounce::TwoBounce;

/// Data of connections, for one band.
#[derive(Clone, Debug)]
struct BandSetup {
    options: Arc<SneeOptions>,
    guides: Arc<[Guide]>,
    /// Extinction that steers samplers, 1/mm: the medium's, or the least of those that share a walk.
    sigma: f64,
    joint: Arc<JointDirections>,
    specular: Option<Specular>,
    /// Number of sensor rays per walk at which lights are scored by expectation; 1 where none is.
    views: u32,
    /// Directions against light.
    photons: Option<PhotonGuide>,
    /// What has been learned of its calls.
    chosen: Option<ChosenCalls>,
}

impl BandSetup {
    /// The same with the calls and views of these options.
    fn calling(&self, options: SneeOptions) -> BandSetup {
        let specular = self.specular.as_ref().and_then(|Specular { solver, .. }| {
            options.connection.map(|call| Specular { call, solver: solver.clone() })
        });
        let views = if self.views > 1 { options.views } else { 1 };
        let most = options.photons.map_or(0.0, |photons| photons.most);
        let photons = self.photons.clone().filter(|_| most > 0.0);
        let photons = photons.map(|photons| PhotonGuide { most, ..photons });
        BandSetup { options: Arc::new(options), specular, views, photons, ..self.clone() }
    }

    /// Whether every light that shines in the band is connected to as a whole.
    fn connects_to_all(&self, lights: &[Light], band: usize) -> bool {
        lights.iter().enumerate().all(|(index, light)| {
            let is_whole = |guide: &Guide| guide.light == index && guide.is_whole();
            light.strength(band) == 0.0 || self.guides.iter().any(is_whole)
        })
    }
}

/// The estimator, for one scene.
#[derive(Debug)]
pub struct Snee {
    walks: TaughtField,
    options: Arc<SneeOptions>,
    /// As the options ask for, per band; one for all where bands share walks.
    setups: Vec<BandSetup>,
    /// The same with learned calls.
    learned: OnceLock<Vec<BandSetup>>,
}

impl Snee {
    /// `snee` in experiment files.
    pub const KIND: EstimatorKind = EstimatorKind {
        kind: "snee",
        doc: "path tracing with subdivision next-event estimation, as published or guided; unbiased",
        serves: Serves { emission: true, ..Serves::WITHOUT_ENTRIES },
        options_schema: || schemars::schema_for!(SneeChoices),
        build: |options, scene| {
            let choices: SneeChoices = read_options(options)?;
            Ok(Box::new(Snee::new(scene, choices.options()?)?))
        },
    };

    /// For a scene.
    ///
    /// # Errors
    /// A scene that it does not serve; bands that are to share walks and differ in more than their
    /// media.
    pub fn new(scene: Arc<Scene>, options: SneeOptions) -> Result<Snee> {
        Snee::KIND.check(&scene)?;
        Snee::set_up(scene, options)
    }

    /// The same for any sensor.
    fn set_up(scene: Arc<Scene>, options: SneeOptions) -> Result<Snee> {
        if options.share_bands {
            check_shared(&scene)?;
        }
        if options.photons.is_some() && scene.shape.bounds().is_none() {
            return Err(Error::input_help("photons need a finite body", "leave out `photons`"));
        }
        let options = Arc::new(options);
        let is_connected =
            options.connection.is_some() && scene.boundary.iter().any(specular::is_served);
        let solver = is_connected.then(|| Arc::new(Conic::new(&scene.shape)));
        let setup = |band: usize| {
            let media = if options.share_bands { &scene.medium[..] } else { &scene.medium[band..=band] };
            let sigma = media.iter().map(|m| m.sigma_t).fold(f64::INFINITY, f64::min);
            let is_matched = scene.boundary[band] == Boundary::Matched;
            let scatters = media.iter().all(|m| m.sigma_t > 0.0) && media.iter().any(|m| m.albedo > 0.0);
            let guides = if is_matched || !scatters {
                Vec::new()
            } else {
                Guide::all(&scene.lights, band, options.least_concentration, &scene.boundary[band])
            };
            let phase = scene.medium[band].phase;
            let joint = match options.joint {
                JointKind::Table if options.strategies.bottom_to_top => {
                    JointDirections::Table(JointTable::new(phase))
                }
                _ => JointDirections::Mixture(phase),
            };
            let specular = match (options.connection, &solver) {
                (Some(call), Some(solver)) if specular::is_served(&scene.boundary[band]) => {
                    Some(Specular { call, solver: solver.clone() })
                }
                _ => None,
            };
            let is_looked_for = (options.expected_reflection || options.expected_passage)
                && guides.iter().any(|guide| !scene.lights[guide.light].is_directional());
            let is_smooth = matches!(scene.boundary[band], Boundary::Smooth { .. });
            let views = if is_looked_for && is_smooth { options.views } else { 1 };
            BandSetup {
                photons: None,
                options: options.clone(),
                guides: guides.into(),
                sigma,
                joint: Arc::new(joint),
                specular,
                views,
                chosen: None,
            }
        };
        let count = if options.share_bands { 1 } else { scene.bands() };
        let mut setups: Vec<BandSetup> = (0..count).map(setup).collect();
        if let (Some(photons), Some(bounds)) = (options.photons, scene.shape.bounds()) {
            let guides: Vec<_> = setups.iter().map(|setup| setup.guides.clone()).collect();
            let maps = PhotonMap::of_bands(&scene, &bounds, &guides, photons);
            setups.iter_mut().zip(maps).for_each(|(setup, map)| setup.photons = map);
        }
        let mut walks =
            TaughtField::new(scene.clone(), options.roulette, options.walk, Finder::Connections);
        if !options.walk.is_near_lights() {
            walks = walks.plain_in(|band, guidance| {
                setups[band].connects_to_all(&scene.lights, band) && guidance.is_lit_at_entry(&scene)
            });
        }
        if options.walk.is_guided() && options.strategies.bsdf {
            walks = walks.finding_even_lights_where_it_pays();
        }
        Ok(Snee { walks, options, setups, learned: OnceLock::new() })
    }

    /// The setups of passes; the first to ask waits until calls have been learned.
    #[inline]
    fn setups_in_use(&self) -> &[BandSetup] {
        match self.options.learned_calls {
            None => &self.setups,
            Some(lesson) => self.learned.get_or_init(|| learned_calls::learn(self, lesson)),
        }
    }
}

/// Properties that must be equal in all bands if they share walks.
fn check_shared(scene: &Scene) -> Result<()> {
    let same_boundary = scene.boundary.windows(2).all(|pair| pair[0] == pair[1]);
    let grey = |light: &Light| (1..scene.bands()).all(|band| light.is_same_in(0, band));
    let trouble = if scene.bands() > MAX_SHARED {
        format!("there are {} bands, and at most {MAX_SHARED} can share a walk", scene.bands())
    } else if !same_boundary {
        "the boundary differs between bands (its index disperses)".into()
    } else if scene.boundary.first() == Some(&Boundary::Matched) {
        "the boundary is matched".into()
    } else if let Some(light) = scene.lights.iter().find(|light| !grey(light)) {
        format!("light `{}` differs between bands", light.name)
    } else {
        return Ok(());
    };
    Err(Error::input(format!("bands cannot share walks: {trouble}; use bands = \"alone\"")))
}

impl Estimator for Snee {
    fn prepare(&self) {
        self.walks.field();
        self.setups_in_use();
    }

    fn pass(&self, bands: &[usize], key: &PassKey, scores: &mut Scores) {
        self.passes(bands, from_ref(key), from_mut(scores));
    }

    fn passes(&self, bands: &[usize], keys: &[PassKey], scores: &mut [Scores]) {
        let field = self.walks.field();
        let setups = self.setups_in_use();
        let rays = field.scene.sensor.rays_per_pass();
        if self.options.share_bands {
            for (key, scores) in keys.iter().zip(scores) {
                for index in 0..rays {
                    let path = Path { field, band: self.hero(key, index), index, key };
                    self.trace(&setups[0], None, path, scores);
                }
            }
            return;
        }
        for &band in bands {
            let setup = &setups[band];
            if setup.guides.is_empty() {
                trace_passes(field, band, keys, scores, |_| Unrivalled);
            } else if setup.photons.is_some() {
                // Walks that are traced side by side do not state how they turn.
                for (key, scores) in keys.iter().zip(&mut *scores) {
                    for index in 0..rays {
                        self.trace(setup, None, Path { field, band, index, key }, scores);
                    }
                }
            } else {
                let connections = |path: &Path| Connections::of_path(setup, path);
                trace_passes(field, band, keys, scores, connections);
            }
        }
    }

    fn passes_at_once(&self, bands: &[usize]) -> u64 {
        if self.options.share_bands { 1 } else { passes_at_once(self.walks.field(), bands) }
    }

    fn band_use(&self) -> BandUse {
        if self.options.share_bands { BandUse::Shared } else { BandUse::EachAlone }
    }

    fn guides(&self) -> Vec<Option<GuideSlice>> {
        self.walks.guides()
    }

    fn held_bytes(&self) -> usize {
        let technique = self.setups.iter().find_map(|setup| setup.specular.as_ref());
        // Bands share maps.
        let mut photons: Vec<_> =
            self.setups.iter().filter_map(|setup| Some(&setup.photons.as_ref()?.map)).collect();
        photons.dedup_by(|a, b| Arc::ptr_eq(a, b));
        self.walks.heap_bytes()
            + technique.map_or(0, |technique| technique.solver.heap_bytes())
            + photons.into_iter().map(|map| map.heap_bytes()).sum::<usize>()
    }

    fn notes(&self) -> Vec<String> {
        let Strategies { bsdf, light, .. } = self.options.strategies;
        let scene = self.walks.scene();
        let mut notes = if self.setups.iter().any(|setup| setup.specular.is_some()) {
            connection::missing_notes(scene)
        } else {
            missing_notes(scene, "subdivision from its end")
        };
        if let Some(learned) = self.learned.get() {
            notes.extend(learned_calls::notes(&self.options, learned));
        }
        if !(bsdf && light) {
            notes.push(
                "`strategies` leaves out a part of unidirectional sampling: of paths whose last two medium vertices \
                 follow each other, what only that part finds is excluded from this estimator's result"
                    .into(),
            );
        }
        notes
    }
}

/// What no technique finds through a smooth boundary under parallel light, where only `technique` finds
/// anything.
fn missing_notes(scene: &Scene, technique: &str) -> Vec<String> {
    let smooth = scene.boundary.iter().any(|b| matches!(b, Boundary::Smooth { .. }));
    let parallel = scene.lights.iter().filter(|light| light.is_directional() && smooth);
    let missing = parallel.map(|light| {
        format!(
            "through a smooth boundary, directional light `{}` is found by {technique} alone: surface, single, \
             single_internal and what has one medium vertex after its last internal reflection are excluded from \
             this estimator's result",
            light.name
        )
    });
    missing.chain(unscattered_notes(scene)).collect()
}

impl Snee {
    /// The band that steers a walk shared by all.
    fn hero(&self, key: &PassKey, index: usize) -> usize {
        let bands = self.walks.scene().bands();
        let u = key.stream(index as u64, Purpose::Hero).draw();
        ((u * bands as f64) as usize).min(bands - 1)
    }

    fn trace(
        &self,
        setup: &BandSetup,
        notes: Option<&RefCell<CallNotes>>,
        path: Path,
        scores: &mut Scores,
    ) {
        let (field, band) = (path.field, path.band);
        let media = &field.scene.medium;
        if self.options.share_bands {
            trace_with(setup, notes, path, scores, SharedBands::new(media, band));
        } else if let Some(guidance) = field.guidance(band) {
            trace_with(setup, notes, path, scores, GuidedBand::new(guidance, &media[band]));
        } else {
            trace_with(setup, notes, path, scores, OneBand);
        }
    }
}

fn trace_with<B: WalkBands>(
    setup: &BandSetup,
    notes: Option<&RefCell<CallNotes>>,
    path: Path,
    scores: &mut Scores,
    bands: B,
) {
    if setup.guides.is_empty() {
        CameraWalk::trace(path, scores, Unrivalled, bands);
    } else {
        let mut connections = Connections::of_path(setup, &path);
        connections.notes = notes;
        CameraWalk::trace(path, scores, connections, bands);
    }
}

#[cfg(test)]
mod draws_tests;
#[cfg(test)]
mod finite_tests;
#[cfg(test)]
mod snee_connect_tests;
#[cfg(test)]
mod specular_tests;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod weights_tests;
