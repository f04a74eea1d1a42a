//! A model as quads: `quads MODEL OUT.obj [FACES]`.

use std::error::Error;
use std::fmt::Write;
use std::path::Path;
use std::time::Instant;

use mesh::read::{Limits, ModelFormat, load};
use mesh::topology;
use remesh::{QuadOptions, quads};

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [model, out, faces @ ..] = words.as_slice() else {
        return Err("quads MODEL OUT.obj [FACES]".into());
    };
    let path = Path::new(model);
    let format = ModelFormat::from_file_name(model).ok_or("unknown format")?;
    let mesh = load(&std::fs::read(path)?, format, None, &Limits::default())?.mesh;
    let faces = faces.first().map_or(Ok(5000), |word| word.parse())?;
    let begin = Instant::now();
    let made = quads(&mesh, &QuadOptions { faces, crease_angle_deg: 40.0 }, &|| false)
        .ok_or("a mesh without area")?;
    let seconds = begin.elapsed().as_secs_f64();
    let split = made.triangulated();
    println!(
        "{model}: {} quads, {seconds:.2} s, genus {} ({}), volume {:.4}, {:?}",
        made.quads.len(),
        topology::genus(&split),
        topology::genus(&mesh),
        split.signed_volume() / mesh.signed_volume(),
        topology::check_manifold(&split),
    );
    let mut obj = String::new();
    for p in &made.positions {
        writeln!(obj, "v {} {} {}", p.x, p.y, p.z)?;
    }
    for quad in &made.quads {
        obj.push('f');
        quad.iter().try_for_each(|corner| write!(obj, " {}", corner + 1))?;
        obj.push('\n');
    }
    std::fs::write(out, obj)?;
    Ok(())
}
