//! The command `page`: pictures of a page to cut-out views and a sheet.

use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::{Context, Result, anyhow};
use clap::Args;
use image::RgbaImage;
use serde_json::json;

use super::config::LimitConfig;
use super::failure::Failure;
use super::inputs;
use super::progress_bar::Bar;
use ::page::{PageError, PageOptions, PageProposal};
use frames::Azimuth;

#[derive(Args, Debug)]
pub(super) struct PageArgs {
    /// A page with several views, or an animated GIF of a turn; several pictures are
    /// taken for one view each, in even steps
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Folder for the views and the sheet; made if missing
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// The views' azimuths in reading order, degrees, such as 0,45,90; or auto
    #[arg(long, value_name = "AZIMUTHS", default_value = "auto")]
    azimuths: Order,
    #[command(flatten)]
    limits: LimitConfig,
}

/// Azimuths in the order of the views; `None` where they are to be guessed.
#[derive(Clone, Debug)]
struct Order(Option<Vec<Azimuth>>);

impl FromStr for Order {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        ::page::azimuth_order(text).map(Self)
    }
}

/// Finds the views on a page and writes them with a sheet to a folder.
pub(super) fn run(args: &PageArgs) -> Result<(), Failure> {
    let pictures = pictures(args).map_err(Failure::Input)?;
    let bar = Bar::new();
    let mut proposals = proposals(&pictures, &bar)?;
    drop(bar);
    if let Some(azimuths) = &args.azimuths.0 {
        ::page::set_azimuths(&mut proposals, azimuths)
            .map_err(|error| Failure::Input(anyhow!("--azimuths: {error}")))?;
    }
    write(args, &pictures, &proposals).map_err(Failure::Internal)?;
    for figure in proposals.iter().flat_map(|proposal| &proposal.figures) {
        println!(
            "azimuth {} ({:.0} % sure): columns {} to {}, rows {} to {}",
            figure.azimuth,
            figure.confidence * 100.0,
            figure.place.left,
            figure.place.right,
            figure.place.top,
            figure.place.bottom
        );
    }
    println!("{}", args.output.join("sheet.json").display());
    Ok(())
}

fn pictures(args: &PageArgs) -> Result<Vec<RgbaImage>> {
    let limits = args.limits.image();
    let most = PageOptions::default().max_figures;
    let mut pictures = Vec::new();
    for path in &args.files {
        let name = path.display();
        let bytes = inputs::read_file(path.as_ref()).with_context(|| name.to_string())?;
        let decoded = ::page::decode(&bytes, &limits, most);
        pictures.extend(decoded.map_err(|error| anyhow!("{name} {error}"))?);
    }
    Ok(pictures)
}

fn proposals(pictures: &[RgbaImage], bar: &Bar) -> Result<Vec<PageProposal>, Failure> {
    let options = PageOptions::default();
    let found = ::page::propose_all(pictures, &options, bar);
    found.map_err(|error: PageError| Failure::Input(error.into()))
}

fn write(args: &PageArgs, pictures: &[RgbaImage], proposals: &[PageProposal]) -> Result<()> {
    let put = |name: &str, bytes: &[u8]| {
        let path = args.output.join(name);
        let folder = path.parent().unwrap_or(Path::new(""));
        fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
        fs::write(&path, bytes).with_context(|| path.display().to_string())
    };
    let several = pictures.len() > 1;
    let mut names = Vec::new();
    for (index, (picture, proposal)) in pictures.iter().zip(proposals).enumerate() {
        let preview = if several { format!("preview_{index}.png") } else { "preview.png".into() };
        put(&preview, &picture::png(&::page::preview(picture, proposal))?)?;
        for (k, figure) in proposal.figures.iter().enumerate() {
            let name = format!("views/{}.png", figure.azimuth.padded());
            put(&name, &picture::png(&::page::cut_out(picture, proposal, k))?)?;
            names.push(name);
        }
    }
    let sheet = serde_json::to_value(::page::sheet_document(proposals, &names))?;
    put("page.json", format!("{:#}\n", json!({ "pages": proposals })).as_bytes())?;
    put("sheet.json", format!("{sheet:#}\n").as_bytes())
}
