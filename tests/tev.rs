//! Images on show while they are made, against a viewer of the tests' own that reads tev's packets.

use std::collections::BTreeMap;
use std::io::Read;
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use scatterproof::results::image::Picture;
use scatterproof::results::store::RecordFolder;

use super::work::{IMAGE, Ran, SENSOR, Work, edit, probe, replaced, same};

/// Images in the viewer.
#[derive(Clone, Debug, Default)]
struct Shown {
    images: BTreeMap<String, Image>,
    connections: usize,
    largest_packet: usize,
    /// Has every connection been closed?
    is_over: bool,
    /// A packet that no viewer would accept.
    errors: Vec<String>,
}

#[derive(Clone, Debug, Default)]
struct Image {
    width: usize,
    height: usize,
    channels: BTreeMap<String, Vec<f32>>,
    /// The first row's values of R, one entry a time that it was sent.
    first_rows: Vec<Vec<f32>>,
}

/// A program that understands tev's packets, at a port of its own.
struct Viewer {
    address: String,
    shown: Arc<Mutex<Shown>>,
}

impl Viewer {
    fn start() -> Viewer {
        let (listener, address) = listen();
        let shown: Arc<Mutex<Shown>> = Arc::default();
        let theirs = Arc::clone(&shown);
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                let mut stream = stream.expect("a connection");
                theirs.lock().expect("the images").connections += 1;
                while let Some(packet) = packet(&mut stream) {
                    let mut shown = theirs.lock().expect("the images");
                    if let Err(error) = shown.take(&packet) {
                        shown.errors.push(error);
                    }
                }
                theirs.lock().expect("the images").is_over = true;
            }
        });
        Viewer { address, shown }
    }

    fn shown(&self) -> Shown {
        self.shown.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// All that was sent, once the program has ended.
    fn end(&self) -> Shown {
        let begun = Instant::now();
        while !self.shown().is_over {
            assert!(begun.elapsed() < Duration::from_secs(60), "the connection was not closed");
            std::thread::sleep(Duration::from_millis(5));
        }
        let shown = self.shown();
        assert_eq!(shown.errors, [""; 0]);
        shown
    }
}

fn listen() -> (TcpListener, String) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("its number").to_string();
    (listener, address)
}

/// The next packet without its length.
fn packet(stream: &mut TcpStream) -> Option<Vec<u8>> {
    let mut length = [0; 4];
    stream.read_exact(&mut length).ok()?;
    let mut bytes = vec![0; (u32::from_le_bytes(length) as usize).checked_sub(4)?];
    stream.read_exact(&mut bytes).ok()?;
    Some(bytes)
}

/// Reads a packet from its front.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn bytes(&mut self, count: usize) -> Result<&'a [u8], String> {
        let (front, rest) = self.0.split_at_checked(count).ok_or("the packet ends early")?;
        self.0 = rest;
        Ok(front)
    }

    fn byte(&mut self) -> Result<u8, String> {
        Ok(self.bytes(1)?[0])
    }

    fn i32(&mut self) -> Result<usize, String> {
        let bytes = self.bytes(4)?.try_into().map_err(|_| "four bytes")?;
        usize::try_from(i32::from_le_bytes(bytes)).map_err(|_| "a negative number".into())
    }

    fn i64(&mut self) -> Result<usize, String> {
        let bytes = self.bytes(8)?.try_into().map_err(|_| "eight bytes")?;
        usize::try_from(i64::from_le_bytes(bytes)).map_err(|_| "a negative number".into())
    }

    fn text(&mut self) -> Result<String, String> {
        let end = self.0.iter().position(|b| *b == 0).ok_or("a text without an end")?;
        let text = String::from_utf8(self.bytes(end)?.to_vec()).map_err(|e| e.to_string())?;
        self.byte()?;
        Ok(text)
    }
}

impl Shown {
    fn take(&mut self, packet: &[u8]) -> Result<(), String> {
        self.largest_packet = self.largest_packet.max(packet.len() + 4);
        let mut fields = Fields(packet);
        let (kind, focus) = (fields.byte()?, fields.byte()?);
        let name = fields.text()?;
        if focus > 1 {
            return Err(format!("truth is {focus}"));
        }
        match kind {
            4 => self.create(name, &mut fields),
            6 => self.update(&name, &mut fields),
            _ => return Err(format!("a packet of type {kind}")),
        }?;
        let left = fields.0.len();
        if left == 0 { Ok(()) } else { Err(format!("{left} bytes too many")) }
    }

    fn create(&mut self, name: String, fields: &mut Fields) -> Result<(), String> {
        let (width, height, count) = (fields.i32()?, fields.i32()?, fields.i32()?);
        let mut image = Image { width, height, ..Image::default() };
        for _ in 0..count {
            let channel = fields.text()?;
            if channel.is_empty() || channel.starts_with(|c: char| c.is_ascii_digit()) {
                return Err(format!("tev reads a channel `{channel}` wrongly"));
            }
            image.channels.insert(channel, vec![0.0; width * height]);
        }
        self.images.insert(name, image);
        Ok(())
    }

