//! Live view: which images are sent to a viewer while they are rendered, and when.
//!
//! The collector makes an image of the passes that it has in order, from a copy: nothing here changes a
//! record. It makes at most two images per second, only after the previous image was taken for sending, and
//! spends at most a twentieth of its time on them. A separate thread sends images, and at most one image
//! waits, so that a slow or hanging viewer delays nothing. If the last image of a job cannot be queued, it is
//! sent when all jobs are done.

use std::collections::BTreeMap;
use std::io;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::job::{Block, Finished, Job, Passes};
use super::tev::{Address, Connection, TevImage};
use crate::results::image::Picture;
use crate::results::npy::Array;
use crate::results::record::Band;
use crate::stats::moments::ImageMoments;

/// Time between two images of jobs under way.
const EVERY: Duration = Duration::from_millis(500);
/// An image is due when this many times what the last one took has passed.
const SHARE: u32 = 20;
/// How long a finished run waits at most for a viewer to take its last images.
const LAST_WAIT: Duration = Duration::from_secs(10);

/// Connection to a viewer, for all experiments of one call.
#[derive(Debug)]
pub(crate) struct Live {
    address: Address,
    shared: Arc<Shared>,
    pace: Mutex<Pace>,
}

#[derive(Debug, Default)]
struct Shared {
    post: Mutex<Post>,
    changed: Condvar,
}

/// Mailbox between the collector and the thread that sends.
#[derive(Debug, Default)]
struct Post {
    waiting: Option<TevImage>,
    is_sending: bool,
    /// Why nothing can be sent any more, until it has been reported.
    lost: Option<String>,
    is_closed: bool,
}

/// When an image was last made, and how long that took.
#[derive(Debug, Default)]
struct Pace(Option<(Instant, Duration)>);

impl Pace {
    fn is_due(&self, now: Instant) -> bool {
        self.0.is_none_or(|(last, took)| now.duration_since(last) >= EVERY.max(SHARE * took))
    }
}

impl Live {
    /// Connects to a viewer.
    ///
    /// # Errors
    /// No viewer answers; the message is for the user.
    pub(crate) fn connect(address: &Address) -> Result<Live, String> {
        let connection = Connection::open(address).map_err(|error| {
            let why = reason(&error);
            format!("no tev viewer at {address} ({why}): start tev, or leave --tev out; the run continues without")
        })?;
        let shared = Arc::new(Shared::default());
        let sending = Arc::clone(&shared);
        let sends = std::thread::Builder::new().spawn(move || sending.send_all(connection));
        sends.map_err(|error| format!("tev is left out: could not start a thread: {error}"))?;
        Ok(Live { address: address.clone(), shared, pace: Mutex::default() })
    }

    /// Reports once that the viewer has gone.
    pub(crate) fn complaint(&self) -> Option<String> {
        let why = self.shared.post().lost.take()?;
        Some(format!("tev at {} takes no more images ({why}): the run continues without", self.address))
    }

    /// Hands an image to the sending thread, unless another one waits.
    fn offer(&self, frame: impl FnOnce() -> TevImage) -> bool {
        let is_free = |post: &Post| post.waiting.is_none() && !post.is_closed;
        if !is_free(&self.shared.post()) {
            return false;
        }
        let frame = frame(); // takes time, in which the other thread may send
        self.shared.post().waiting = Some(frame);
        self.shared.changed.notify_all();
        true
    }

    /// Waits until no image waits, and none is under way where `all` are meant; false where that lasts
    /// too long.
    fn wait(&self, until: Instant, all: bool) -> bool {
        let left = until.saturating_duration_since(Instant::now());
        let is_busy =
            |post: &mut Post| !post.is_closed && (post.waiting.is_some() || (all && post.is_sending));
        let waited = self.shared.changed.wait_timeout_while(self.shared.post(), left, is_busy);
        !waited.unwrap_or_else(PoisonError::into_inner).1.timed_out()
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        self.shared.post().is_closed = true;
        self.shared.changed.notify_all();
    }
}

impl Shared {
    fn post(&self) -> MutexGuard<'_, Post> {
        self.post.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sends waiting images until either end is dropped.
    fn send_all(&self, mut connection: Connection) {
        let mut created = BTreeMap::new();
        while let Some(frame) = self.take() {
            let sent = send(&mut connection, &frame, &mut created);
            let mut post = self.post();
            post.is_sending = false;
            if let Err(error) = sent {
                (post.lost, post.waiting, post.is_closed) = (Some(reason(&error)), None, true);
            }
            self.changed.notify_all();
        }
    }

    fn take(&self) -> Option<TevImage> {
        let is_idle = |post: &mut Post| post.waiting.is_none() && !post.is_closed;
        let post = self.changed.wait_while(self.post(), is_idle);
        let mut post = post.unwrap_or_else(PoisonError::into_inner);
        let frame = post.waiting.take();
        post.is_sending = frame.is_some();
        frame
    }
}

/// Width, height and channels of an image that a viewer has.
type Format = (usize, usize, Vec<String>);

/// Sends an image; first has it created, where the viewer has none of its name and shape.
fn send(
    connection: &mut Connection,
    frame: &TevImage,
    created: &mut BTreeMap<String, Format>,
) -> io::Result<()> {
    let channels = frame.channels.iter().map(|(name, _)| name.clone()).collect();
    let shape = (frame.width, frame.height, channels);
    if created.get(&frame.name) != Some(&shape) {
        connection.send(&frame.create(created.is_empty()))?;
        created.insert(frame.name.clone(), shape);
    }
    frame.updates().try_for_each(|packet| connection.send(&packet))?;
    connection.check()
}

