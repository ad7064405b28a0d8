//! Random streams by key. The only module that uses `rand_pcg`.
//!
//! A key states *what* is sampled, never who runs it: experiment, cell, bands, estimator and stage are
//! hashed into 256 bits (`StreamKey::new`); pass, index (pixel or path) and purpose are mixed in on
//! top. The result seeds both words of the generator, because consecutive raw seeds or streams of a
//! PCG are measurably correlated. Number of threads, blocks, budgets and claims never enter.

use rand_pcg::Pcg64Dxsm;
use rand_pcg::rand_core::Rng;

/// What a stream's numbers are used for: adding a draw for one purpose never shifts another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Position on the sensor.
    Sensor = 1,
    /// The walk: distances, directions, lobes, roulette.
    Walk = 2,
    /// Numbers of light samples.
    Light = 3,
    /// Connections from medium vertices through the boundary.
    Connection = 4,
    /// The band that steers a walk shared by all.
    Hero = 5,
    /// Points of a surface with the light that enters there.
    Cloud = 6,
    /// Positions on the sensor at which lights are scored by expectation.
    View = 7,
    /// Directions that photons teach, and the walks that follow them.
    ExtraTurn = 8,
    /// Numbers of light samples on these.
    ExtraTurnLight = 9,
}

/// The key of one (experiment, cell, bands, estimator, stage).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StreamKey([u64; 4]);

/// The key of one pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PassKey {
    lanes: [u64; 2],
    tail: [u64; 2],
}

/// Odd constants that keep pass, index and purpose apart (digits of sqrt 2, sqrt 3, sqrt 5, sqrt 7).
const PASS: [u64; 2] = [0x6a09_e667_f3bc_c909, 0xbb67_ae85_84ca_a73b];
const INDEX: [u64; 2] = [0x3c6e_f372_fe94_f82b, 0xa54f_f53a_5f1d_36f1];

/// The finaliser of SplitMix64 (Steele, Lea & Flood 2014): a bijection of 64 bits.
#[inline]
fn mix(x: u64) -> u64 {
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

impl StreamKey {
    /// From a 256-bit hash of everything that names the sequence of passes.
    pub fn new(hash: [u8; 32]) -> StreamKey {
        let word = |i: usize| u64::from_le_bytes(std::array::from_fn(|b| hash[8 * i + b]));
        StreamKey([word(0), word(1), word(2), word(3)])
    }

    /// The key of a name: tests and benches are seeded by their names, so that nobody
    /// chooses a seed. FNV-1a over the text, four times with different offsets, finalised.
    pub fn named(name: &str) -> StreamKey {
        let lane = |offset: u64| {
            let start = 0xcbf2_9ce4_8422_2325 ^ mix(offset);
            mix(name.bytes().fold(start, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3)))
        };
        StreamKey([lane(1), lane(2), lane(3), lane(4)])
    }

    /// The key of the pass with this absolute number.
    pub fn pass(&self, pass: u64) -> PassKey {
        let [a, b, c, d] = self.0;
        PassKey {
            lanes: [
                mix(a ^ pass.wrapping_mul(PASS[0])),
                mix(b ^ pass.rotate_left(32).wrapping_mul(PASS[1])),
            ],
            tail: [c, d],
        }
    }
}

impl PassKey {
    /// The stream of path or pixel `index` for a purpose. Two 64-bit lanes, each a bijection of every
    /// one of its inputs, must both collide before two streams are the same.
    #[inline]
    pub fn stream(&self, index: u64, purpose: Purpose) -> Stream {
        #[cfg(test)]
        OPENED.with_borrow_mut(|opened| {
            opened.iter_mut().for_each(|all| all.push((*self, index, purpose)))
        });
        let purpose = purpose as u64;
        let x = mix(self.lanes[0] ^ index.wrapping_mul(INDEX[0]).wrapping_add(purpose << 56));
        let y = mix(self.lanes[1] ^ index.rotate_left(32).wrapping_mul(INDEX[1]).wrapping_sub(purpose));
        let state = [x ^ self.tail[0], mix(y ^ self.tail[1])];
        let increment = [mix(x.wrapping_add(self.tail[1])), y.wrapping_sub(self.tail[0])];
        Stream {
            generator: Pcg64Dxsm::new(join(state), join(increment)),
            draws: 0,
            #[cfg(test)]
            script: Default::default(),
        }
    }
}

/// A stream by its name: pass, index, purpose.
#[cfg(test)]
type OpenedStream = (PassKey, u64, Purpose);

#[cfg(test)]
thread_local! {
    /// Streams that this thread has opened, while an audit asks for them.
    static OPENED: std::cell::RefCell<Option<Vec<OpenedStream>>> = const { std::cell::RefCell::new(None) };
}

/// Every purpose.
#[cfg(test)]
pub(crate) const PURPOSES: [Purpose; 7] = [
    Purpose::Sensor,
    Purpose::Walk,
    Purpose::Light,
    Purpose::Connection,
    Purpose::Hero,
    Purpose::Cloud,
    Purpose::View,
];

/// The streams that the calling thread opens in `work`.
#[cfg(test)]
pub(crate) fn opened_by(work: impl FnOnce()) -> Vec<OpenedStream> {
    OPENED.set(Some(Vec::new()));
    work();
    OPENED.take().expect("set above")
}

fn join([high, low]: [u64; 2]) -> u128 {
    (u128::from(high) << 64) | u128::from(low)
}

/// A sequence of uniform numbers.
#[derive(Clone, Debug)]
pub struct Stream {
    generator: Pcg64Dxsm,
    draws: u64,
    /// Numbers that come before the generator's.
    #[cfg(test)]
    script: std::collections::VecDeque<f64>,
}

