//! Build and machine of a run.

use std::collections::BTreeMap;
use std::sync::OnceLock;
use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

use super::json::hash_hex;

/// Raised by every change that alters a stored bit.
pub const NUMERICAL_VERSION: u32 = 21;

/// The crates whose arithmetic enters a stored number.
const NUMERICAL_CRATES: [&str; 4] = ["libm", "rand_pcg", "glam", "obvhs"];

/// Further crates whose versions are reported.
const NOTED_CRATES: [&str; 10] =
    ["blake3", "exr", "glam", "libm", "obvhs", "png", "rand_pcg", "serde_json", "statrs", "tobj"];

const LOCK: &str = include_str!("../../Cargo.lock");

/// Content of `provenance.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// This crate's version.
    pub version: String,
    /// Fingerprint of what fixes the bits.
    pub fingerprint: String,
    /// blake3 of the program itself, hex: the states of another build are not resumed.
    pub build: String,
    /// Commit that the program was built from, where git or `SCATTERPROOF_COMMIT` told the build.
    pub commit: Option<String>,
    /// True where its sources had uncommitted changes when it was built.
    pub dirty: Option<bool>,
    /// Versions of the crates that matter, from the lock file compiled in.
    pub crates: BTreeMap<String, String>,
    /// The compiler, where the build stated it in `SCATTERPROOF_RUSTC`.
    pub rustc: String,
    /// Architecture and system.
    pub target: String,
    /// Target features that could change floating-point code.
    pub target_features: Vec<String>,
    /// The processor's name.
    pub cpu: String,
    /// Number of worker threads.
    pub threads: usize,
    /// When the run ended, UTC, ISO 8601.
    pub date: String,
    /// The command line.
    pub command: Vec<String>,
}

impl Provenance {
    /// Of this process, now.
    pub fn collect(threads: usize) -> Provenance {
        Provenance {
            version: env!("CARGO_PKG_VERSION").into(),
            fingerprint: fingerprint(),
            build: build().into(),
            commit: option_env!("SCATTERPROOF_COMMIT").map(String::from),
            dirty: option_env!("SCATTERPROOF_DIRTY").map(|dirty| dirty == "true"),
            crates: NOTED_CRATES
                .iter()
                .map(|name| (name.to_string(), locked_version(name).into()))
                .collect(),
            rustc: option_env!("SCATTERPROOF_RUSTC").unwrap_or("unknown").into(),
            target: format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS),
            target_features: features().into_iter().map(String::from).collect(),
            cpu: cpu_model().unwrap_or_else(|| "unknown".into()),
            threads,
            date: now(),
            command: std::env::args().collect(),
        }
    }
}

/// blake3 of the running program, hex; `unknown` where it cannot be read. The fingerprint promises equal
/// bits across builds, and is raised by hand; this changes with every build.
pub fn build() -> &'static str {
    static BUILD: OnceLock<String> = OnceLock::new();
    BUILD.get_or_init(|| {
        let bytes = std::env::current_exe().and_then(std::fs::read);
        bytes.map_or_else(|_| "unknown".into(), |bytes| hash_hex(&bytes))
    })
}

/// Today's date, UTC, and the commit that this program was built from, as `2026-11-21 cf14d94`.
pub fn today_and_commit() -> String {
    let commit = option_env!("SCATTERPROOF_COMMIT").unwrap_or("unknown");
    let commit: String = commit.chars().take(12).collect();
    format!("{} {commit}", &now()[..10])
}

/// What fixes the bits, as one line; records of different fingerprints are not merged.
pub fn fingerprint() -> String {
    let crates: String =
        NUMERICAL_CRATES.iter().map(|c| format!(" {c}-{}", locked_version(c))).collect();
    let fma = if cfg!(target_feature = "fma") { "fma" } else { "no-fma" };
    format!("numerical-{NUMERICAL_VERSION}{crates} {} {fma}", std::env::consts::ARCH)
}

