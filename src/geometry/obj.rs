//! Wavefront OBJ files. Door for `tobj`.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::path::Path;

use tobj::LoadOptions;

use super::{Mesh, Normals, extent};
use crate::error::{Error, Result};
use crate::input;
use crate::math::DVec3;

/// Reads a closed mesh from all objects of an OBJ file; faces with more corners become fans.
/// Vertices at exactly the same position become one. With `longest_side_mm` the longest side of its
/// box gets that length and the box is centred at the origin; without it the file's numbers are mm.
/// `interpolated` shading uses the file's normals if every corner has one, else angle-weighted ones.
///
/// # Errors
/// Unreadable or malformed files, and everything that [`Mesh::new`] refuses, naming the file.
pub fn load_obj(path: &Path, longest_side_mm: Option<f64>, interpolated: bool) -> Result<Mesh> {
    let mut text = open_text(path).map_err(|error| {
        let rule = format!("could not read the mesh `{}`: {error}", path.display());
        Error::input_help(rule, "its path is relative to the experiment file")
    })?;
    // One index for positions and normals: a corner without a normal then leaves a gap that shows in
    // the lengths. Points and lines are no surface.
    let options =
        LoadOptions { triangulate: true, single_index: true, ignore_points: true, ignore_lines: true };
    // Materials are of no interest, so a missing library is none either.
    let no_materials = |_: &Path| Ok(Default::default());
    let (models, _) =
        tobj::load_obj_buf(&mut text, &options, no_materials).map_err(|error| malformed(path, error))?;

    let mut welder = Welder::default();
    let mut normals = Normals { vectors: Vec::new(), corners: Vec::new() };
    let mut triangles = Vec::new();
    let mut complete = true;
    for mesh in models.into_iter().map(|model| model.mesh) {
        let offset = normals.vectors.len() as u32;
        let welded: Vec<u32> = points(&mesh.positions).map(|p| welder.index(p)).collect();
        for corners in triples(&mesh.indices) {
            triangles.push(corners.map(|i| welded[i as usize]));
            normals.corners.push(corners.map(|i| i + offset));
        }
        normals.vectors.extend(points(&mesh.normals).map(DVec3::normalize_or_zero));
        complete &= mesh.normals.len() == mesh.positions.len();
    }
    complete &= normals.vectors.iter().all(|n| *n != DVec3::ZERO);
    let mut vertices = welder.vertices;
    if let Some(side) = longest_side_mm {
        fit(&mut vertices, side);
    }
    Mesh::new(vertices, triangles, complete.then_some(normals), interpolated)
        .map_err(|error| name_file(path, error))
}

/// A file's text, without the byte order mark that some editors put before it: to `tobj` that is a letter of the first
/// word.
fn open_text(path: &Path) -> io::Result<BufReader<File>> {
    const MARK: &[u8] = b"\xef\xbb\xbf";
    let mut text = BufReader::new(input::open(path, input::LARGEST_DATA)?.0);
    if text.fill_buf()?.starts_with(MARK) {
        text.consume(MARK.len());
    }
    Ok(text)
}

/// Scales the longest side to `side` mm and centres the box at the origin.
fn fit(vertices: &mut [DVec3], side: f64) {
    let (min, max) = extent(vertices.iter().copied());
    let (center, scale) = ((min + max) * 0.5, side / (max - min).max_element());
    if scale.is_finite() {
        vertices.iter_mut().for_each(|v| *v = (*v - center) * scale);
    }
}

/// Gives equal positions one index.
#[derive(Default)]
struct Welder {
    vertices: Vec<DVec3>,
    known: HashMap<[u64; 3], u32>,
}

impl Welder {
    fn index(&mut self, point: DVec3) -> u32 {
        // Adding 0 makes -0 and 0 the same bits.
        let bits = point.to_array().map(|x| (x + 0.0).to_bits());
        *self.known.entry(bits).or_insert_with(|| {
            self.vertices.push(point);
            self.vertices.len() as u32 - 1
        })
    }
}

fn points(numbers: &[f64]) -> impl Iterator<Item = DVec3> {
    numbers.as_chunks::<3>().0.iter().map(|&p| DVec3::from_array(p))
}

