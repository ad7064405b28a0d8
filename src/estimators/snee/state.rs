//! State that a walk carries for connections.

use std::cell::RefCell;

use super::BandSetup;
use super::LastVertex;
use super::end::Call;
use super::guess::Guess;
use super::guide::Guide;
use super::learned_calls::{CallNotes, CalledTechnique};
use crate::estimators::bands::WalkBands;
use crate::estimators::connection::{Root, SolverWork};
use crate::estimators::field::Path;
use crate::estimators::vertices::{WalkExit, WalkVertex};
use crate::estimators::walk::{CameraWalk, LookingRay, Meeting};
use crate::math::DVec3;
use crate::optics::boundary::Boundary;
use crate::sampling::discrete::choose_share;
use crate::sampling::stream::{Purpose, Stream};

/// Which of the vertices that are held.
#[derive(Clone, Copy, Debug)]
pub(super) enum Slot {
    /// The walk's vertex before the last.
    Previous,
    /// The walk's last vertex.
    Latest,
    /// The vertex by which subdivision continues from the walk's last.
    Drawn,
}

/// A vertex with its cached values.
#[derive(Clone, Copy, Debug)]
struct Held {
    vertex: WalkVertex,
    /// Cached specular guess for the last guide.
    guess: Option<(usize, Option<Guess>)>,
    /// Cached lower bound of that guess's distance for the last guide, mm.
    least: Option<(usize, f64)>,
}

/// All calls at a vertex, where there is one guide and no connection.
pub(super) struct AllCalls<'a> {
    pub guide: &'a Guide,
    /// In the order of their draws: of the light-guided last vertex and of subdivision.
    pub calls: [Option<Call>; 2],
}

/// A direction in which a path leaves a medium vertex, and meets the boundary.
#[derive(Clone, Copy, Debug)]
pub(super) struct PathTurn {
    pub vertex: WalkVertex,
    pub dir: DVec3,
    /// The distance from the vertex to the boundary, mm, and the latest meeting; `None` until the boundary is met.
    pub met: Option<(f64, Meeting)>,
}

impl PathTurn {
    /// A turn that leads to the boundary, `length` mm away.
    pub(super) fn to_boundary(vertex: WalkVertex, dir: DVec3, length: f64) -> PathTurn {
        PathTurn { vertex, dir, met: Some((length, Meeting::First)) }
    }

    /// The path has met the boundary, `t` mm from where the flight began.
    pub(super) fn reach(&mut self, t: f64) {
        self.met = match self.met {
            None => Some((t, Meeting::First)),
            Some((length, _)) => Some((length, Meeting::Later)),
        };
    }
}

/// State of a path that photons guide.
#[derive(Clone, Debug)]
pub(super) struct ExtraTurns {
    /// Of directions with what follows, and of the light samples there.
    pub streams: [Stream; 2],
    /// At the latest medium vertex.
    pub latest: Option<PathTurn>,
}

impl ExtraTurns {
    pub(super) fn of_path(path: &Path) -> ExtraTurns {
        let stream = |purpose| path.key.stream(path.index as u64, purpose);
        let streams = [stream(Purpose::ExtraTurn), stream(Purpose::ExtraTurnLight)];
        ExtraTurns { streams, latest: None }
    }
}

/// State that a walk carries for connections.
pub(super) struct Connections<'a> {
    pub setup: &'a BandSetup,
    pub stream: Stream,
    /// What can be passed; `None` where every vertex is called one by one.
    pub all_calls: Option<AllCalls<'a>>,
    /// Vertices held.
    held: [Held; 3],
    /// The bound of the next vertex, where it is known before.
    pub foreseen: Option<(usize, f64)>,
    /// Index of the latest vertex, 0 or 1; the other is that of the one before, and the last that of the drawn one. So the
    /// walk's vertices are not copied from slot to slot.
    latest: usize,
    /// Medium vertices since the boundary was last met.
    pub count: u32,
    /// Only the first edge is subdivided, and only the second vertex is a last one.
    pub is_edge_alone: bool,
    /// Cached visibility between the vertex before the last and the last exit.
    seen: Option<(DVec3, bool)>,
    /// Where photons guide.
    pub extra_turns: Option<Box<ExtraTurns>>,
    /// Memory for the roots of a connection.
    pub roots: Vec<Root>,
    /// What subdivision, the last vertex and the connection add to the sum of densities that was formed last.
    pub parts: [f64; 3],
    /// What a warm-up writes down.
    pub notes: Option<&'a RefCell<CallNotes>>,
}