/// Version of a crate that this one depends on; `absent` where the lock file does not have it.
///
/// Where the lock file holds several versions, this package's own entry names the one it uses
/// (`"glam 0.34.2"`); otherwise that entry is `"libm"` and there is one to find.
fn locked_version(name: &str) -> &'static str {
    let after = |text: &'static str, mark: String| text.split_once(&mark).map(|(_, rest)| rest);
    let own = after(LOCK, format!("name = \"{}\"\n", env!("CARGO_PKG_NAME")));
    let own = own.and_then(|rest| rest.split("[[package]]").next()).unwrap_or("");
    let named = after(own, format!(" \"{name} "));
    let only = || after(LOCK, format!("name = \"{name}\"\nversion = \""));
    named.or_else(only).and_then(|rest| rest.split('"').next()).unwrap_or("absent")
}

fn features() -> Vec<&'static str> {
    let all = [("fma", cfg!(target_feature = "fma")), ("avx2", cfg!(target_feature = "avx2"))];
    all.iter().filter(|(_, on)| *on).map(|(name, _)| *name).collect()
}

fn cpu_model() -> Option<String> {
    let info = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = info.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_string())
}

/// The time, UTC, ISO 8601.
pub(crate) fn now() -> String {
    utc(SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs()))
}

/// Seconds since 1970 as `2026-11-21T10:30:00Z`.
fn utc(seconds: u64) -> String {
    let (year, month, day) = civil_from_days(seconds / 86_400);
    let (h, m, s) = (seconds / 3600 % 24, seconds / 60 % 60, seconds % 60);
    format!("{year:04}-{month:02}-{day:02}T{h:02}:{m:02}:{s:02}Z")
}

/// The Gregorian date of a day counted from 1970-01-01.
///
/// Eras of 400 years have 146097 days. With years that begin in March, the leap day is the last of
/// its year, and month m (0 = March) begins on day (153 m + 2) / 5 of it.
/// H. Hinnant, "chrono-compatible low-level date algorithms", civil_from_days.
fn civil_from_days(days: u64) -> (u64, u64, u64) {
    let days = days + 719_468; // from 0000-03-01
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let leap_days = day_of_era / 1460 - day_of_era / 36_524 + day_of_era / 146_096;
    let year_of_era = (day_of_era - leap_days) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let march_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * march_month + 2) / 5 + 1;
    let month = if march_month < 10 { march_month + 3 } else { march_month - 9 };
    (400 * era + year_of_era + u64::from(month <= 2), month, day)
}

#[cfg(test)]
mod tests {
    use super::*;

    // `date -u -d @SECONDS +%FT%TZ`
    #[test]
    fn dates() {
        assert_eq!(utc(0), "1970-01-01T00:00:00Z");
        assert_eq!(utc(951_782_399), "2000-02-28T23:59:59Z");
        assert_eq!(utc(951_782_400), "2000-02-29T00:00:00Z");
        assert_eq!(utc(4_107_542_400), "2100-03-01T00:00:00Z");
        assert_eq!(utc(1_795_257_000), "2026-11-21T10:30:00Z");
    }

    #[test]
    fn fingerprint_names_what_fixes_the_bits() {
        let line = fingerprint();
        assert!(!line.contains("absent") && !line.contains('\n'), "{line}");
        for name in ["numerical-21", "libm-0.2", "rand_pcg-0.10", "glam-0.34", "obvhs-0.4.0", "fma"] {
            assert!(line.contains(name), "{line}");
        }
        assert_eq!(locked_version("no-such-crate"), "absent");
    }

    #[test]
    fn collects_and_reads_back() {
        let here = Provenance::collect(2);
        let text = serde_json::to_string(&here).expect("JSON");
        assert_eq!(serde_json::from_str::<Provenance>(&text).expect("a provenance"), here);
        assert!(!here.crates.values().any(|v| v == "absent"), "{:?}", here.crates);
    }
}