impl Stream {
    /// A stream that nothing is drawn from before another takes its place.
    pub(crate) fn zero() -> Stream {
        Stream {
            generator: Pcg64Dxsm::new(0, 0),
            draws: 0,
            #[cfg(test)]
            script: Default::default(),
        }
    }

    /// The next uniform number in [0, 1): the upper 53 bits, so every multiple of 2^-53.
    #[inline(always)]
    pub fn draw(&mut self) -> f64 {
        self.draws += 1;
        #[cfg(test)]
        if let Some(number) = self.script.pop_front() {
            return number;
        }
        (self.generator.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// The next 64 random bits.
    #[inline]
    pub fn draw_bits(&mut self) -> u64 {
        self.draws += 1;
        self.generator.next_u64()
    }

    /// The next two uniform numbers.
    #[inline]
    pub fn draw2(&mut self) -> [f64; 2] {
        [self.draw(), self.draw()]
    }

    /// The next three uniform numbers.
    #[inline]
    pub fn draw3(&mut self) -> [f64; 3] {
        [self.draw(), self.draw(), self.draw()]
    }

    /// Leaves out the next numbers.
    #[inline]
    pub(crate) fn skip(&mut self, numbers: u64) {
        (0..numbers).for_each(|_| _ = self.draw_bits());
    }

    /// How many numbers were drawn so far.
    pub fn draws(&self) -> u64 {
        self.draws
    }

    /// A stream that begins with these numbers.
    #[cfg(test)]
    pub(crate) fn scripted(numbers: &[f64]) -> Stream {
        let mut stream = StreamKey::named("scripted").pass(0).stream(0, Purpose::Connection);
        stream.script = numbers.iter().copied().collect();
        stream
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Value stability: these numbers may only change together with the numerical version.
    #[test]
    fn first_outputs_are_frozen() {
        let hash = std::array::from_fn(|i| 31u8.wrapping_add(i as u8 * 7));
        let mut stream = StreamKey::new(hash).pass(5).stream(7, Purpose::Walk);
        let got: Vec<u64> = (0..4).map(|_| stream.draw().to_bits()).collect();
        assert_eq!(got, FROZEN, "{got:#x?}");
    }

    const FROZEN: [u64; 4] =
        [4607173566107404283, 4606326434038641471, 4605347230709447812, 4601066195608706346];

    /// The audit: neighbouring passes, pixels and purposes, k-th draw against k-th draw.
    #[test]
    fn neighbouring_streams_are_independent() {
        let streams = 1 << 17;
        type Maker = fn(u64) -> Stream;
        let makers: [(&str, Maker); 4] = [
            ("pixels", |j| StreamKey::named("pixels").pass(3).stream(j, Purpose::Walk)),
            ("passes", |j| StreamKey::named("passes").pass(j).stream(9, Purpose::Walk)),
            ("high pixels", |j| StreamKey::named("high pixels").pass(0).stream(j << 24, Purpose::Light)),
            ("purposes", |j| {
                let purpose = PURPOSES[(j % 7) as usize];
                StreamKey::named("purposes").pass(j / 14).stream(j % 14 / 7, purpose)
            }),
        ];
        let mut tests = 0;
        let mut worst: f64 = 0.0;
        for (name, make) in makers {
            let draws: Vec<[f64; 16]> = (0..streams)
                .map(|j| {
                    let mut stream = make(j);
                    std::array::from_fn(|_| stream.draw())
                })
                .collect();
            for lag in [1, 2, 8, 512] {
                for k in 0..16 {
                    let pairs: Vec<(f64, f64)> =
                        draws.iter().zip(&draws[lag..]).map(|(a, b)| (a[k], b[k])).collect();
                    for z in [correlation_z(&pairs), chi_square_z(&pairs)] {
                        assert!(z.abs() < 5.5, "{name} lag {lag} draw {k}: z = {z}");
                        worst = worst.max(z.abs());
                        tests += 1;
                    }
                }
            }
        }
        // Of 512 standard normal z the largest is below 2 with probability 1e-10: a battery that
        // reports less has stopped looking.
        assert!(tests == 512 && worst > 2.0, "{tests} tests, largest |z| {worst}");
    }

    fn correlation_z(pairs: &[(f64, f64)]) -> f64 {
        let sum: f64 = pairs.iter().map(|(a, b)| (a - 0.5) * (b - 0.5)).sum();
        // Var[(a - 1/2)(b - 1/2)] = 1/144.
        12.0 * sum / (pairs.len() as f64).sqrt()
    }

    fn chi_square_z(pairs: &[(f64, f64)]) -> f64 {
        let mut bins = [0u32; 256];
        for (a, b) in pairs {
            bins[(a * 16.0) as usize * 16 + (b * 16.0) as usize] += 1;
        }
        let expected = pairs.len() as f64 / 256.0;
        let chi2: f64 = bins.iter().map(|&n| (f64::from(n) - expected).powi(2) / expected).sum();
        (chi2 - 255.0) / 510f64.sqrt()
    }

    #[test]
    fn no_two_streams_of_a_run_start_alike() {
        let mut starts: Vec<(u64, u64)> = (0..300_000u64)
            .map(|j| {
                let purpose = PURPOSES[(j % 7) as usize];
                let mut stream = StreamKey::named("pixels").pass(j / 7168).stream(j % 7168 / 7, purpose);
                (stream.draw().to_bits(), stream.draw().to_bits())
            })
            .collect();
        starts.sort_unstable();
        starts.dedup();
        assert_eq!(starts.len(), 300_000);
    }

    #[test]
    fn draws_are_counted() {
        let mut stream = StreamKey::named("pixels").pass(0).stream(0, Purpose::Sensor);
        stream.draw3();
        stream.draw2();
        assert_eq!(stream.draws(), 5);
    }
}
