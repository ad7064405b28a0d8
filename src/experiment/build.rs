//! From a validated experiment to the scene: the one match from names to types.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::direction::unit;
use super::schema::{
    self, BoundaryEntry, Environment, LengthUnit, LightEntry, NormalsEntry, ShapeEntry, Spectrum,
    UpAxis, Upsampling,
};
use super::{CellSpec, Experiment, resolve, resolve_path};
use crate::error::{Error, Result};
use crate::geometry::{Placement, Shape, Side, load_mesh, procedural};
use crate::input;
use crate::math::{DVec3, Frame};
use crate::optics::boundary::Boundary;
use crate::optics::medium::Medium;
use crate::optics::microfacet::Microfacets;
use crate::optics::upsampling;
use crate::results::exr_file::{ExrImage, read_exr};
use crate::results::hdr_file::read_hdr;
use crate::results::json::hash_hex;
use crate::results::record::Band;
use crate::scene::{Emission, LatLong, Light, Scene};

/// Shapes by what an experiment file says of them.
pub(crate) type Shapes = BTreeMap<String, Arc<Shape>>;

/// What an experiment file says of a shape, with the name that the shape has among [`Shapes`].
pub(crate) struct ShapeWords<'a> {
    pub name: String,
    words: &'a ShapeEntry,
}

impl ShapeWords<'_> {
    fn of(words: &ShapeEntry) -> ShapeWords<'_> {
        ShapeWords { name: format!("{words:?}"), words }
    }

    /// The shape.
    ///
    /// # Errors
    /// A mesh that cannot be read, or bounds no body.
    pub(crate) fn build(&self, experiment: &Experiment) -> Result<Arc<Shape>> {
        build_shape(self.words, experiment).map(Arc::new)
    }
}

/// What an experiment says of its shapes, each once.
pub(crate) fn shape_words(experiment: &Experiment) -> Vec<ShapeWords<'_>> {
    let words = experiment.cells.iter().map(|cell| ShapeWords::of(&cell.object.shape));
    let mut seen = BTreeSet::new();
    words.filter(|words| seen.insert(words.name.clone())).collect()
}

/// Builds the scenes of an experiment; equal shapes and maps are built once and shared.
pub(crate) struct Builder<'a> {
    experiment: &'a Experiment,
    bands: Vec<Band>,
    /// Shapes that have been built before.
    known: &'a Shapes,
    shapes: Shapes,
    maps: BTreeMap<(PathBuf, [u64; 2], bool), Arc<LatLong>>,
}

