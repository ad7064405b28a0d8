//! Rules of `mean_path_length`: where 4 eta^2 V / S does not hold, the claim is refused with the reason.

use super::At;
use crate::experiment::schema::{
    BandsEntry, BoundaryEntry, LightEntry, MeanPathLength, MediumEntry, NormalsEntry, SensorEntry,
    ShapeEntry,
};
use crate::experiment::sweep_point::{AxisPoint, SweepAxis};

/// Object, sensor and lights of a cell, and its place in the sweep.
pub(crate) struct CellPoint<'a> {
    pub tree: At<'a>,
    pub bands: &'a BandsEntry,
    pub axes: &'a [SweepAxis],
    pub points: &'a [&'a AxisPoint],
}

impl CellPoint<'_> {
    /// Whether a claim's `where` chooses the cell.
    fn is_in(&self, words: &MeanPathLength) -> bool {
        let labels = || self.axes.iter().zip(self.points);
        let has = |(axis, label): (&String, &String)| {
            labels().any(|(known, point)| known.name == *axis && point.label == *label)
        };
        words.only.iter().all(has)
    }
}

/// The claim is about a sensor of path lengths, and its cell loses no light.
pub(crate) fn mean_path_length(at: At, words: &MeanPathLength, cell: &CellPoint) {
    if !cell.is_in(words) {
        return;
    }
    let object = cell.tree.to("object");
    if let Some(sensor) = cell.tree.typed::<SensorEntry>("sensor")
        && !matches!(sensor, SensorEntry::PathLength { .. })
    {
        at.report_help("the claim needs the sensor `path_length`", "write `sensor.path_length = {}`");
    }
    let boundary = object.typed::<BoundaryEntry>("boundary");
    if let Some(boundary) = &boundary {
        surface(at, boundary, object.typed::<ShapeEntry>("shape").as_ref());
    }
    let bands = cell.bands.list();
    let medium = object.typed::<MediumEntry>("medium").and_then(|medium| medium.per_band(&bands));
    let absorbs = medium.iter().flatten().zip(&bands).find(|(medium, _)| medium.sigma_a > 0.0);
    if let Some((_, band)) = absorbs {
        at.report_help(
            format!("4 eta^2 V / S holds without absorption, and band `{}` absorbs", band.name),
            "set the albedo to 1, or choose bands and cells of their own for this claim",
        );
    }
    let emission = object.typed::<MediumEntry>("medium").map(|medium| medium.emission(bands.len()));
    if emission.into_iter().flatten().any(|emission| emission > 0.0) {
        at.report_help(
            "4 eta^2 V / S holds in light from outside, and the medium emits",
            "leave `emission_per_mm` out in cells of this claim",
        );
    }
    let clear = medium.iter().flatten().zip(&bands).find(|(medium, _)| medium.sigma_s == 0.0);
    if let (Some(BoundaryEntry::Smooth { .. }), Some((_, band))) = (&boundary, clear) {
        at.report_help(
            format!(
                "4 eta^2 V / S holds where light from outside reaches all directions inside, and in band `{}` \
                 nothing scatters it into those that total reflection traps",
                band.name
            ),
            "let the medium scatter, or use a matched boundary",
        );
    }
    for light in cell.tree.typed::<Vec<LightEntry>>("light").unwrap_or_default() {
        if !is_white(&light, bands.len()) {
            at.report_help(
                "4 eta^2 V / S holds in light of equal radiance from all directions, and another light shines",
                "let all lights be `environment = { radiance = 1 }`, without `hemisphere`",
            );
        }
    }
}

fn surface(at: At, boundary: &BoundaryEntry, shape: Option<&ShapeEntry>) {
    let normals = match shape {
        Some(
            ShapeEntry::Mesh { normals, .. }
            | ShapeEntry::Icosphere { normals, .. }
            | ShapeEntry::BumpySphere { normals, .. }
            | ShapeEntry::Torus { normals, .. }
            | ShapeEntry::CavitySphere { normals, .. },
        ) => *normals,
        _ => NormalsEntry::Flat,
    };
    match (boundary, normals) {
        (BoundaryEntry::Rough { .. }, _) => at.report_help(
            "4 eta^2 V / S holds where the boundary loses nothing, and a rough one loses the light that its \
             facets send into each other",
            "use a smooth or a matched boundary",
        ),
        (BoundaryEntry::Smooth { .. }, NormalsEntry::Interpolated) => at.report_help(
            "4 eta^2 V / S holds where the boundary loses nothing, and interpolated normals lose the light \
             that they send to the wrong side",
            "use `normals = \"flat\"`",
        ),
        _ => {}
    }
}

/// A sky of one radiance, which is not 0.
fn is_white(light: &LightEntry, bands: usize) -> bool {
    let sky = light.environment.as_ref().filter(|sky| sky.hemisphere.is_none());
    let radiance = sky.and_then(|sky| sky.radiance.as_ref());
    radiance.is_some_and(|radiance| radiance.values(bands).iter().all(|x| *x > 0.0))
}
