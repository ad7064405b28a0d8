//! PLY files, as text or binary. The only module that uses `ply_rs_bw`.

use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{DefaultElement, Property};

use super::imported::ImportedMesh;
use crate::error::{Error, Result};
use crate::math::DVec3;

/// Reads the vertices and faces of a PLY file; faces with more corners become fans. Normals are those of
/// the vertices, `nx`, `ny`, `nz`.
///
/// # Errors
/// Malformed files, and faces that point beyond the vertices.
pub(super) fn read(mut bytes: &[u8]) -> Result<ImportedMesh> {
    let help = "the mesh must be a PLY file with elements `vertex` and `face`; export it again";
    let malformed = |what: String| Error::input_help(what, help);
    let file = Parser::<DefaultElement>::new().read_ply(&mut bytes);
    let file = file.map_err(|error| malformed(format!("not a usable PLY file: {error}")))?;
    let element = |name: &str| file.payload.get(name).map(Vec::as_slice).unwrap_or_default();
    let vertices = element("vertex");
    let vector = |vertex: &DefaultElement, keys: [&str; 3]| {
        let [x, y, z] = keys.map(|key| vertex.get(key).and_then(number));
        Some(DVec3::new(x?, y?, z?))
    };
    let positions: Option<Vec<DVec3>> = vertices.iter().map(|v| vector(v, ["x", "y", "z"])).collect();
    let positions = positions.ok_or_else(|| malformed("a vertex has no `x`, `y`, `z`".into()))?;
    let normals: Option<Vec<DVec3>> = vertices.iter().map(|v| vector(v, ["nx", "ny", "nz"])).collect();
    let mut triangles = Vec::new();
    for (index, face) in element("face").iter().enumerate() {
        let corners = face.get("vertex_indices").or_else(|| face.get("vertex_index"));
        let corners = corners.and_then(Property::to_u32_list);
        let corners =
            corners.ok_or_else(|| malformed(format!("face {index} has no `vertex_indices`")))?;
        if let Some(beyond) = corners.iter().find(|i| **i as usize >= positions.len()) {
            return Err(malformed(format!(
                "face {index} points to vertex {beyond}, and there are {}",
                positions.len()
            )));
        }
        triangles.extend(corners.windows(2).skip(1).map(|pair| [corners[0], pair[0], pair[1]]));
    }
    let mut mesh = ImportedMesh::new();
    mesh.add(positions, normals.unwrap_or_default(), triangles);
    Ok(mesh)
}

fn number(property: &Property) -> Option<f64> {
    match *property {
        Property::Double(x) => Some(x),
        Property::Float(x) => Some(f64::from(x)),
        Property::Char(x) => Some(f64::from(x)),
        Property::UChar(x) => Some(f64::from(x)),
        Property::Short(x) => Some(f64::from(x)),
        Property::UShort(x) => Some(f64::from(x)),
        Property::Int(x) => Some(f64::from(x)),
        Property::UInt(x) => Some(f64::from(x)),
        _ => None,
    }
}