/// Why a connection failed, without the system's numbers.
fn reason(error: &io::Error) -> String {
    if error.raw_os_error().is_some() { error.kind().to_string() } else { error.to_string() }
}

/// The images of one experiment in the live view.
#[derive(Clone, Copy)]
pub(crate) struct Show<'a> {
    /// Viewer that images are sent to.
    pub live: &'a Live,
    /// The experiment's name.
    pub experiment: &'a str,
    /// Bands of the experiment.
    pub bands: &'a [Band],
    /// Jobs whose images are shown.
    pub jobs: &'a [Job],
}

impl Show<'_> {
    /// Whether any job has an image.
    pub(crate) fn has_images(&self) -> bool {
        self.jobs.iter().any(|job| image_size(job).is_some())
    }

    /// Offers the image of a job under way.
    pub(crate) fn under_way(&self, job: usize, done: &Block) {
        let Some(size) = image_size(&self.jobs[job]) else { return };
        let mut pace = self.live.pace.lock().unwrap_or_else(PoisonError::into_inner);
        let begun = Instant::now();
        if !pace.is_due(begun) {
            return;
        }
        if done.pixels.nodes().is_empty() {
            return;
        }
        if self.live.offer(|| self.frame(job, size, &done.pixels.so_far().unwrap_or_default())) {
            let now = Instant::now();
            pace.0 = Some((now, now - begun));
        }
    }

    /// Offers the last image of a finished job; false where its image has to be sent later.
    pub(crate) fn done(&self, job: usize, finished: &Finished) -> bool {
        image_size(&self.jobs[job])
            .is_none_or(|size| self.live.offer(|| self.frame(job, size, &finished.image)))
    }

    /// All jobs are done: sends the images of those that are `owed`. Returns a message where some
    /// were not sent.
    pub(crate) fn close(&self, owed: &[(usize, &Finished)]) -> Option<String> {
        let until = Instant::now() + LAST_WAIT;
        let mut sent = 0;
        for &(job, finished) in owed {
            if !self.live.wait(until, false) || !self.done(job, finished) {
                break;
            }
            sent += 1;
        }
        if self.live.wait(until, true) {
            return None; // all is sent, or the viewer has gone, which is reported elsewhere
        }
        let (left, seconds) = (owed.len() - sent, LAST_WAIT.as_secs());
        let address = &self.live.address;
        Some(format!(
            "tev at {address} is slow: after {seconds} s the last image is still under way and {left} more \
             were not sent; the results have them all"
        ))
    }

    /// An image with the channels of the run's OpenEXR file. Their names end with the band, as tev reads
    /// a name that begins with a digit (a bin of wavelengths) wrongly, and shows R, G, B of one head
    /// together.
    fn frame(&self, job: usize, (width, height): (usize, usize), image: &ImageMoments) -> TevImage {
        let data = image.mean.iter().copied().chain(image.std_error()).collect();
        let pixels = Array::new(vec![2, height, width, self.bands.len()], data);
        let picture = Picture::new(self.bands, &pixels);
        let rgb = |c: usize| picture.rgb().map(|rgb| rgb[c] as f32).collect();
        let mut channels: Vec<(String, Vec<f32>)> =
            ["R", "G", "B"].iter().enumerate().map(|(c, name)| (name.to_string(), rgb(c))).collect();
        for (b, band) in self.bands.iter().enumerate() {
            let mean = picture.mean(b).map(|x| x as f32).collect();
            channels.push((format!("mean.{}", band.name), mean));
        }
        for (b, band) in self.bands.iter().enumerate() {
            let std_error = picture.std_error(b).map(|x| x as f32).collect();
            channels.push((format!("std_error.{}", band.name), std_error));
        }
        let name = self.jobs[job].label.replacen(" / ", "/", 1);
        TevImage { name: format!("{}/{name}", self.experiment), width, height, channels }
    }
}

/// Columns and rows of a job's image, where its record has one.
fn image_size(job: &Job) -> Option<(usize, usize)> {
    job.passes().and_then(Passes::image_size)
}

#[cfg(test)]
mod tests {
    use super::*;

    // Half a second apart; further where an image takes long.
    #[test]
    fn images_take_a_twentieth_of_the_time() {
        let start = Instant::now();
        let after = |ms| start + Duration::from_millis(ms);
        assert!(Pace(None).is_due(start));
        let pace = |ms| Pace(Some((start, Duration::from_millis(ms))));
        assert_eq!([499, 500].map(|ms| pace(1).is_due(after(ms))), [false, true]);
        assert_eq!([1999, 2000].map(|ms| pace(100).is_due(after(ms))), [false, true]);
    }

    fn frame(name: &str) -> TevImage {
        TevImage { name: name.into(), width: 1, height: 1, channels: vec![("R".into(), vec![0.5])] }
    }

    // No thread sends: the first image waits, the second is not even made.
    #[test]
    fn one_image_waits() {
        let address = Address::USUAL.parse().expect("an address");
        let live = Live { address, shared: Arc::default(), pace: Mutex::default() };
        assert!(live.offer(|| frame("a")));
        assert!(!live.offer(|| panic!("no place for it")));
        assert!(!live.wait(Instant::now() + Duration::from_millis(5), false));
        assert_eq!(live.shared.take(), Some(frame("a")));
        let until = Instant::now() + Duration::from_millis(5);
        assert_eq!((live.wait(until, false), live.wait(until, true)), (true, false));
        assert!(live.offer(|| frame("b")));
        live.shared.post().is_closed = true;
        live.shared.post().waiting = None;
        assert_eq!((live.wait(until, true), live.offer(|| frame("c"))), (true, false));
    }
}
