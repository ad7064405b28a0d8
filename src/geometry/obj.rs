//! Wavefront OBJ files. The only module that uses `tobj`.

use std::path::Path;

use tobj::LoadOptions;

use super::imported::ImportedMesh;
use crate::error::{Error, Result};
use crate::math::DVec3;

/// Reads all objects of an OBJ file; faces with more corners become fans.
///
/// # Errors
/// Malformed files.
pub(super) fn read(bytes: &[u8]) -> Result<ImportedMesh> {
    // To `tobj` the byte order mark that some editors put before a text is a letter of the first word.
    let mut bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    // One index for positions and normals: a corner without a normal then leaves a gap that shows in
    // the lengths. Points and lines are no surface.
    let options =
        LoadOptions { triangulate: true, single_index: true, ignore_points: true, ignore_lines: true };
    // Materials are of no interest, so a missing library is none either.
    let no_materials = |_: &Path| Ok(Default::default());
    let (models, _) = tobj::load_obj_buf(&mut bytes, &options, no_materials).map_err(malformed)?;
    let mut mesh = ImportedMesh::new();
    for part in models.into_iter().map(|model| model.mesh) {
        mesh.add(points(&part.positions), points(&part.normals), triples(&part.indices));
    }
    Ok(mesh)
}

fn points(numbers: &[f64]) -> impl Iterator<Item = DVec3> {
    numbers.as_chunks::<3>().0.iter().map(|&p| DVec3::from_array(p))
}

fn triples(indices: &[u32]) -> impl Iterator<Item = [u32; 3]> {
    indices.as_chunks::<3>().0.iter().copied()
}

fn malformed(error: tobj::LoadError) -> Error {
    let help = match error {
        tobj::LoadError::FaceVertexOutOfBounds | tobj::LoadError::FaceNormalOutOfBounds => {
            "a face points to a vertex that the file lacks; export it again"
        }
        _ => "the mesh must be a Wavefront OBJ text with v and f lines; export it again",
    };
    Error::input_help(error.to_string(), help)
}
