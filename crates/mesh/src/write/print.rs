//! What printers and slicers read: binary STL and 3MF, in millimetres.

use std::fmt::Write as _;
use std::io::{self, Cursor, Write as _};

use nalgebra::Vector3;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

const CONTENT_TYPES: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">
<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>
<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>
</Types>
"#;
const RELATIONSHIPS: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
<Relationship Id="rel0" Target="/3D/3dmodel.model" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>
</Relationships>
"#;

/// Binary STL.
///
/// * `positions_mm`: in the file's frame.
/// * `triangles`: counter-clockwise seen from outside.
///
/// # Errors
/// None of its own; those of writing.
pub fn stl(positions_mm: &[[f32; 3]], triangles: &[[u32; 3]]) -> io::Result<Vec<u8>> {
    let facets = triangles.iter().map(|corners| {
        let [a, b, c] = corners.map(|corner| positions_mm[corner as usize]);
        stl_io::Triangle {
            normal: stl_io::Normal::new(normal(a, b, c)),
            vertices: [a, b, c].map(stl_io::Vertex::new),
        }
    });
    let mut bytes = Vec::new();
    stl_io::write_stl(&mut bytes, facets)?;
    Ok(bytes)
}

/// The unit normal; zero for a triangle without area, as readers expect.
fn normal(a: [f32; 3], b: [f32; 3], c: [f32; 3]) -> [f32; 3] {
    let [a, b, c] = [a, b, c].map(|point| Vector3::from(point).cast::<f64>());
    let normal = (b - a).cross(&(c - a)).try_normalize(0.0);
    normal.unwrap_or_default().cast::<f32>().into()
}

/// 3MF (core specification 1.3): one object of shared vertices. It holds no
/// clock time, so the same mesh is the same bytes.
///
/// * `positions_mm`: in the file's frame.
/// * `triangles`: counter-clockwise seen from outside.
///
/// # Errors
/// Those of writing.
pub fn three_mf(positions_mm: &[[f32; 3]], triangles: &[[u32; 3]]) -> io::Result<Vec<u8>> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default()
        .last_modified_time(DateTime::default())
        .compression_method(CompressionMethod::Deflated)
        .unix_permissions(0o644);
    for (name, content) in [
        ("[Content_Types].xml", CONTENT_TYPES),
        ("_rels/.rels", RELATIONSHIPS),
        ("3D/3dmodel.model", &model(positions_mm, triangles)),
    ] {
        zip.start_file(name, options)?;
        zip.write_all(content.as_bytes())?;
    }
    Ok(zip.finish()?.into_inner())
}

fn model(positions_mm: &[[f32; 3]], triangles: &[[u32; 3]]) -> String {
    let mut xml = String::from(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<model unit=\"millimeter\" xml:lang=\"en-US\" \
         xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\">\n<resources>\n\
         <object id=\"1\" type=\"model\">\n<mesh>\n<vertices>\n",
    );
    // Writing to a String cannot fail.
    for [x, y, z] in positions_mm {
        let _ = writeln!(xml, "<vertex x=\"{x}\" y=\"{y}\" z=\"{z}\"/>");
    }
    xml.push_str("</vertices>\n<triangles>\n");
    // One that has a corner twice is none to the specification.
    for [a, b, c] in triangles.iter().filter(|[a, b, c]| a != b && b != c && c != a) {
        let _ = writeln!(xml, "<triangle v1=\"{a}\" v2=\"{b}\" v3=\"{c}\"/>");
    }
    xml.push_str(
        "</triangles>\n</mesh>\n</object>\n</resources>\n<build>\n<item objectid=\"1\"/>\n\
         </build>\n</model>\n",
    );
    xml
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;

    /// A tetrahedron of 10 mm.
    const CORNERS: [[f32; 3]; 4] =
        [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.0, 10.0]];
    const FACES: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

    #[test]
    fn stl_is_read_back_with_its_normals() {
        let bytes = stl(&CORNERS, &FACES).unwrap();
        assert_eq!(bytes.len(), 84 + 4 * 50);
        let read = stl_io::read_stl(&mut Cursor::new(bytes)).unwrap();
        assert_eq!((read.vertices.len(), read.faces.len()), (4, 4));
        assert_eq!(read.faces[0].normal, stl_io::Normal::new([0.0, 0.0, -1.0]));
        read.validate().unwrap();
        let flat = stl(&CORNERS, &[[0, 1, 1]]).unwrap();
        let flat = stl_io::read_stl(&mut Cursor::new(flat)).unwrap();
        assert_eq!(flat.faces[0].normal, stl_io::Normal::new([0.0; 3]));
    }

    #[test]
    fn three_mf_has_its_parts_and_the_same_bytes_each_time() {
        let bytes = three_mf(&CORNERS, &[FACES.as_slice(), &[[0, 1, 1]]].concat()).unwrap();
        assert_eq!(bytes, three_mf(&CORNERS, &FACES).unwrap());
        let mut zip = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
        let names: Vec<String> = zip.file_names().map(|name| name.unwrap().into_owned()).collect();
        assert_eq!(names, ["[Content_Types].xml", "_rels/.rels", "3D/3dmodel.model"]);
        let mut model = String::new();
        zip.by_name("3D/3dmodel.model").unwrap().read_to_string(&mut model).unwrap();
        assert!(model.contains("unit=\"millimeter\""));
        assert_eq!(model.matches("<vertex ").count(), 4);
        assert_eq!(model.matches("<triangle ").count(), 4);
        assert!(model.contains("<vertex x=\"0\" y=\"10\" z=\"0\"/>"));
        assert!(model.contains("<triangle v1=\"0\" v2=\"2\" v3=\"1\"/>"));
    }
}
