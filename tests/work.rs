//! A temporary folder in which the program runs as a user would run it.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// A small experiment with an image; every test replaces a part.
pub const IMAGE: &str = r#"name = "x"
seed = 7
bands = { rgb = {} }
object.shape.sphere = { radius_mm = 1.0 }
object.boundary.rough = { distribution = "ggx", alpha = 0.3, eta = 1.3 }
object.medium.coefficients = { sigma_t_per_mm = [1, 2, 4], albedo = [0.9, 0.8, 0.7], g = 0.2 }
sensor.orthographic = { resolution = [12, 12], center_mm = [0, 0, 3], toward = [0, 0, -1], up = [0, 1, 0], width_mm = 2.2 }
budget.passes = 100
[[light]]
name = "sun"
directional = { toward = [1, 0, 1], irradiance = 1.0 }
[[light]]
name = "sky"
environment = { radiance = 0.2 }
[[estimator]]
name = "mis"
path = {}
[[estimator]]
name = "analog"
path = { roulette = { analog = {} } }
"#;

/// The sensor's line of [`IMAGE`].
pub const SENSOR: &str = "sensor.orthographic = { resolution = [12, 12], center_mm = [0, 0, 3], toward = [0, 0, \
                          -1], up = [0, 1, 0], width_mm = 2.2 }";

/// The same light and body, seen along one ray.
pub fn probe() -> String {
    edit(SENSOR, "sensor.probe = { point_mm = [0.2, 0, 3], toward = [0, 0, -1], paths_per_pass = 64 }")
}

/// [`IMAGE`] with `old` replaced.
pub fn edit(old: &str, new: &str) -> String {
    replaced(IMAGE, old, new)
}

/// A text with `old` replaced, which must be in it.
pub fn replaced(text: &str, old: &str, new: &str) -> String {
    assert!(text.contains(old), "no `{old}` in:\n{text}");
    text.replace(old, new)
}

/// A temporary folder that the program runs in.
pub struct Work {
    folder: tempfile::TempDir,
}

impl Work {
    pub fn new() -> Work {
        Work { folder: tempfile::tempdir().expect("a temporary folder") }
    }

    /// A folder that holds `x.toml`.
    pub fn with(text: &str) -> Work {
        let work = Work::new();
        work.write("x.toml", text);
        work
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).expect("a file");
    }

    pub fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// The program with arguments that are separated by blanks, not started.
    pub fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_scatterproof"));
        command.args(arguments.split_whitespace()).current_dir(self.folder.path()).stdin(Stdio::null());
        command
    }

    /// Runs the program with arguments that are separated by blanks.
    pub fn run(&self, arguments: &str) -> Ran {
        self.ran(arguments, self.command(arguments).output().expect("the program starts"))
    }

    /// Runs the program where no file may grow beyond a number of KiB.
    pub fn run_limited(&self, kib: usize, arguments: &str) -> Ran {
        let program = env!("CARGO_BIN_EXE_scatterproof");
        let script = format!("ulimit -f {kib} && exec \"$0\" {arguments}");
        let mut command = Command::new("bash");
        command.args(["-c", &script, program]).current_dir(self.folder.path());
        self.ran(&script, command.output().expect("bash starts"))
    }

    /// Runs a shell script in the folder, the program as `$0`.
    pub fn shell(&self, script: &str) -> Ran {
        let mut command = Command::new("bash");
        command.args(["-c", script, env!("CARGO_BIN_EXE_scatterproof")]).current_dir(self.folder.path());
        self.ran(script, command.output().expect("bash starts"))
    }

    /// Starts the program without waiting for its end.
    pub fn start(&self, arguments: &str) -> Started<'_> {
        let mut command = self.command(arguments);
        let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
        Started { work: self, arguments: arguments.into(), child: child.expect("the program starts") }
    }

    fn ran(&self, arguments: &str, output: Output) -> Ran {
        Ran { folder: self.folder.path().to_path_buf(), arguments: arguments.into(), output }
    }

    /// All files below a folder with their bytes.
    pub fn files(&self, name: &str) -> BTreeMap<String, Vec<u8>> {
        let root = self.path(name);
        let mut folders = vec![root.clone()];
        let mut files = BTreeMap::new();
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(&folder).into_iter().flatten() {
                let path = entry.expect("an entry").path();
                if path.is_dir() {
                    folders.push(path);
                } else {
                    let name = path.strip_prefix(&root).expect("inside").to_string_lossy().into_owned();
                    files.insert(name, fs::read(&path).expect("a file"));
                }
            }
        }
        files
    }

    /// The record of `x` below `out`, byte for byte.
    pub fn record(&self, out: &str) -> BTreeMap<String, Vec<u8>> {
        let record = self.files(&format!("{out}/x/record"));
        assert!(record.contains_key("record.json"), "no record in {out}/x");
        record
    }
}

