//! Rules of `bands`.

use std::collections::BTreeSet;

use super::At;
use crate::experiment::schema::{BandsEntry, ExplicitBand};

/// Bins are named by their limits to thousandths of a nm.
const NARROWEST_NM: f64 = 0.01;

/// Ranges run upwards, names are unique.
pub(crate) fn bands(at: At, bands: &BandsEntry) {
    match bands {
        BandsEntry::Rgb {} => {}
        BandsEntry::Spectral { from_nm, to_nm, count } => {
            let at = at.to("spectral");
            upwards(at.to("from_nm"), *from_nm, *to_nm);
            if (0.0..NARROWEST_NM * *count as f64).contains(&(to_nm - from_nm)) && from_nm != to_nm {
                at.to("count").report(format!("bins must be at least {NARROWEST_NM} nm wide"));
            }
        }
        BandsEntry::Explicit(list) => {
            let mut names = BTreeSet::new();
            for (i, band) in list.iter().enumerate() {
                let at = at.to("explicit").item(i);
                if !names.insert(&band.name) {
                    let rule = format!("two bands are named `{}`", band.name);
                    at.to("name").report_help(rule, "give each a name of its own");
                }
                range(at, band);
            }
        }
    }
}

fn range(at: At, band: &ExplicitBand) {
    match (band.from_nm, band.to_nm) {
        (Some(from), Some(to)) => upwards(at.to("from_nm"), from, to),
        (None, None) => {}
        (Some(_), None) => at.to("from_nm").report("`from_nm` needs `to_nm` beside it"),
        (None, Some(_)) => at.to("to_nm").report("`to_nm` needs `from_nm` beside it"),
    }
}

fn upwards(at: At, from: f64, to: f64) {
    if from >= to {
        at.report_help(
            format!("`from_nm` must be less than `to_nm`, is {from} and {to}"),
            "wavelengths run upwards: exchange the two",
        );
    }
}