    fn update(&mut self, name: &str, fields: &mut Fields) -> Result<(), String> {
        let image = self.images.get_mut(name).ok_or(format!("`{name}` was not created"))?;
        let count = fields.i32()?;
        let names = (0..count).map(|_| fields.text()).collect::<Result<Vec<_>, _>>()?;
        let [x, y, width, height] = [fields.i32()?, fields.i32()?, fields.i32()?, fields.i32()?];
        if x + width > image.width || y + height > image.height || width * height == 0 {
            return Err(format!("{width}x{height} pixels at {x}, {y}"));
        }
        let offsets = (0..count).map(|_| fields.i64()).collect::<Result<Vec<_>, _>>()?;
        let strides = (0..count).map(|_| fields.i64()).collect::<Result<Vec<_>, _>>()?;
        let last = |c: usize| offsets[c] + (width * height - 1) * strides[c];
        let values = fields.bytes(4 * (0..count).map(|c| last(c) + 1).max().unwrap_or(0))?;
        let value = |i: usize| f32::from_le_bytes([0, 1, 2, 3].map(|k| values[4 * i + k]));
        for (c, channel) in names.iter().enumerate() {
            let plane = image.channels.get_mut(channel).ok_or(format!("no channel `{channel}`"))?;
            for pixel in 0..width * height {
                let at = (y + pixel / width) * image.width + x + pixel % width;
                plane[at] = value(offsets[c] + pixel * strides[c]);
            }
            if channel == "R" && y == 0 {
                image.first_rows.push(plane[..image.width].to_vec());
            }
        }
        Ok(())
    }
}

/// Expected images of the record of `results/x`, by name and channel.
fn recorded(work: &Work) -> BTreeMap<String, BTreeMap<String, Vec<f32>>> {
    let stored = RecordFolder::new(work.path("results/x")).read().expect("a record");
    let f32s = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x as f32).collect::<Vec<f32>>();
    let mut images = BTreeMap::new();
    for cell in &stored.record.cells {
        for run in &cell.runs {
            let picture = Picture::of(&stored, run).expect("an image");
            let mut channels = BTreeMap::new();
            for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
                channels.insert(name.to_string(), f32s(&mut picture.rgb().map(|rgb| rgb[c])));
            }
            for (b, band) in stored.record.bands.iter().enumerate() {
                channels.insert(format!("mean.{}", band.name), f32s(&mut picture.mean(b)));
                channels.insert(format!("std_error.{}", band.name), f32s(&mut picture.std_error(b)));
            }
            images.insert(format!("x/{}/{}", cell.label, run.estimator), channels);
        }
    }
    images
}

/// The viewer shows the record of `results/x`, whole.
fn shows_the_record(work: &Work, shown: &Shown) {
    let expected = recorded(work);
    let names = |of: Vec<&String>| of.into_iter().cloned().collect::<Vec<_>>();
    assert_eq!(names(shown.images.keys().collect()), names(expected.keys().collect()));
    for (name, channels) in &expected {
        let image = &shown.images[name];
        assert_eq!(names(image.channels.keys().collect()), names(channels.keys().collect()));
        for (channel, values) in channels {
            assert!(image.channels[channel] == *values, "{name}: {channel} is not what the record has");
        }
    }
}

fn said(ran: &Ran, what: &str) -> usize {
    ran.stderr().matches(what).count()
}

/// Two cells, bands that are named by digits, two estimators.
fn spectral() -> String {
    let text =
        edit("bands = { rgb = {} }", "bands = { spectral = { from_nm = 400, to_nm = 700, count = 3 } }");
    text + "[[sweep]]\nkey = \"object.medium.coefficients.g\"\nvalues = [0.0, 0.5]\n"
}

#[test]
fn a_viewer_shows_what_the_record_has_and_changes_nothing() {
    let (work, alone) = (Work::with(&spectral()), Work::with(&spectral()));
    let viewer = Viewer::start();
    let ran = work.run(&format!("run x.toml -q --block-passes 7 --tev {}", viewer.address));
    ran.exits(0).check(said(&ran, "tev") == 0, "nothing is said of the viewer");
    let shown = viewer.end();
    shows_the_record(&work, &shown);
    let image = &shown.images["x/0.5/mis"];
    assert_eq!((image.width, image.height, image.channels.len()), (12, 12, 9));
    assert!(image.channels["mean.400-500nm"].iter().any(|x| *x > 0.0));
    alone.run("run x.toml -q").exits(0);
    same(&work.record("results"), &alone.record("results"), "with and without a viewer");

    // Complete already: nothing is run, all is shown.
    let viewer = Viewer::start();
    work.run(&format!("run x.toml -q --tev {}", viewer.address)).exits(0);
    shows_the_record(&work, &viewer.end());
}