impl<'a> AllCalls<'a> {
    fn of(setup: &'a BandSetup, boundary: &Boundary) -> Option<AllCalls<'a>> {
        let ([guide], None) = (&setup.guides[..], &setup.specular) else { return None };
        let options = &setup.options;
        let last_vertex = options.last_vertex.as_ref().map(LastVertex::call);
        let subdivision = options.strategies.subdivides().then(|| options.call_for(boundary, guide));
        Some(AllCalls { guide, calls: [last_vertex, subdivision] })
    }
}

impl<'a> Connections<'a> {
    /// Of a path, with its own stream.
    pub(super) fn of_path(setup: &'a BandSetup, path: &Path) -> Connections<'a> {
        let stream = path.key.stream(path.index as u64, Purpose::Connection);
        let boundary = &path.field.scene.boundary[path.band];
        let extra_turns = setup.photons.as_ref().map(|_| Box::new(ExtraTurns::of_path(path)));
        let all_calls = AllCalls::of(setup, boundary);
        Connections { all_calls, extra_turns, ..Connections::new(setup, stream) }
    }

    pub(super) fn new(setup: &'a BandSetup, stream: Stream) -> Connections<'a> {
        let nowhere = WalkVertex { point: DVec3::NAN, arrival: DVec3::Z, walks: 1.0 };
        let held = [Held { vertex: nowhere, guess: None, least: None }; 3];
        Connections {
            setup,
            stream,
            all_calls: None,
            held,
            foreseen: None,
            latest: 0,
            count: 0,
            is_edge_alone: false,
            seen: None,
            extra_turns: None,
            roots: Vec::new(),
            parts: [0.0; 3],
            notes: None,
        }
    }

    /// What the walk scores next belongs to a call of this technique; to the walk itself where there is none.
    #[inline]
    pub(super) fn begin(&self, technique: Option<CalledTechnique>) {
        if let Some(notes) = self.notes {
            notes.borrow_mut().begin(technique);
        }
    }

    /// What is scored next is what this sensor ray sees, one of several of the walk; what the walk itself scores where there is
    /// none.
    #[inline]
    pub(super) fn view(&self, ray: Option<LookingRay>) {
        if let Some(notes) = self.notes {
            notes.borrow_mut().view(ray);
        }
    }

    /// Whether subdivision draws paths like the one whose densities are asked for, which ends at the latest vertex. A warm-up
    /// takes down that its density is asked for.
    #[inline]
    pub(super) fn asks_for_subdivision(&self) -> bool {
        let asks = self.count >= 2 && self.setup.options.strategies.subdivides();
        if let Some(notes) = self.notes.filter(|_| asks) {
            notes.borrow_mut().ask();
        }
        asks
    }

    /// A connection was searched for.
    pub(super) fn search(&self, work: &SolverWork) {
        if let Some(notes) = self.notes {
            notes.borrow_mut().search(work);
        }
    }

    /// The walk has come to a new medium vertex.
    #[inline]
    pub(super) fn arrive(&mut self, vertex: WalkVertex) {
        self.latest = 1 - self.latest;
        self.held[self.latest] = Held { vertex, guess: None, least: self.foreseen.take() };
        self.count += 1;
    }

    #[inline]
    fn index(&self, slot: Slot) -> usize {
        match slot {
            Slot::Previous => 1 - self.latest,
            Slot::Latest => self.latest,
            Slot::Drawn => 2,
        }
    }

    /// Puts a new vertex into a slot.
    #[inline]
    pub(super) fn hold(&mut self, slot: Slot, vertex: WalkVertex) {
        self.held[self.index(slot)] = Held { vertex, guess: None, least: None };
    }

    #[inline]
    pub(super) fn vertex(&self, slot: Slot) -> WalkVertex {
        self.held[self.index(slot)].vertex
    }

    /// A guide by its probability; without a draw where there is one alone.
    pub(super) fn choose_guide(&mut self) -> Option<&'a Guide> {
        let guides = &self.setup.guides;
        match &guides[..] {
            [only] => Some(only),
            _ => {
                let shares = guides.iter().map(|guide| guide.choice);
                choose_share(shares, self.stream.draw()).map(|(index, _)| &guides[index])
            }
        }
    }

    /// Which of BSDF and light sampling take part at the end of a path with this many medium vertices
    /// since the boundary.
    pub(super) fn takes_part(&self, count: u32) -> [f64; 2] {
        let strategies = &self.setup.options.strategies;
        let share = |takes_part: bool| if takes_part { 1.0 } else { 0.0 };
        if count >= 2 { [share(strategies.bsdf), share(strategies.light)] } else { [1.0, 1.0] }
    }
}

impl<B: WalkBands> CameraWalk<'_, Connections<'_>, B> {
    /// The specular guess at a vertex for a guide, found once.
    pub(super) fn guess(&mut self, slot: Slot, guide: &Guide) -> Option<Guess> {
        let index = self.rivals.index(slot);
        let Held { vertex, guess, .. } = self.rivals.held[index];
        match guess {
            Some((light, guess)) if light == guide.light => guess,
            _ => {
                let guess = Guess::new(self, vertex.point, guide.axis);
                if let Some(notes) = self.rivals.notes {
                    notes.borrow_mut().guess();
                }
                self.rivals.held[index].guess = Some((guide.light, guess));
                guess
            }
        }
    }

    /// A lower bound of the distance of the specular guess at the latest vertex for a guide, mm, found once.
    #[inline]
    pub(super) fn least_distance(&mut self, guide: &Guide) -> f64 {
        let Held { vertex, least, .. } = &mut self.rivals.held[self.rivals.latest];
        match *least {
            Some((light, distance)) if light == guide.light => distance,
            _ => {
                let distance = self.scene.shape.clearance_within(vertex.point, &guide.refracted);
                *least = Some((guide.light, distance));
                distance
            }
        }
    }

    /// Whether the vertex before the last sees an exit: a probe in its direction would have met it
    /// first.
    pub(super) fn sees(&mut self, exit: &WalkExit) -> bool {
        match self.rivals.seen {
            Some((point, sees)) if point == exit.hit.point => sees,
            _ => {
                let previous = self.rivals.vertex(Slot::Previous);
                let sees = self.sees_point(previous.point, exit.hit.point);
                self.rivals.seen = Some((exit.hit.point, sees));
                sees
            }
        }
    }
}
