//! Meshes from files: OBJ and PLY, placed in the scene.

use std::path::Path;

use super::imported::ImportedMesh;
use super::{Mesh, extent, obj, ply};
use crate::error::{Error, Result};
use crate::input;
use crate::math::{DVec3, sin_cos_turns};

/// How the body of a file is placed: by `is_y_up`, `unit_mm`, `longest_side_mm`, `rotate_deg` and
/// `translate_mm`, in this order.
#[derive(Clone, Debug, PartialEq)]
pub struct Placement {
    /// The file's y axis points up: it becomes z, and z becomes -y.
    pub is_y_up: bool,
    /// Length of the file's unit, mm.
    pub unit_mm: f64,
    /// The longest side of its box gets that length, and the box is centred at the origin.
    pub longest_side_mm: Option<f64>,
    /// Turns about x, then y, then z, degrees, counter-clockwise as seen from the tip of the axis.
    pub rotate_deg: [f64; 3],
    /// Shift, mm.
    pub translate_mm: DVec3,
}

impl Default for Placement {
    /// As the file says, in mm.
    fn default() -> Placement {
        Placement {
            is_y_up: false,
            unit_mm: 1.0,
            longest_side_mm: None,
            rotate_deg: [0.0; 3],
            translate_mm: DVec3::ZERO,
        }
    }
}

/// Formats that other programs write often, by the ending of their names.
const OTHERS: [&str; 9] = ["stl", "gltf", "glb", "fbx", "dae", "usd", "usdz", "3ds", "blend"];

/// Reads a closed mesh from an OBJ or a PLY file and places it. Vertices at exactly the same position
/// become one. `interpolated` shading uses the file's normals if every corner has one, else
/// angle-weighted ones.
///
/// # Errors
/// Unreadable or malformed files, and everything that [`Mesh::new`] refuses, naming the file.
pub fn load_mesh(path: &Path, placement: &Placement, interpolated: bool) -> Result<Mesh> {
    let bytes = input::read(path, input::LARGEST_DATA).map_err(|error| {
        let rule = format!("could not read the mesh `{}`: {error}", path.display());
        Error::input_help(
            rule,
            "its path is relative to the folder of the experiment file, and `~` has no meaning in it",
        )
    })?;
    let named = |error: Error| error.about(&format!("`{}`", path.display()));
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_lowercase();
    let read = if bytes.starts_with(b"ply") {
        ply::read(&bytes)
    } else if OTHERS.contains(&&*ending) {
        Err(Error::input_help(
            format!("{} files are not read", ending.to_uppercase()),
            "OBJ and PLY are: export the mesh as one of them (in Blender: File > Export)",
        ))
    } else {
        obj::read(&bytes)
    };
    let mut mesh = read.map_err(named)?;
    place(&mut mesh, placement);
    mesh.finish(interpolated).map_err(named)
}

fn place(mesh: &mut ImportedMesh, placement: &Placement) {
    if placement.is_y_up {
        let upright = |v: DVec3| DVec3::new(v.x, -v.z, v.y);
        mesh.vertices().iter_mut().for_each(|v| *v = upright(*v));
        mesh.turn_normals(upright);
    }
    if placement.unit_mm != 1.0 {
        mesh.vertices().iter_mut().for_each(|v| *v *= placement.unit_mm);
    }
    if let Some(side) = placement.longest_side_mm {
        fit(mesh.vertices(), side);
    }
    for (axis, degrees) in placement.rotate_deg.into_iter().enumerate().filter(|(_, d)| *d != 0.0) {
        let (sin, cos) = sin_cos_turns(degrees / 360.0);
        let turn = |v: DVec3| {
            let mut v = v.to_array();
            let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
            (v[i], v[j]) = (cos * v[i] - sin * v[j], sin * v[i] + cos * v[j]);
            DVec3::from_array(v)
        };
        mesh.vertices().iter_mut().for_each(|v| *v = turn(*v));
        mesh.turn_normals(turn);
    }
    if placement.translate_mm != DVec3::ZERO {
        mesh.vertices().iter_mut().for_each(|v| *v += placement.translate_mm);
    }
}