impl<'a> Builder<'a> {
    /// A builder of the experiment's scenes; `known` has shapes that have been built before.
    pub(crate) fn new(experiment: &'a Experiment, known: &'a Shapes) -> Builder<'a> {
        let bands = experiment.file.bands.as_ref().map(bands).unwrap_or_default();
        Builder { experiment, bands, known, shapes: BTreeMap::new(), maps: BTreeMap::new() }
    }

    /// The shapes of all scenes that have been built.
    pub(crate) fn into_shapes(self) -> Shapes {
        self.shapes
    }

    /// The bands, with the colours they show as.
    pub(crate) fn bands(&self) -> &[Band] {
        &self.bands
    }

    /// Bytes that the shapes and maps built so far hold.
    pub(crate) fn memory_bytes(&self) -> usize {
        let shapes: usize = self.shapes.values().map(|shape| shape.memory_bytes()).sum();
        shapes + self.maps.values().map(|map| map.memory_bytes()).sum::<usize>()
    }

    /// Bytes that making shapes took for a moment at most, where one is made on each of so many threads.
    pub(crate) fn building_bytes(&self, threads: usize) -> usize {
        let mut bytes: Vec<usize> = self.shapes.values().map(|shape| shape.building_bytes()).collect();
        bytes.sort_unstable_by_key(|bytes| Reverse(*bytes));
        bytes.iter().take(threads.max(1)).sum()
    }

    /// The scene of the cell `index`.
    ///
    /// # Errors
    /// A mesh or map that cannot be used, a sensor inside the body, a vertex outside, a sensor that does
    /// not see the body; each at its place in the file.
    pub(crate) fn scene(&mut self, index: usize) -> Result<Scene> {
        let experiment = self.experiment;
        let cell = &experiment.cells[index];
        let place = |key: &str| experiment.sources.place(index, key);
        let shape = match &cell.object.shape {
            words @ ShapeEntry::Mesh { .. } => {
                self.shape(words).map_err(|error| error.at(place("object.shape.mesh.path")))?
            }
            words => self.shape(words).map_err(|error| error.at(place("object.shape")))?,
        };
        let boundary = self.boundary(&cell.object.boundary);
        let boundary = boundary.map_err(|error| error.at(place("object.boundary")))?;
        let medium = cell.object.medium.per_band(&experiment.file.band_list());
        let no_medium = || Error::input("the medium has no coefficients").at(place("object.medium"));
        let medium = medium.ok_or_else(no_medium)?;
        let emission = cell.object.medium.emission(medium.len());
        let medium = medium
            .iter()
            .zip(emission)
            .map(|(m, emission)| Medium { emission, ..Medium::new(m.sigma_a, m.sigma_s, m.g) });
        let medium = medium.collect();
        let light = |(i, entry): (usize, &LightEntry)| {
            let key = match entry.environment {
                Some(_) => format!("light.{i}.environment.map"),
                None => format!("light.{i}"),
            };
            self.light(i, entry).map_err(|error| error.at(place(&key)))
        };
        let lights = cell.light.iter().enumerate().map(light).collect::<Result<Vec<Light>>>()?;
        let at_sensor = |error: Error| error.at(cell.sensor.key_of_position().and_then(place));
        let sensor = cell.sensor.build(&shape).map_err(|error| error.at(place("sensor")))?;
        match sensor.position() {
            Some((point, Side::Outside)) if shape.covers(point) => {
                return Err(at_sensor(Error::input_help(
                    format!("the sensor at {point} mm is inside or on the body"),
                    format!("move it outside; {}", extent(&shape)),
                )));
            }
            Some((point, Side::Inside)) if !shape.contains(point) => {
                return Err(at_sensor(Error::input_help(
                    format!("the vertex at {point} mm is not inside the body"),
                    format!("move it inside; {}", extent(&shape)),
                )));
            }
            _ => {}
        }
        let scene = Scene { shape, boundary, medium, lights, sensor };
        if !scene.is_seen() {
            let what = match scene.sensor.pixels() {
                Some(_) => "no ray of any pixel meets the body: every pixel would be 0",
                None => "the ray passes the body by: the probe would measure 0",
            };
            let help = format!("aim the sensor at the body; {}", extent(&scene.shape));
            return Err(Error::input_help(what, help).at(place("sensor")));
        }
        Ok(scene)
    }

    fn boundary(&self, words: &BoundaryEntry) -> Result<Vec<Boundary>> {
        let bands = self.experiment.file.band_list();
        let eta = |eta: &schema::Eta| eta.per_band(&bands).map_err(Error::input);
        Ok(match words {
            BoundaryEntry::Matched {} => vec![Boundary::Matched; bands.len()],
            BoundaryEntry::Smooth { eta: words } => {
                eta(words)?.into_iter().map(|eta| Boundary::Smooth { eta }).collect()
            }
            BoundaryEntry::Rough { distribution, alpha, eta: words } => {
                let facets = Microfacets { kind: *distribution, alpha: *alpha };
                eta(words)?.into_iter().map(|eta| Boundary::Rough { eta, facets }).collect()
            }
        })
    }

    fn shape(&mut self, words: &ShapeEntry) -> Result<Arc<Shape>> {
        let words = ShapeWords::of(words);
        if let Some(shape) = self.shapes.get(&words.name) {
            return Ok(Arc::clone(shape));
        }
        let shape = match self.known.get(&words.name) {
            Some(known) => Arc::clone(known),
            None => words.build(self.experiment)?,
        };
        self.shapes.insert(words.name, Arc::clone(&shape));
        Ok(shape)
    }

    fn light(&mut self, index: usize, entry: &LightEntry) -> Result<Light> {
        let name = entry.name.clone().unwrap_or_else(|| format!("light_{}", index + 1));
        let count = self.bands.len();
        let spectrum = |words: &Spectrum, scale: f64| -> Vec<f64> {
            words.values(count).iter().map(|x| scale * x).collect()
        };
        let emission = if let Some(words) = &entry.directional {
            let irradiance = spectrum(&words.irradiance, 1.0);
            Emission::Directional { toward: words.toward.unit(), irradiance }
        } else if let Some(words) = &entry.solid_angle {
            let height = words.solid_angle_sr / (2.0 * PI);
            // A cap's irradiance on a plane that faces its middle: L pi sin^2, sin^2 = h (2 - h).
            let radiance = match (&words.radiance, &words.irradiance) {
                (Some(radiance), _) => spectrum(radiance, 1.0),
                (None, Some(irradiance)) => spectrum(irradiance, 1.0 / (PI * height * (2.0 - height))),
                (None, None) => Vec::new(),
            };
            Emission::Cap { frame: Frame::about(words.toward.unit()), height, radiance }
        } else if let Some(words) = &entry.environment {
            match (&words.radiance, &words.map) {
                (Some(radiance), _) => {
                    let (axis, height) = match words.hemisphere {
                        Some(axis) => (unit(axis), 1.0),
                        None => (DVec3::Z, 2.0),
                    };
                    let radiance = spectrum(radiance, 1.0);
                    Emission::Cap { frame: Frame::about(axis), height, radiance }
                }
                (None, _) => Emission::Map(self.map(words)?),
            }
        } else {
            return Err(Error::input(format!("light `{name}` has no kind")));
        };
        Ok(Light { name, emission })
    }

    fn map(&mut self, words: &Environment) -> Result<Arc<LatLong>> {
        let path = resolve_path(&self.experiment.path, words.map.as_deref().unwrap_or_default());
        let (scale, turns) = (words.scale.unwrap_or(1.0), words.rotate_deg.unwrap_or(0.0) / 360.0);
        let name = (path.clone(), [scale, turns].map(f64::to_bits), words.upsampling.is_some());
        if let Some(map) = self.maps.get(&name) {
            return Ok(Arc::clone(map));
        }
        let map = Arc::new(self.read_map(&path, words.upsampling, scale, turns)?);
        self.maps.insert(name, Arc::clone(&map));
        Ok(map)
    }

    fn read_map(
        &self,
        path: &Path,
        upsampling: Option<Upsampling>,
        scale: f64,
        turns: f64,
    ) -> Result<LatLong> {
        let ending = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_lowercase();
        let image =
            if ["hdr", "rgbe", "pic"].contains(&&*ending) { read_hdr(path) } else { read_exr(path) };
        let image = image.map_err(|error| {
            error.of_input(
                "a map is a latitude-longitude image, OpenEXR or Radiance HDR; its path is relative to the \
                 folder of the experiment file, and `~` has no meaning in it",
            )
        })?;
        // The columns of a turned map: azimuth grows towards the left edge.
        let (width, shift) = (image.width, (turns - turns.floor()) * image.width as f64);
        let column = |c: usize| (c + shift.round() as usize) % width;
        let turned = |plane: Vec<f64>| -> Vec<f64> {
            let texel = |k: usize| plane[k - k % width + column(k % width)];
            (0..plane.len()).map(texel).collect()
        };
        let planes = self.bands.iter().map(|band| {
            let plane = self.radiance(path, &image, band, upsampling)?;
            let bad = plane.iter().filter(|x| !x.is_finite() || **x < 0.0).count();
            if bad > 0 {
                return Err(Error::input_help(
                    format!(
                        "`{}`: {bad} texels of band `{}` are negative or not finite",
                        path.display(),
                        band.name
                    ),
                    "repair the map; a radiance is a finite number that is not negative",
                ));
            }
            Ok(turned(plane.into_iter().map(|x| scale * x).collect()))
        });
        Ok(LatLong::new(image.width, image.height, planes.collect::<Result<Vec<Vec<f64>>>>()?))
    }

    /// A map's radiance in a band: its channel, Y, or R, G and B upsampled.
    fn radiance(
        &self,
        path: &Path,
        image: &ExrImage,
        band: &Band,
        upsampling: Option<Upsampling>,
    ) -> Result<Vec<f64>> {
        let channels = &image.channels;
        let colours: Option<Vec<&Vec<f32>>> = ["R", "G", "B"].iter().map(|c| channels.get(*c)).collect();
        let own = channels.get(&band.name).or_else(|| channels.get("Y"));
        match (own, upsampling, colours) {
            (_, Some(Upsampling::Smooth), Some(colours)) => {
                let weights = upsampling::band_weights(band.range_nm.unwrap_or([380.0, 780.0]));
                let texel = |k: usize| -> f64 {
                    weights.iter().zip(&colours).map(|(weight, c)| weight * f64::from(c[k])).sum()
                };
                Ok((0..image.width * image.height).map(texel).collect())
            }
            (Some(channel), ..) => Ok(channel.iter().map(|&x| f64::from(x)).collect()),
            (None, _, colours) => {
                let known: Vec<&str> = channels.keys().map(String::as_str).collect();
                let known = known.join(", ");
                Err(Error::input_help(
                    format!("`{}`: no channel for band `{}`", path.display(), band.name),
                    match colours.is_some() && band.range_nm.is_some() {
                        true => format!(
                            "add `upsampling = \"smooth\"` to make spectra of R, G and B; a map may also have a \
                             channel named like each band, or Y for all; it has {known}"
                        ),
                        false => format!(
                            "a map needs a channel named like each band, or Y for all; it has {known}"
                        ),
                    },
                ))
            }
        }
    }
}

