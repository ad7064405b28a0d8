//! Training of learned walks, before the first pass.
//!
//! Paths are traced as in `path`, on streams that no pass uses. Each training round (lesson) is guided by the result of the
//! round before and is twice as long. A turn (a scattering event at a medium vertex) records the score of its path after the
//! vertex: the throughput up to the vertex, times the phase function, times the light that arrives along the direction, over
//! the density of the path. The sum over paths is thus proportional to the product of the three, averaged over the walks that
//! pass by, however the paths were drawn.
//!
//! ```text
//! field, lessons -> Lesson (a walk that takes notes) -> found per cell -> LearnedPulls -> field with guided walks
//! ```

use std::cell::RefCell;
use std::sync::{Arc, OnceLock};

use super::bands::{ScorePlace, WalkBands};
use super::field::{Field, Path};
use super::guidance::{
    Finder, FoundLight, Guidance, GuidedBand, LearnedPulls, LearningCells, Lessons, WalkDraw,
};
use super::roulette::Roulette;
use super::walk::{CameraWalk, Unrivalled};
use super::{GuideSlice, Layout, Scores};
use crate::geometry::Ray;
use crate::math::{DVec3, GOLDEN};
use crate::optics::medium::Medium;
use crate::sampling::stream::{Stream, StreamKey};
use crate::scene::Scene;

/// A field whose walks may have to learn before they are drawn.
#[derive(Debug)]
pub(super) struct TaughtField {
    untaught: Field,
    lessons: Option<Lessons>,
    taught: OnceLock<Field>,
}

impl TaughtField {
    /// Prepares a scene for tracing.
    pub(super) fn new(
        scene: Arc<Scene>,
        roulette: Roulette,
        draw: WalkDraw,
        finder: Finder,
    ) -> TaughtField {
        let untaught = Field::with_walks(scene, roulette, draw, finder);
        TaughtField { untaught, lessons: draw.lessons(), taught: OnceLock::new() }
    }

    /// The same without light sampling of lights that are even.
    pub(super) fn finding_even_lights(self) -> TaughtField {
        TaughtField { untaught: self.untaught.finding_even_lights(), ..self }
    }

    /// The same where it pays: [`Field::finding_even_lights_where_it_pays`].
    pub(super) fn finding_even_lights_where_it_pays(self) -> TaughtField {
        TaughtField { untaught: self.untaught.finding_even_lights_where_it_pays(), ..self }
    }

    /// The same with plain walks in some bands.
    pub(super) fn plain_in(self, is_plain: impl Fn(usize, &Guidance) -> bool) -> TaughtField {
        TaughtField { untaught: self.untaught.plain_in(is_plain), ..self }
    }

    /// The scene.
    pub(super) fn scene(&self) -> &Scene {
        &self.untaught.scene
    }

    /// The field; the first to ask waits until walks have learned.
    #[inline]
    pub(super) fn field(&self) -> &Field {
        match self.lessons {
            None => &self.untaught,
            Some(lessons) => self.taught.get_or_init(|| taught(&self.untaught, lessons)),
        }
    }

    /// What guides walks, band by band.
    pub(super) fn guides(&self) -> Vec<Option<GuideSlice>> {
        let scene = self.scene();
        let of_band = |band: usize| self.untaught.guidance(band)?.slice(scene);
        (0..scene.bands()).map(of_band).collect()
    }

    /// Memory on the heap, bytes; of what has been learned by now.
    pub(super) fn heap_bytes(&self) -> usize {
        self.taught.get().unwrap_or(&self.untaught).heap_bytes()
    }
}

/// The first lesson's part of all paths; each one after it is twice as long as the one before.
const LESSONS: u32 = 4;

/// The field after all lessons.
fn taught(field: &Field, lessons: Lessons) -> Field {
    let scatters = |medium: &Medium| medium.sigma_t > 0.0 && medium.albedo > 0.0;
    let of_band = |band: usize| scatters(&field.scene.medium[band]).then(|| learn(field, band, lessons));
    let guidance = (0..field.scene.bands()).map(of_band).collect();
    field.with_guidance(guidance)
}

