//! Curves as SVG plots.

use plotters::prelude::*;
use plotters::style::RGBColor;

/// A plot could not be drawn.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the plot {name}: {reason}")]
pub struct PlotError {
    name: String,
    reason: String,
}

/// Curves in one frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Panel {
    pub title: String,
    pub x_label: String,
    pub y_label: String,
    pub series: Vec<Series>,
    /// Names of x = 0, 1, 2, …; then points are not joined.
    pub categories: Vec<String>,
}

/// One curve.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Series {
    pub name: String,
    pub points: Vec<(f64, f64)>,
}

impl Series {
    pub(crate) fn new(name: &str, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.to_owned(), points }
    }
}

/// Of Okabe & Ito: told apart by colour-blind readers, and in print.
const COLOURS: [RGBColor; 5] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
];

const PANEL_WIDTH: u32 = 480;
const PANEL_HEIGHT: u32 = 320;
const FONT: &str = "sans-serif";

/// Draws panels in `columns` as one SVG. Its text is text: no font is needed
/// here.
///
/// # Errors
/// [`PlotError`] if the plotting library refuses.
pub(super) fn svg(name: &str, panels: &[Panel], columns: usize) -> Result<String, PlotError> {
    let rows = panels.len().div_ceil(columns.max(1));
    let size = (PANEL_WIDTH * columns as u32, PANEL_HEIGHT * rows as u32);
    let mut text = String::new();
    let failed = |reason: String| PlotError { name: name.to_owned(), reason };
    {
        let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
        root.fill(&WHITE).map_err(|error| failed(error.to_string()))?;
        for (area, panel) in root.split_evenly((rows, columns)).iter().zip(panels) {
            draw(area, panel).map_err(&failed)?;
        }
        root.present().map_err(|error| failed(error.to_string()))?;
    }
    Ok(text)
}

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;

fn draw(area: &Area<'_>, panel: &Panel) -> Result<(), String> {
    let text = |error: DrawingAreaErrorKind<std::io::Error>| error.to_string();
    let points = || panel.series.iter().flat_map(|series| &series.points);
    let (left, right) = padded(points().map(|point| point.0));
    let (low, high) = padded(points().map(|point| point.1));
    let mut chart = ChartBuilder::on(area)
        .caption(&panel.title, (FONT, 15))
        .margin(10)
        .x_label_area_size(34)
        .y_label_area_size(58)
        .build_cartesian_2d(left..right, low..high)
        .map_err(text)?;
    let name_of = |x: &f64| match panel.categories.as_slice() {
        [] => super::table::short(*x),
        names if (x - x.round()).abs() < 1e-6 && *x >= 0.0 => {
            names.get(x.round() as usize).cloned().unwrap_or_default()
        }
        _ => String::new(),
    };
    chart
        .configure_mesh()
        .x_desc(&panel.x_label)
        .y_desc(&panel.y_label)
        .x_labels(panel.categories.len().max(8))
        .label_style((FONT, 11))
        .x_label_formatter(&name_of)
        .y_label_formatter(&|y| super::table::short(*y))
        .light_line_style(WHITE)
        .draw()
        .map_err(text)?;
    for (series, colour) in panel.series.iter().zip(COLOURS.into_iter().cycle()) {
        if panel.categories.is_empty() {
            chart
                .draw_series(LineSeries::new(series.points.iter().copied(), &colour))
                .map_err(text)?;
        }
        let dots = series.points.iter().map(|&point| Circle::new(point, 3, colour.filled()));
        chart
            .draw_series(dots)
            .map_err(text)?
            .label(&series.name)
            .legend(move |(x, y)| Circle::new((x + 8, y), 3, colour.filled()));
    }
    chart
        .configure_series_labels()
        .label_font((FONT, 11))
        .background_style(WHITE.mix(0.8))
        .border_style(BLACK.mix(0.3))
        .draw()
        .map_err(text)
}

/// The range of values with some room; 0 to 1 without any.
fn padded(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let finite = values.filter(|value| value.is_finite());
    let range = finite.fold(None, |range: Option<(f64, f64)>, value| {
        let (low, high) = range.unwrap_or((value, value));
        Some((low.min(value), high.max(value)))
    });
    let Some((low, high)) = range else { return (0.0, 1.0) };
    let room = if high > low { 0.06 * (high - low) } else { 0.5 };
    (low - room, high + room)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn panel(points: Vec<(f64, f64)>) -> Panel {
        Panel {
            title: "a & b".to_owned(),
            series: vec![Series::new("one", points)],
            ..Panel::default()
        }
    }

    #[test]
    fn a_plot_is_an_svg_with_its_text() {
        let panels = [panel(vec![(0.0, 1.0), (1.0, 3.0)]), panel(vec![])];
        let text = svg("test", &panels, 2).unwrap();
        assert!(text.starts_with("<svg") && text.trim_end().ends_with("</svg>"), "{text}");
        assert!(text.contains("a &amp; b") && text.contains("one"), "{text}");
        assert_eq!(text, svg("test", &panels, 2).unwrap());
    }

    #[test]
    fn ranges_have_room_even_for_one_value() {
        assert_eq!(padded([2.0].into_iter()), (1.5, 2.5));
        assert_eq!(padded(std::iter::empty()), (0.0, 1.0));
        let (low, high) = padded([0.0, f64::NAN, 10.0].into_iter());
        assert!(low < 0.0 && high > 10.0);
    }
}