#[test]
fn images_change_while_they_are_made() {
    let work = Work::with(&edit("budget.passes = 100", "budget.passes = 100_000_000"));
    let viewer = Viewer::start();
    let begun = Instant::now();
    let mut started = work.start(&format!("run x.toml -q --tev {}", viewer.address));
    let rows =
        || viewer.shown().images.get("x/base/mis").map_or(vec![], |image| image.first_rows.clone());
    started.wait_until("three images were seen", || rows().len() >= 3);
    let seconds = begun.elapsed().as_secs_f64();
    started.signal("INT");
    started.end().exits(130);
    let rows = rows();
    assert!(rows[0] != rows[1] && rows[1] != rows[2], "{rows:?}");
    assert!(rows.iter().flatten().all(|x| x.is_finite()));
    assert!(rows.len() as f64 <= 3.0 + 2.0 * seconds, "{} images in {seconds} s", rows.len());
    // Going on from the state that was kept, it is shown from there on.
    let viewer = Viewer::start();
    let mut started = work.start(&format!("run x.toml -q --tev {}", viewer.address));
    started.wait_until("an image was seen", || viewer.shown().images.contains_key("x/base/mis"));
    started.signal("INT");
    started.end().exits(130);
    assert_eq!(viewer.end().errors, [""; 0]);
}

#[test]
fn several_files_have_one_connection() {
    let work = Work::with(&edit("budget.passes = 100", "budget.passes = 4"));
    work.write("y.toml", &replaced(IMAGE, "name = \"x\"", "name = \"y\""));
    let flux = probe();
    work.write("z.toml", &replaced(&flux, "name = \"x\"", "name = \"z\""));
    let viewer = Viewer::start();
    let ran = work.run(&format!("run x.toml y.toml z.toml -q --tev {}", viewer.address));
    ran.exits(0).complains("note: `z` has no image: tev cannot show it");
    ran.check(said(&ran, "tev") == 1, "and nothing else");
    let shown = viewer.end();
    assert_eq!(shown.connections, 1);
    let names: Vec<_> = shown.images.keys().map(String::as_str).collect();
    assert_eq!(names, ["x/base/analog", "x/base/mis", "y/base/analog", "y/base/mis"]);
}

#[test]
fn a_missing_viewer_costs_nothing() {
    let work = Work::with(&edit("budget.passes = 100", "budget.passes = 4"));
    let (listener, address) = listen();
    drop(listener);
    let ran = work.run(&format!("run x.toml -q --tev {address}"));
    let what = format!("no tev viewer at {address} (connection refused): start tev, or leave --tev out");
    ran.exits(0).says("report: ").check(said(&ran, &what) == 1, "said once");

    for (wrong, code) in [("x.toml", 2), ("127.0.0.1", 2), ("127.0.0.1:x", 2)] {
        let ran = work.run(&format!("run x.toml --tev {wrong}"));
        ran.exits(code).complains("HOST:PORT is needed, as 127.0.0.1:14158");
    }
}

/// An image of more bytes than the system keeps for a connection, quickly made.
fn large() -> String {
    let text = edit(SENSOR, &SENSOR.replace("[12, 12]", "[600, 500]"));
    let text = replaced(&text, "albedo = [0.9, 0.8, 0.7]", "albedo = 0.1");
    replaced(&text, "budget.passes = 100", "budget.passes = 2")
}

#[test]
fn a_viewer_that_hangs_stalls_nothing() {
    let work = Work::with(&large());
    let (listener, address) = listen();
    let ran = work.run(&format!("run x.toml -q --tev {address}"));
    drop(listener);
    let what = format!("tev at {address} takes no more images (it took nothing for 3 s)");
    ran.exits(0).says("report: ").check(said(&ran, &what) == 1, "said once");
    ran.check(said(&ran, "tev") == 1, "and nothing else");
}

#[test]
fn a_viewer_that_goes_is_missed_once() {
    let (work, alone) = (Work::with(&large()), Work::with(&large()));
    let (listener, address) = listen();
    let closes = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().expect("a connection");
        packet(&mut stream).expect("a packet")
    });
    let ran = work.run(&format!("run x.toml -q --tev {address}"));
    assert_eq!(closes.join().expect("a packet")[0], 4, "an image is created first");
    let what = format!("tev at {address} takes no more images (");
    ran.exits(0).says("report: ").check(said(&ran, &what) == 1, "said once");
    ran.check(said(&ran, "tev") == 1, "and nothing else");
    alone.run("run x.toml -q").exits(0);
    same(&work.record("results"), &alone.record("results"), "with a viewer that went, and without");
}

#[test]
fn packets_of_large_images_are_small() {
    let work = Work::with(&large());
    let viewer = Viewer::start();
    work.run(&format!("run x.toml -q --tev {}", viewer.address)).exits(0);
    let shown = viewer.end();
    shows_the_record(&work, &shown);
    assert!((500_000..1_000_000).contains(&shown.largest_packet), "{} bytes", shown.largest_packet);
}