/// Hashes of the files that an experiment reads, hex, by the path it gives them: a mesh that changed
/// makes another experiment. Files that cannot be read are left to the loader's error.
pub(crate) fn inputs(experiment: &Experiment) -> BTreeMap<String, String> {
    let mesh = |cell: &CellSpec| match &cell.object.shape {
        ShapeEntry::Mesh { path, .. } => Some(path.clone()),
        _ => None,
    };
    let maps = |cell: &CellSpec| -> Vec<String> {
        let environments = cell.light.iter().filter_map(|light| light.environment.as_ref());
        environments.filter_map(|environment| environment.map.clone()).collect()
    };
    let paths: BTreeSet<String> =
        experiment.cells.iter().flat_map(|cell| maps(cell).into_iter().chain(mesh(cell))).collect();
    let hash = |path: String| {
        let bytes = input::read(&resolve_path(&experiment.path, &path), input::LARGEST_DATA).ok()?;
        Some((path, hash_hex(&bytes)))
    };
    paths.into_iter().filter_map(hash).collect()
}

/// The bands of an experiment and the colours they show as.
pub(crate) fn bands(words: &schema::BandsEntry) -> Vec<Band> {
    let band = |(band, display_rgb): (resolve::BandInterval, [f64; 3])| Band {
        name: band.name,
        range_nm: band.range_nm,
        display_rgb,
    };
    words.list().into_iter().zip(words.display_rgb()).map(band).collect()
}

