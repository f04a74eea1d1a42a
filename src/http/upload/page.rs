//! A page in an upload: its figures become the views of the sheet.

use bytes::Bytes;
use image::RgbaImage;

use super::parts::FilePart;
use super::pictures::{Decoders, image_problem};
use crate::http::HttpLimits;
use crate::http::problem::{
    DUPLICATE_AZIMUTH, INVALID_ANGLE, MISSING_PART, NO_FIGURE, Problem, TOO_MANY_PIXELS,
    TOO_MANY_VIEWS, WRONG_NUMBER_OF_FIGURES,
};
use ::page::{AnimationError, PageError, PageOptions, PageProposal};
use frames::{Azimuth, Viewpoint};
use progress::Silent;

/// The parts `page` and `azimuths`.
#[derive(Debug, Default)]
pub(crate) struct PageParts {
    pub page: Option<FilePart>,
    /// A page that is stored.
    pub id: Option<String>,
    pub azimuths: Option<String>,
}

/// A view that was cut out of a page.
pub(super) struct PageView {
    pub viewpoint: Viewpoint,
    pub drawing: FilePart,
    /// How likely its azimuth is, if that was guessed.
    pub confidence: Option<f64>,
}

impl PageParts {
    /// The name of a part that was given, if one was.
    pub(super) fn any(&self) -> Option<String> {
        let page = self.page.as_ref().map(|_| "page".to_owned());
        page.or(self.azimuths.as_ref().map(|_| "azimuths".to_owned()))
    }

    /// The views of the page, cut out and encoded; none if there is no page.
    pub(super) async fn views(
        self,
        decoders: &Decoders,
        limits: &HttpLimits,
    ) -> Result<Vec<PageView>, Problem> {
        let Some(page) = self.page else {
            let detail = "`azimuths` is given without a `page` whose figures have them";
            return match self.azimuths {
                None => Ok(Vec::new()),
                Some(_) => Err(Problem::new(MISSING_PART, detail).part("page")),
            };
        };
        let azimuths = azimuth_part(self.azimuths.as_deref())?;
        let limits = *limits;
        decoders.run(move || cut(page.bytes, azimuths.as_deref(), &limits)).await?
    }
}

fn cut(
    bytes: Bytes,
    azimuths: Option<&[Azimuth]>,
    limits: &HttpLimits,
) -> Result<Vec<PageView>, Problem> {
    let (pictures, proposals) = search(&[bytes], azimuths, limits)?;
    let mut views = Vec::new();
    for (picture, proposal) in pictures.iter().zip(&proposals) {
        for (index, figure) in proposal.figures.iter().enumerate() {
            let bytes = encoded(picture, proposal, index)?;
            let file = format!("page, view {}", figure.azimuth);
            views.push(PageView {
                viewpoint: figure.azimuth.into(),
                drawing: FilePart { file, bytes },
                confidence: figure.guessed(),
            });
        }
    }
    Ok(views)
}

/// Decodes the pictures of a page and finds the figures on them. It takes a
/// while: for blocking threads.
///
/// * `files`: one picture or animation of a page, or several of one view each.
/// * `azimuths`: of the figures in reading order; `None` guesses them.
pub(in crate::http) fn search(
    files: &[Bytes],
    azimuths: Option<&[Azimuth]>,
    limits: &HttpLimits,
) -> Result<(Vec<RgbaImage>, Vec<PageProposal>), Problem> {
    let options = PageOptions {
        max_figures: limits.max_views.min(PageOptions::default().max_figures),
        ..PageOptions::default()
    };
    let mut pictures = Vec::new();
    let mut image = limits.image;
    for (number, bytes) in files.iter().enumerate() {
        // All together have at most as many pixels as one may have.
        let found = ::page::decode(bytes, &image, options.max_figures);
        let found = found.map_err(|error| animation_problem(&page_part(number), &error))?;
        let pixels = |p: &RgbaImage| u64::from(p.width()) * u64::from(p.height());
        let used: u64 = found.iter().map(pixels).sum();
        image.max_pixels = image.max_pixels.saturating_sub(used);
        pictures.extend(found);
    }
    let found = ::page::propose_all(&pictures, &options, &Silent);
    // The frames of an animation are of one part.
    let apart = files.len() == pictures.len();
    let mut proposals = found.map_err(|error| page_problem(&error, apart))?;
    if let Some(azimuths) = azimuths {
        ::page::set_azimuths(&mut proposals, azimuths)
            .map_err(|error| number_problem(&error, &proposals))?;
    }
    Ok((pictures, proposals))
}

/// Azimuths as a part says them; `None` if they are to be guessed.
pub(in crate::http) fn azimuth_part(text: Option<&str>) -> Result<Option<Vec<Azimuth>>, Problem> {
    let azimuths = ::page::azimuth_order(text.unwrap_or("auto"));
    azimuths.map_err(|error| Problem::new(INVALID_ANGLE, error).part("azimuths"))
}

/// What the parts `page` are called in problems: `page`, `page[1]` and so on.
pub(super) fn page_part(number: usize) -> String {
    if number == 0 { "page".to_owned() } else { format!("page[{number}]") }
}

fn animation_problem(part: &str, error: &AnimationError) -> Problem {
    match error {
        AnimationError::Picture(error) => image_problem(part, error),
        AnimationError::TooManyFrames { .. } => {
            Problem::new(TOO_MANY_PIXELS, format!("`{part}` {error}; leave some out")).part(part)
        }
    }
}

fn encoded(picture: &RgbaImage, proposal: &PageProposal, index: usize) -> Result<Bytes, Problem> {
    let png = picture::png(&::page::cut_out(picture, proposal, index));
    png.map(Bytes::from).map_err(|error| Problem::internal("a view of the page", &error))
}

/// * `apart`: whether each picture is a part of its own.
fn page_problem(error: &PageError, apart: bool) -> Problem {
    let (number, cause) = match error {
        PageError::InPicture { number, error } => (*number, &**error),
        error => (0, error),
    };
    let (kind, mend) = match cause {
        PageError::TooManyFigures { .. } => (TOO_MANY_VIEWS, "send the views one by one"),
        _ => (NO_FIGURE, "send the views one by one, as parts `view[AZIMUTH]`"),
    };
    let part = page_part(if apart { number } else { 0 });
    Problem::new(kind, format!("{error}; {mend}")).part(part)
}

/// Says which figures were found, so that the azimuths can be put right.
fn number_problem(error: &PageError, proposals: &[PageProposal]) -> Problem {
    if matches!(error, PageError::DuplicateAzimuth(_)) {
        return Problem::new(DUPLICATE_AZIMUTH, error.to_string()).part("azimuths");
    }
    let figures = proposals.iter().flat_map(|proposal| &proposal.figures).enumerate();
    let place = |(k, figure): (usize, &::page::Figure)| {
        format!("{} at {} (azimuth {} by a guess)", k + 1, figure.place, figure.azimuth)
    };
    let list = figures.map(place).collect::<Vec<_>>().join("; ");
    let detail = format!(
        "{error}: {list}; give one azimuth a figure in this order, or `auto`, or send the views one by one; POST it to /v1/pages to see them drawn on the page and put them right"
    );
    Problem::new(WRONG_NUMBER_OF_FIGURES, detail).part("azimuths")
}