fn triples(indices: &[u32]) -> impl Iterator<Item = [u32; 3]> {
    indices.as_chunks::<3>().0.iter().copied()
}

fn malformed(path: &Path, error: tobj::LoadError) -> Error {
    let help = match error {
        tobj::LoadError::FaceVertexOutOfBounds | tobj::LoadError::FaceNormalOutOfBounds => {
            "a face points to a vertex that the file lacks; export it again"
        }
        _ => "the mesh must be a Wavefront OBJ text with v and f lines; export it again",
    };
    Error::input_help(format!("`{}`: {error}", path.display()), help)
}

fn name_file(path: &Path, error: Error) -> Error {
    match error {
        Error::Input(mut findings) => {
            for finding in &mut findings {
                finding.rule = format!("`{}`: {}", path.display(), finding.rule);
            }
            Error::Input(findings)
        }
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TETRAHEDRON: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n\
                               f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";

    fn load(text: &str) -> Result<Mesh> {
        load_scaled(text, None, true)
    }

    fn load_scaled(text: &str, longest_side_mm: Option<f64>, interpolated: bool) -> Result<Mesh> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("body.obj");
        std::fs::write(&path, text).expect("a file");
        load_obj(&path, longest_side_mm, interpolated)
    }

    /// The file is refused with exit code 2; the message contains its name and these texts.
    fn refused(text: &str, parts: &[&str]) {
        let error = load(text).expect_err("refused");
        let message = error.to_string();
        assert_eq!(error.exit_code(), 2, "{message}");
        for part in parts.iter().chain(&["body.obj", "help:"]) {
            assert!(message.contains(part), "`{part}` is not in: {message}");
        }
    }

    #[test]
    fn a_closed_mesh_loads() {
        let mesh = load(TETRAHEDRON).expect("closed");
        assert_eq!((mesh.vertices().len(), mesh.triangles().len()), (4, 4));
        assert!(mesh.contains(DVec3::splat(0.1)) && !mesh.contains(DVec3::splat(0.4)));
    }

    #[test]
    fn equal_positions_become_one_vertex() {
        let soup = "v 0 0 0\nv 0 1 0\nv 1 -0 0\nv 0 0 0\nv 1 0 0\nv 0 0 1\nv 1 0 0\nv 0 1 0\n\
                    v 0 0 1\nv 0 1 0\nv 0 0 0\nv 0 0 1\n\
                    o a\nf 1 2 3\nf 4 5 6\no b\nf -6 -5 -4\nf 10 11 12\n";
        let mesh = load(soup).expect("closed by position");
        assert_eq!(mesh.vertices().len(), 4);
    }

    #[test]
    fn polygons_become_triangles() {
        let cube = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n\
                    f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
        let mesh = load_scaled(cube, Some(8.0), false).expect("closed");
        assert_eq!(mesh.triangles().len(), 12);
        let (min, max) = extent(mesh.vertices().iter().copied());
        assert_eq!((min, max), (DVec3::splat(-4.0), DVec3::splat(4.0)));
        assert!(mesh.normals().is_none());
    }

    #[test]
    fn normals_of_the_file_are_used_if_complete() {
        let with = |faces: &str| {
            let vertices = TETRAHEDRON.split_once('f').expect("faces").0;
            load(&format!("{vertices}vn 0 0 -2\nvn 0 -1 0\nvn 1 1 1\nvn -1 0 0\n{faces}"))
        };
        let creased = with("f 1//1 3//1 2//1\nf 1//2 2//2 4//2\nf 2//3 3//3 4//3\nf 3//4 1//4 4//4\n");
        let creased = creased.expect("closed");
        let normals = creased.normals().expect("interpolated");
        assert_eq!(normals.at(0, [0.2, 0.3, 0.5]), Some(-DVec3::Z));
        assert_eq!(creased.vertices().len(), 4);

        let gap = with("f 1//1 3//1 2//1\nf 1//2 2//2 4//2\nf 2//3 3//3 4//3\nf 3 1 4\n");
        let gap = gap.expect("closed");
        assert_eq!(gap.normals(), load(TETRAHEDRON).expect("closed").normals());
    }

    #[test]
    fn a_missing_file_is_named() {
        let error = load_obj(Path::new("/no/such/body.obj"), None, false).expect_err("missing");
        assert!(error.to_string().contains("/no/such/body.obj"), "{error}");
        assert!(error.to_string().contains("help:"), "{error}");
    }

    #[test]
    fn malformed_files_are_refused() {
        refused("v 0 0 zero\n", &["position parse error"]);
        load(&format!("\u{feff}{TETRAHEDRON}")).expect("a byte order mark is no vertex");
        refused("v 0 0 0\nf 1 a 2\n", &["face parse error"]);
        refused("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", &["out of bounds", "lacks"]);
        refused("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", &["out of bounds"]);
    }

    #[test]
    fn bad_data_is_refused() {
        refused("", &["no triangles"]);
        refused("v 0 0 0\nv 1 0 0\nl 1 2\n", &["no triangles"]);
        refused(&TETRAHEDRON.replace("v 1 0 0", "v inf 0 nan"), &["1 vertex is not finite", "inf"]);
        refused(
            &format!("{TETRAHEDRON}v 5 5 5\nv 6 6 6\nv 7 7 7\nf 5 6 7\nf 1 2 2\n"),
            &["2 triangles have no area", "triangle 4, (5, 5, 5)", "triangle 5"],
        );
        let (vertices, faces) = TETRAHEDRON.split_once('f').expect("faces");
        refused(&format!("{}f{faces}", vertices.replace('1', "1e-70")), &["longest side"]);
    }

    #[test]
    fn open_meshes_are_refused() {
        let open = TETRAHEDRON.replace("f 2 3 4\n", "");
        refused(&open, &["3 boundary edges", "at (0, 1, 0) to (1, 0, 0)"]);
    }

    #[test]
    fn crowded_edges_are_refused() {
        let fin = format!("{TETRAHEDRON}v 1 1 1\nf 1 2 5\nf 2 1 5\n");
        refused(&fin, &["1 non-manifold edge", "(0, 0, 0) to (1, 0, 0)"]);
    }

    #[test]
    fn inconsistent_orientation_is_refused() {
        let turned = TETRAHEDRON.replace("f 2 3 4", "f 3 2 4");
        refused(&turned, &["3 edges between triangles of opposite orientation", "(1, 0, 0)"]);
    }

    #[test]
    fn parts_that_touch_in_a_point_are_refused() {
        let twin = "v -1 0 0\nv 0 -1 0\nv 0 0 -1\nf 1 5 6\nf 1 7 5\nf 5 7 6\nf 6 7 1\n";
        refused(&format!("{TETRAHEDRON}{twin}"), &["1 non-manifold vertex", "(0, 0, 0)"]);
    }

    #[test]
    fn inside_out_parts_are_refused_but_cavities_are_not() {
        let flipped = TETRAHEDRON.replace("f 1 3 2", "f 1 2 3").replace("f 1 2 4", "f 1 4 2");
        let flipped = flipped.replace("f 2 3 4", "f 2 4 3").replace("f 3 1 4", "f 3 4 1");
        refused(&flipped, &["1 part of the mesh is inside out", "(0, 0, 0)"]);

        let moved = |offset: f64, size: f64| {
            let at = |x: f64| offset + size * x;
            format!(
                "v {0} {0} {0}\nv {1} {0} {0}\nv {0} {1} {0}\nv {0} {0} {1}\n\
                 f 5 6 7\nf 5 8 6\nf 6 8 7\nf 7 8 5\n",
                at(0.0),
                at(1.0)
            )
        };
        let cavity = load(&format!("{TETRAHEDRON}{}", moved(0.1, 0.2))).expect("a cavity");
        assert!(!cavity.contains(DVec3::splat(0.11)) && cavity.contains(DVec3::splat(0.05)));
        refused(&format!("{TETRAHEDRON}{}", moved(3.0, 1.0)), &["inside out", "(3, 3, 3)"]);
    }

    #[test]
    fn findings_of_one_stage_come_together() {
        let both = format!("{TETRAHEDRON}v 1 1 1\nf 1 2 5\n");
        refused(&both, &["2 boundary edges", "1 non-manifold edge", "2 errors"]);
    }
}
