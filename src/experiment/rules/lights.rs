//! Rules of `[[light]]`.

use std::collections::BTreeSet;
use std::f64::consts::TAU;

use super::sensor::direction;
use super::{At, nonzero, spectrum};
use crate::experiment::schema::{BandsEntry, Environment, LightEntry, SolidAngle, Spectrum};
use crate::scene::Scene;

/// The rules of all lights in these bands, beside a medium that `emits` or does not.
pub(crate) fn lights(at: At, entry: &BandsEntry, emits: bool) {
    let bands = entry.list().len();
    let mut names = BTreeSet::new();
    for i in 0..at.count() {
        let Some(light) = at.typed::<LightEntry>(&i.to_string()) else { continue };
        let at = at.item(i);
        let name = light.name.clone().unwrap_or_else(|| format!("light_{}", i + 1));
        if !names.insert(name.clone()) {
            let rule = format!("two lights are named `{name}`");
            at.to("name").report_help(rule, "give each a name of its own");
        }
        if emits && name == Scene::EMISSION {
            at.to("name").report_help(
                format!("`@{name}` is the share of light that the medium emits"),
                "give the light another `name`",
            );
        }
        if let Some(directional) = &light.directional {
            let at = at.to("directional");
            direction(at.to("toward"), &directional.toward);
            radiometric(at.to("irradiance"), &directional.irradiance, bands);
        }
        if let Some(disc) = &light.solid_angle {
            solid_angle(at.to("solid_angle"), disc, bands);
        }
        if let Some(sky) = &light.environment {
            environment(at.to("environment"), sky, entry);
        }
    }
}

fn radiometric(at: At, values: &Spectrum, bands: usize) {
    spectrum(at, values, bands, "at least 0", |x| x >= 0.0);
}

fn solid_angle(at: At, disc: &SolidAngle, bands: usize) {
    direction(at.to("toward"), &disc.toward);
    if let Some(radiance) = &disc.radiance {
        radiometric(at.to("radiance"), radiance, bands);
    }
    if let Some(irradiance) = &disc.irradiance {
        radiometric(at.to("irradiance"), irradiance, bands);
        if disc.solid_angle_sr >= TAU {
            at.to("solid_angle_sr").report_help(
                format!("must be less than 2 pi beside `irradiance`, is {}", disc.solid_angle_sr),
                "give `radiance` instead",
            );
        }
    }
}

fn environment(at: At, sky: &Environment, entry: &BandsEntry) {
    let bands = entry.list();
    if let Some(radiance) = &sky.radiance {
        radiometric(at.to("radiance"), radiance, bands.len());
    }
    if let Some(axis) = sky.hemisphere {
        nonzero(at.to("hemisphere"), axis);
    }
    if sky.scale.is_some() && sky.map.is_none() {
        at.to("scale").report("`scale` multiplies a `map`, and there is none");
    }
    if sky.rotate_deg.is_some() && sky.map.is_none() {
        at.to("rotate_deg").report_help(
            "`rotate_deg` turns a `map`, and there is none",
            "a constant sky has no direction; `hemisphere` takes any axis",
        );
    }
    if sky.upsampling.is_some() {
        let at = at.to("upsampling");
        match entry {
            _ if sky.map.is_none() => {
                at.report_help("`upsampling` is about a `map`, and there is none", "leave it out");
            }
            BandsEntry::Rgb {} => at.report_help(
                "`upsampling` is for bands of wavelengths, and these are R, G and B",
                "leave it out",
            ),
            _ => super::object::wavelengths(at, &bands),
        }
    }
}
