//! State that a walk carries for connections through the boundary, and the density of a path's end under
//! all of them.
//!
//! The end of a path: x_i -> x_j -> x_k in the order of the walk, x_i and x_j in the medium, x_k on the
//! boundary, then w_L towards a light. Every density is taken per volume of x_j, area of x_k and solid
//! angle of w_L, and divided by
//!   U = phase(x_i) sigma_t T(d_ij) / d_ij^2 * phase(x_j) T(d_jk) cos_k / d_jk^2,
//! the density with which the walk itself draws x_j and x_k (the flight to the boundary has the
//! probability T, no sigma_t). Delta lobes and parallel light leave Dirac factors in w_L, of which only
//! the coefficients are kept: a technique takes part for a pair (lobe, light) exactly if its Dirac
//! factors are the pair's. Refraction by a smooth surface, drawn from the light's side, is a delta in
//! w_kj; written in w_L it gains J = dw_L / dw_kj = eta^2 |n.w_kj| / |n.w_L|.
//!
//!   lobe x light          BSDF   light   top to bottom   bottom to top   last vertex   connection
//!   rough x finite        yes    yes     yes             yes             yes           -
//!   rough x parallel      -      yes     yes             -               yes           -
//!   smooth x finite       yes    -       yes             yes             yes           yes
//!   smooth x parallel     -      -       yes             -               -             yes
//!
//! Since value / density = f U / (U sum) for each technique, every sample scores
//!   throughput * albedo * f_k L / (p_B + p_L + sum of rivals / U),
//! whichever technique it comes from. Where photons guide, p_B and p_L are
//! 1 + q p / (p_w T) times as large ([`super::photons`]).

use super::SneeOptions;
use super::end::{End, Leg, Middle};
use super::expected;
use super::extra_turns;
use super::last_vertex::{self, GuidedEnd};
use super::learned_calls::CalledTechnique;
use super::specular;
use super::state::{AllCalls, Connections, PathTurn, Slot};
use super::subdivision::{self, Subdivided};
use crate::estimators::bands::WalkBands;
use crate::estimators::vertices::{Unscattered, WalkExit, WalkVertex};
use crate::estimators::walk::{CameraWalk, DensitySum, LookingRay, Rivals};
use crate::geometry::{Hit, Ray, Shape};
use crate::math::lanes::{Lanes, VectorLanes};
use crate::math::{DVec3, Frame};