/// Scales the longest side to `side` mm and centres the box at the origin.
fn fit(vertices: &mut [DVec3], side: f64) {
    let (min, max) = extent(vertices.iter().copied());
    let (center, scale) = ((min + max) * 0.5, side / (max - min).max_element());
    if scale.is_finite() {
        vertices.iter_mut().for_each(|v| *v = (*v - center) * scale);
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
        load_mesh(&path, &Placement { longest_side_mm, ..Placement::default() }, interpolated)
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
        let error = load_mesh(Path::new("/no/such/body.obj"), &Placement::default(), false)
            .expect_err("missing");
        assert!(error.to_string().contains("/no/such/body.obj"), "{error}");
        assert!(error.to_string().contains("help:"), "{error}");
    }

    #[test]
    fn malformed_files_are_refused() {
        refused("v 0 0 zero\n", &["position parse error"]);
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

    /// The same body as text and as binary PLY, polygons and normals included, and as OBJ.
    #[test]
    fn ply_files_are_read() {
        let head = |format: &str| {
            format!(
                "ply\nformat {format} 1.0\ncomment made by hand\nelement vertex 4\nproperty float x\n\
                 property float y\nproperty double z\nelement face 4\n\
                 property list uchar int vertex_indices\nend_header\n"
            )
        };
        let corners: [[f64; 3]; 4] =
            [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        let text: String = corners.iter().map(|[x, y, z]| format!("{x} {y} {z}\n")).collect();
        let text = text + &faces.iter().map(|[a, b, c]| format!("3 {a} {b} {c}\n")).collect::<String>();
        let mut binary = head("binary_little_endian").into_bytes();
        for [x, y, z] in corners {
            binary.extend([x, y].map(|v| (v as f32).to_le_bytes()).concat());
            binary.extend(z.to_le_bytes());
        }
        for face in faces {
            binary.push(3);
            binary.extend(face.map(|i: i32| i.to_le_bytes()).concat());
        }
        let folder = tempfile::tempdir().expect("a folder");
        let obj = load(TETRAHEDRON).expect("closed");
        for bytes in [(head("ascii") + &text).into_bytes(), binary] {
            let path = folder.path().join("body.ply");
            std::fs::write(&path, bytes).expect("a file");
            let mesh = load_mesh(&path, &Placement::default(), true).unwrap_or_else(|e| panic!("{e}"));
            // The two formats count vertices in another order.
            let sorted = |mesh: &Mesh| {
                let mut vertices: Vec<String> =
                    mesh.vertices().iter().map(|v| format!("{v:?}")).collect();
                vertices.sort();
                vertices
            };
            assert_eq!(sorted(&mesh), sorted(&obj));
            assert_eq!(mesh.triangles().len(), 4);
            assert!(mesh.contains(DVec3::splat(0.1)) && !mesh.contains(DVec3::splat(0.4)));
        }
        let refuse = |text: String, part: &str| {
            let path = folder.path().join("wrong.ply");
            std::fs::write(&path, text).expect("a file");
            let error = load_mesh(&path, &Placement::default(), true).expect_err("refused").to_string();
            assert!(
                error.contains(part) && error.contains("wrong.ply") && error.contains("help:"),
                "{error}"
            );
        };
        refuse(head("ascii") + &text.replace("3 2 0 3", "3 2 0 9"), "face 3 points to vertex 9");
        refuse(head("ascii") + "0 0", "not a usable PLY file");
        refuse((head("ascii") + &text).replace("vertex_indices", "corners"), "no `vertex_indices`");
    }

    /// Up, unit, size, turns and shift, in this order; normals turn along.
    #[test]
    fn meshes_are_placed() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("body.obj");
        let box_of = "v 0 0 0\nv 1 0 0\nv 1 2 0\nv 0 2 0\nv 0 0 3\nv 1 0 3\nv 1 2 3\nv 0 2 3\n\
                      f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
        std::fs::write(&path, box_of).expect("a file");
        let extent_of = |placement: Placement| {
            let mesh = load_mesh(&path, &placement, false).unwrap_or_else(|e| panic!("{e}"));
            let (min, max) = extent(mesh.vertices().iter().copied());
            (min.to_array(), max.to_array())
        };
        let usual = Placement::default();
        assert_eq!(extent_of(usual.clone()), ([0.0, 0.0, 0.0], [1.0, 2.0, 3.0]));
        let up = Placement { is_y_up: true, ..usual.clone() };
        assert_eq!(
            extent_of(up.clone()),
            ([0.0, -3.0, 0.0], [1.0, 0.0, 2.0]),
            "y becomes z, z becomes -y"
        );
        let metres = Placement { unit_mm: 1000.0, ..up };
        assert_eq!(extent_of(metres), ([0.0, -3000.0, 0.0], [1000.0, 0.0, 2000.0]));
        // A quarter turn about z, then a shift; quarter turns are exact.
        let turned = Placement {
            rotate_deg: [0.0, 0.0, 90.0],
            translate_mm: DVec3::new(0.0, 0.0, 1.0),
            ..usual.clone()
        };
        assert_eq!(extent_of(turned), ([-2.0, 0.0, 1.0], [0.0, 1.0, 4.0]));
        // About x first, then z: (0, 0, 3) goes to (0, -3, 0), then to (3, 0, 0).
        let twice = Placement { rotate_deg: [90.0, 0.0, 90.0], ..usual.clone() };
        assert_eq!(extent_of(twice), ([0.0, 0.0, 0.0], [3.0, 1.0, 2.0]));
        let sized = Placement { longest_side_mm: Some(6.0), translate_mm: DVec3::X, ..usual };
        assert_eq!(extent_of(sized), ([0.0, -2.0, -3.0], [2.0, 2.0, 3.0]));

        let vertices = TETRAHEDRON.split_once('f').expect("faces").0;
        let normals = "vn 0 0 -2\nvn 0 -1 0\nvn 1 1 1\nvn -1 0 0\n";
        let faces = "f 1//1 3//1 2//1\nf 1//2 2//2 4//2\nf 2//3 3//3 4//3\nf 3//4 1//4 4//4\n";
        std::fs::write(&path, format!("{vertices}{normals}{faces}")).expect("a file");
        let placement = Placement { rotate_deg: [0.0, 90.0, 0.0], ..Placement::default() };
        let mesh = load_mesh(&path, &placement, true).unwrap_or_else(|e| panic!("{e}"));
        let normal = mesh.normals().and_then(|n| n.at(0, [0.2, 0.3, 0.5])).expect("a normal");
        assert_eq!(normal, -DVec3::X, "-z turns to -x about y");
    }

    #[test]
    fn other_formats_are_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("body.stl");
        std::fs::write(&path, "solid body\n").expect("a file");
        let error = load_mesh(&path, &Placement::default(), false).expect_err("refused").to_string();
        assert!(error.contains("STL") && error.contains("OBJ") && error.contains("PLY"), "{error}");
    }
}