/// What the walks of a band learn.
fn learn(field: &Field, band: usize, lessons: Lessons) -> Guidance {
    let Lessons { share, cells, paths } = lessons;
    let scene = &field.scene;
    let medium = &scene.medium[band];
    let cells = LearningCells::new(scene, band, cells);
    let key = StreamKey::named("what walks learn from");
    let mut scores = Scores::new(Layout::new(scene));
    let mut known = LearnedPulls::new(cells, &vec![FoundLight::default(); cells.count()], medium);
    let mut done = 0;
    for lesson in 0..LESSONS {
        let until = paths * ((2 << lesson) - 1) / ((2 << (LESSONS - 1)) - 1);
        let guidance = Guidance::learned(share, medium, known);
        let notes = RefCell::new(Notes::new(cells));
        for path in done..until {
            let pass = key.pass(path * scene.bands() as u64 + band as u64);
            let index = training_ray(path, scene.sensor.rays_per_pass());
            let path = Path { field, band, index, key: &pass };
            let walk = GuidedBand::new(&guidance, medium);
            CameraWalk::trace(path, &mut scores, Unrivalled, Lesson { walk, turns: 0, notes: &notes });
            notes.borrow_mut().close(0);
        }
        done = until;
        known = LearnedPulls::new(cells, &notes.into_inner().found, medium);
    }
    Guidance::learned(share, medium, known)
}

/// The sensor's ray of a training path: the rays of every training round are spread over the image, however few they are.
fn training_ray(path: u64, rays: usize) -> usize {
    let place = (path as f64 * GOLDEN).fract();
    ((place * rays as f64) as usize).min(rays - 1)
}

/// What walks found.
#[derive(Debug)]
struct Notes {
    cells: LearningCells,
    /// Per cell.
    found: Vec<FoundLight>,
    /// The turns of the path that goes on: cell, direction, and what had been scored before.
    open: Vec<(usize, DVec3, f64)>,
    /// What the path has scored.
    scored: f64,
}

impl Notes {
    fn new(cells: LearningCells) -> Notes {
        Notes { cells, found: vec![FoundLight::default(); cells.count()], open: Vec::new(), scored: 0.0 }
    }

    /// Nothing more will be found by the turns of the path from this one on.
    fn close(&mut self, from: usize) {
        for (cell, dir, before) in self.open.drain(from.min(self.open.len())..) {
            let found = self.scored - before;
            if found > 0.0 {
                self.found[cell].add(dir, found);
            }
        }
    }
}

/// A guided walk that takes notes. A copy of it goes on where the walk was when it was made: the turns since then belong to
/// another branch of the path, which has ended.
#[derive(Clone, Debug)]
struct Lesson<'a> {
    walk: GuidedBand<'a>,
    /// How many the branch has taken.
    turns: usize,
    notes: &'a RefCell<Notes>,
}

impl WalkBands for Lesson<'_> {
    const IS_PLAIN: bool = false;

    fn enter(&mut self, at: DVec3, normal: DVec3, dir: DVec3) {
        self.walk.enter(at, normal, dir);
    }

    fn draw_turn(&mut self, medium: &Medium, arrival: &Ray, stream: &mut Stream) -> DVec3 {
        self.walk.draw_turn(medium, arrival, stream)
    }

    fn draw_flight(&mut self, medium: &Medium, u: f64) -> f64 {
        self.walk.draw_flight(medium, u)
    }

    fn flight(&mut self, media: &[Medium], t: f64, scatters: bool) {
        self.walk.flight(media, t, scatters);
    }

    fn turn(&mut self, media: &[Medium], at: DVec3, from: DVec3, to: DVec3) {
        let mut notes = self.notes.borrow_mut();
        notes.close(self.turns);
        let (cell, scored) = (notes.cells.of(at), notes.scored);
        notes.open.push((cell, to, scored));
        self.turns += 1;
        self.walk.turn(media, at, from, to);
    }

    fn facets(&self) -> Option<usize> {
        self.walk.facets()
    }

    fn gain_of_leaving(&mut self, at: DVec3) -> f64 {
        self.walk.gain_of_leaving(at)
    }

    fn importance(&mut self, at: DVec3) -> f64 {
        self.walk.importance(at)
    }

    fn density(&self) -> f64 {
        self.walk.density()
    }

    fn score(&self, _: &mut Scores, _: ScorePlace, value: f64) {
        let mut notes = self.notes.borrow_mut();
        notes.close(self.turns);
        if value.is_finite() {
            notes.scored += value;
        }
    }
}

#[cfg(test)]
#[path = "warm_up_tests.rs"]
mod tests;