impl Rivals for Connections<'_> {
    fn call<B: WalkBands>(walk: &mut CameraWalk<'_, Self, B>) {
        let Ray { origin: point, dir: arrival } = walk.ray;
        let state = &mut walk.rivals;
        state.arrive(WalkVertex { point, arrival, walks: walk.bands.density() });
        let options = &state.setup.options;
        let (is_first, is_free) = (state.count == 1, !state.is_edge_alone);
        if let Some(technique) = &options.last_vertex
            && (is_free || !is_first)
            && let Some(found) = last_vertex::draw(walk, technique)
        {
            walk.rivals.begin(Some(CalledTechnique::LastVertex));
            score_guided(walk, &found);
        }
        if let Some(technique) = &walk.rivals.setup.specular
            && (is_free || !is_first)
            && let Some(connected) = specular::draw(walk, technique)
        {
            walk.rivals.begin(Some(CalledTechnique::Connection));
            for root in &connected.roots {
                if let Some(found) = connected.end(walk, root) {
                    score_guided(walk, &found);
                }
            }
            walk.rivals.roots = connected.roots;
        }
        if options.strategies.subdivides()
            && (is_free || is_first)
            && let Some(edge) = subdivision::draw_edge(walk)
        {
            walk.rivals.begin(Some(CalledTechnique::Subdivision));
            if options.strategies.top_to_bottom
                && let Some(found) = subdivision::top_to_bottom(walk, &edge)
            {
                score_subdivided(walk, &found);
            }
            if options.strategies.bottom_to_top
                && let Some(found) = subdivision::bottom_to_top(walk, &edge)
            {
                score_subdivided(walk, &found);
            }
        }
        walk.rivals.begin(None);
        extra_turns::follow(walk);
    }

    #[inline]
    fn turned<B: WalkBands>(walk: &mut CameraWalk<'_, Self, B>, dir: DVec3, walks: f64) {
        let Ray { origin: point, dir: arrival } = walk.ray;
        if let Some(extra_turns) = &mut walk.rivals.extra_turns {
            let vertex = WalkVertex { point, arrival, walks };
            extra_turns.latest = Some(PathTurn { vertex, dir, met: None });
        }
    }

    #[inline]
    fn reached(&mut self, t: f64) {
        if let Some(turn) = self.extra_turns.as_mut().and_then(|turns| turns.latest.as_mut()) {
            turn.reach(t);
        }
    }

    #[inline]
    fn extra_turns<B: WalkBands>(walk: &CameraWalk<'_, Self, B>) -> f64 {
        let latest = walk.rivals.extra_turns.as_ref().and_then(|turns| turns.latest);
        latest.map_or(0.0, |turn| extra_turns::density(walk, &turn) / walk.bands.density())
    }

    /// A lower bound of the distance of the specular guess, which most calls fail by.
    #[inline(always)]
    fn bounds(&self, shape: &Shape, points: &VectorLanes) -> Option<Lanes> {
        let AllCalls { guide, .. } = self.all_calls.as_ref()?;
        Some(shape.clearances_within(points, &guide.refracted))
    }

    /// Draws the numbers of [`Self::call`], and gives them back where one of its techniques may be called.
    #[inline(always)]
    fn passes(&mut self, vertex: &WalkVertex, bound: f64) -> bool {
        let Some(AllCalls { guide, calls }) = &self.all_calls else { return false };
        let mut stream = self.stream.clone();
        for call in calls.iter().flatten() {
            if !call.fails_by_far(self.setup.sigma, stream.draw(), bound) {
                self.foreseen = Some((guide.light, bound));
                return false;
            }
        }
        self.stream = stream;
        self.arrive(*vertex);
        true
    }

    fn scored(&mut self, value: f64) {
        if let Some(notes) = self.notes {
            notes.borrow_mut().score(value);
        }
    }

    fn weigh(&mut self, sum: &DensitySum) {
        if let Some(notes) = self.notes {
            // Parts of an earlier sum are left where no rival took part in this one.
            let [subdivision, last_vertex, connection] =
                if sum.rivals > 0.0 { self.parts } else { [0.0; 3] };
            let parts = [subdivision, last_vertex, connection, sum.extra_turns];
            notes.borrow_mut().weigh(parts.map(|part| part / sum.all));
        }
    }

    fn depart<B: WalkBands>(walk: &mut CameraWalk<'_, Self, B>) {
        walk.rivals.count = 0;
    }

    fn views(&self) -> u32 {
        self.setup.views
    }

    fn look<B: WalkBands>(
        walk: &mut CameraWalk<'_, Self, B>,
        ray: LookingRay,
        hit: &Hit,
        frame: &Frame,
        wo: DVec3,
    ) {
        // A walk that meets the body from outside again has no further rays.
        walk.rivals.view((walk.look_share < 1.0).then_some(ray));
        expected::score(walk, hit, frame, wo);
        walk.rivals.view(None);
    }

    fn is_expected<B: WalkBands>(
        walk: &CameraWalk<'_, Self, B>,
        way: Unscattered,
        light: usize,
        wi: DVec3,
    ) -> bool {
        expected::is_expected(walk, way, light, wi)
    }

    fn unidirectional(&self) -> [f64; 2] {
        self.takes_part(self.count)
    }

    fn densities<B: WalkBands>(
        walk: &mut CameraWalk<'_, Self, B>,
        exit: &WalkExit,
        light: usize,
        wi: DVec3,
    ) -> f64 {
        if walk.rivals.count == 0 {
            return 0.0;
        }
        let setup = walk.rivals.setup;
        let SneeOptions { last_vertex, strategies, .. } = &*setup.options;
        if last_vertex.is_none() && setup.specular.is_none() && !strategies.subdivides() {
            return 0.0;
        }
        let Some(guide) = setup.guides.iter().find(|guide| guide.light == light) else { return 0.0 };
        let end = End::new(walk, guide, exit, wi, walk.rivals.unidirectional(), None);
        if end.by_guide == 0.0 {
            return 0.0;
        }
        let x_j = walk.rivals.vertex(Slot::Latest);
        let dir = -exit.frame.to_world(exit.wo);
        let leg = Leg { dir, length: (exit.hit.point - x_j.point).length() };
        let by_last = last_vertex::density(walk, Slot::Latest, &leg, &end);
        let by_connection = specular::density(walk, Slot::Latest, &leg, exit, &end);
        let mut by_subdivision = 0.0;
        if walk.rivals.asks_for_subdivision() && walk.sees(exit) {
            let x_i = walk.rivals.vertex(Slot::Previous);
            if let Some(middle) = Middle::new(x_i.point, x_j.point, &exit.hit) {
                by_subdivision = subdivision::density(walk, Slot::Previous, &middle, exit, &end);
            }
        }
        walk.rivals.parts = [by_subdivision, by_last, by_connection];
        by_last + by_connection + by_subdivision
    }
}