/// Where a body is, in words.
fn extent(shape: &Shape) -> String {
    match (shape, shape.bounds()) {
        (_, Some(bounds)) => {
            format!(
                "it lies in the sphere of radius {} mm about {} mm",
                short(bounds.radius),
                bounds.center
            )
        }
        (Shape::Slab { thickness }, None) => format!("it lies between z = -{thickness} and z = 0 mm"),
        (_, None) => "it lies below z = 0".into(),
    }
}

/// A length to four digits, for messages.
fn short(length: f64) -> f64 {
    format!("{length:.3e}").parse().unwrap_or(length)
}

fn build_shape(words: &ShapeEntry, experiment: &Experiment) -> Result<Shape> {
    let smooth = |words: &NormalsEntry| *words == NormalsEntry::Interpolated;
    let mesh = match words {
        ShapeEntry::HalfSpace {} => return Ok(Shape::HalfSpace),
        ShapeEntry::Slab { thickness_mm } => return Ok(Shape::Slab { thickness: *thickness_mm }),
        ShapeEntry::Box { size_mm } => return Ok(Shape::Box { half: 0.5 * DVec3::from(*size_mm) }),
        ShapeEntry::Sphere { radius_mm } => return Ok(Shape::Sphere { radius: *radius_mm }),
        ShapeEntry::Mesh { path, up, unit, longest_side_mm, rotate_deg, translate_mm, normals } => {
            let placement = Placement {
                is_y_up: *up == Some(UpAxis::Y),
                unit_mm: unit.map_or(1.0, LengthUnit::mm),
                longest_side_mm: *longest_side_mm,
                rotate_deg: rotate_deg.unwrap_or_default(),
                translate_mm: translate_mm.map_or(DVec3::ZERO, DVec3::from),
            };
            load_mesh(&resolve_path(&experiment.path, path), &placement, smooth(normals))
        }
        ShapeEntry::Icosphere { radius_mm, subdivisions, normals } => {
            procedural::icosphere(*radius_mm, *subdivisions, smooth(normals))
        }
        ShapeEntry::BumpySphere { radius_mm, subdivisions, amplitude, wavenumber, normals } => {
            procedural::bumpy_sphere(*radius_mm, *subdivisions, *amplitude, *wavenumber, smooth(normals))
        }
        ShapeEntry::LumpySphere { radius_mm, subdivisions, amplitude, normals } => {
            procedural::lumpy_sphere(*radius_mm, *subdivisions, *amplitude, smooth(normals))
        }
        ShapeEntry::Torus { major_radius_mm, minor_radius_mm, segments, normals } => {
            procedural::torus(*major_radius_mm, *minor_radius_mm, *segments, smooth(normals))
        }
        ShapeEntry::CavitySphere { radius_mm, cavity_radius_mm, subdivisions, normals } => {
            procedural::cavity_sphere(*radius_mm, *cavity_radius_mm, *subdivisions, smooth(normals))
        }
        ShapeEntry::DrilledBox { size_mm, holes, hole_fraction } => {
            procedural::drilled_box(DVec3::from(*size_mm), *holes, *hole_fraction)
        }
    };
    mesh.map(Shape::Mesh)
}