/// Asserts that two records have the same bytes; names the file that differs.
pub fn same(a: &BTreeMap<String, Vec<u8>>, b: &BTreeMap<String, Vec<u8>>, what: &str) {
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>(), "{what}: other files");
    for (name, bytes) in a {
        let other = &b[name];
        let first = bytes.iter().zip(other).position(|(x, y)| x != y);
        assert!(bytes == other, "{what}: {name} differs from byte {first:?} on");
    }
}

/// Exit code and output of the program.
pub struct Ran {
    folder: PathBuf,
    arguments: String,
    output: Output,
}

impl Ran {
    pub fn code(&self) -> Option<i32> {
        self.output.status.code()
    }

    pub fn stdout(&self) -> String {
        String::from_utf8_lossy(&self.output.stdout).into_owned()
    }

    pub fn stderr(&self) -> String {
        String::from_utf8_lossy(&self.output.stderr).into_owned()
    }

    /// Fails with everything that is known.
    #[track_caller]
    pub fn check(&self, holds: bool, what: &str) -> &Ran {
        let Ran { folder, arguments, output } = self;
        let status = output.status;
        assert!(
            holds,
            "{what}\ncwd: {}\nargs: {arguments}\n{status}\nstdout:\n{}\nstderr:\n{}",
            folder.display(),
            self.stdout(),
            self.stderr()
        );
        self
    }

    #[track_caller]
    pub fn exits(&self, code: i32) -> &Ran {
        self.check(self.code() == Some(code), &format!("expected exit code {code}"))
    }

    /// Standard error contains this text.
    #[track_caller]
    pub fn complains(&self, part: &str) -> &Ran {
        self.check(self.stderr().contains(part), &format!("expected on stderr: {part}"))
    }

    /// Standard error contains all of these texts.
    #[track_caller]
    pub fn complains_of(&self, parts: &[&str]) -> &Ran {
        parts.iter().fold(self, |ran, part| ran.complains(part))
    }

    /// Standard output contains this text.
    #[track_caller]
    pub fn says(&self, part: &str) -> &Ran {
        self.check(self.stdout().contains(part), &format!("expected on stdout: {part}"))
    }
}

/// The program at work.
pub struct Started<'a> {
    work: &'a Work,
    arguments: String,
    child: Child,
}

impl Started<'_> {
    /// Waits until something holds; the program must still be at work then.
    pub fn wait_until(&mut self, what: &str, holds: impl Fn() -> bool) {
        let begun = Instant::now();
        while !holds() {
            let status = self.child.try_wait().expect("its status");
            assert!(status.is_none(), "`{}` ended with {status:?} before {what}", self.arguments);
            assert!(begun.elapsed() < Duration::from_secs(60), "{what}: not within a minute");
            sleep(Duration::from_millis(5));
        }
    }

    /// Sends a signal to the program.
    pub fn signal(&self, name: &str) {
        let id = self.child.id().to_string();
        let sent = Command::new("bash").args(["-c", "kill -\"$1\" \"$2\"", "bash", name, &id]).status();
        assert!(sent.expect("kill").success(), "the signal {name} was not sent");
    }

    /// Waits for its end.
    pub fn end(self) -> Ran {
        let Started { work, arguments, child } = self;
        work.ran(&arguments, child.wait_with_output().expect("its output"))
    }
}