/// Scores an end that the light-guided last vertex or the connection has drawn at the walk's latest vertex, which
/// sees the exit.
pub(super) fn score_guided<B: WalkBands>(
    walk: &mut CameraWalk<'_, Connections<'_>, B>,
    found: &GuidedEnd<'_>,
) {
    let GuidedEnd { guide, exit, leg, w_l, radiance } = found;
    let end = End::new(walk, guide, exit, *w_l, walk.rivals.unidirectional(), *radiance);
    if !end.counts() {
        return;
    }
    let x_j = walk.rivals.vertex(Slot::Latest);
    let by_last = last_vertex::density(walk, Slot::Latest, leg, &end);
    let by_connection = specular::density(walk, Slot::Latest, leg, exit, &end);
    let mut by_subdivision = 0.0;
    if walk.rivals.asks_for_subdivision() {
        let x_i = walk.rivals.vertex(Slot::Previous);
        if let Some(middle) = Middle::new(x_i.point, x_j.point, &exit.hit)
            && walk.sees_point(x_i.point, exit.hit.point)
        {
            by_subdivision = subdivision::density(walk, Slot::Previous, &middle, exit, &end);
        }
    }
    if walk.is_shadowed(exit.hit.point, exit.hit.face, *w_l) {
        return;
    }
    let mut bands = walk.bands.clone();
    bands.turn(&walk.scene.medium, x_j.point, x_j.arrival, leg.dir);
    let turn = PathTurn::to_boundary(x_j, leg.dir, leg.length);
    let by_photons = extra_turns::density(walk, &turn);
    bands.flight(&walk.scene.medium, leg.length, false);
    let rivals = by_last + by_connection + by_subdivision;
    let sum = (bands.density() + by_photons) * end.unidirectional + rivals;
    walk.rivals.parts = [by_subdivision, by_last, by_connection];
    let extra_turns = by_photons * end.unidirectional;
    walk.rivals.weigh(&DensitySum { all: sum, rivals, extra_turns });
    let score = walk.throughput * end.value / sum;
    walk.score_with(&bands, walk.history.class(), guide.light, score);
}

/// Scores a path whose edge from the walk's latest vertex is subdivided; the leg along which x_j was
/// drawn is known to be free.
pub(super) fn score_subdivided<B: WalkBands>(
    walk: &mut CameraWalk<'_, Connections<'_>, B>,
    found: &Subdivided<'_>,
) {
    let Subdivided { guide, x_j, middle, exit, w_l, radiance } = found;
    let x_i = walk.rivals.vertex(Slot::Latest);
    let end = End::new(walk, guide, exit, *w_l, walk.rivals.takes_part(2), *radiance);
    if !end.counts() {
        return;
    }
    let media = &walk.scene.medium;
    let mut bands = walk.bands.clone();
    bands.turn(media, x_i.point, x_i.arrival, middle.to_j.dir);
    bands.flight(media, middle.to_j.length, true);
    let drawn = WalkVertex { point: *x_j, arrival: middle.to_j.dir, walks: bands.density() };
    walk.rivals.hold(Slot::Drawn, drawn);
    bands.turn(media, *x_j, middle.to_j.dir, middle.to_k.dir);
    let Leg { dir, length } = middle.to_k;
    let by_photons = extra_turns::density(walk, &PathTurn::to_boundary(drawn, dir, length));
    bands.flight(media, middle.to_k.length, false);
    let by_subdivision = subdivision::density(walk, Slot::Latest, middle, exit, &end);
    let by_last = last_vertex::density(walk, Slot::Drawn, &middle.to_k, &end);
    let by_connection = specular::density(walk, Slot::Drawn, &middle.to_k, exit, &end);
    let survival = walk.bands.survival(&walk.medium);
    let rivals = by_last + by_connection + by_subdivision;
    let sum = (bands.density() + by_photons) * end.unidirectional + rivals;
    let value = walk.throughput * survival * end.value / sum;
    if value == 0.0 || walk.is_shadowed(exit.hit.point, exit.hit.face, *w_l) {
        return;
    }
    // The leg that closes the path: to x_i from the top, to x_k from the bottom; the other one is free.
    if !walk.sees_point(x_i.point, *x_j) || !walk.sees_point(*x_j, exit.hit.point) {
        return;
    }
    walk.rivals.parts = [by_subdivision, by_last, by_connection];
    let extra_turns = by_photons * end.unidirectional;
    walk.rivals.weigh(&DensitySum { all: sum, rivals, extra_turns });
    let mut history = walk.history;
    history.scatter();
    walk.score_with(&bands, history.class(), guide.light, value);
}
