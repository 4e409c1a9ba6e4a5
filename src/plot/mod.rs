//! Plots as SVG text: series of points over two axes, with vertical marks.
//!
//! The same points give the same text on every machine: the SVG embeds no font, so the program that shows it chooses
//! one. Nothing here knows what is plotted, or where it is written.

mod axis;

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::error::{Error, Result};
pub use axis::Scale;
use axis::{Axis, short_number};

/// Width and height of a plot in px.
pub const SIZE_PX: (u32, u32) = (960, 540);

/// Ink, then one colour per series, told apart by colour-blind people too (Okabe and Ito, "Color Universal Design",
/// 2008).
const INK: RGBColor = RGBColor(40, 40, 40);
const GRID: RGBColor = RGBColor(225, 225, 225);
const MARK: RGBColor = RGBColor(150, 150, 150);
const MARK_INK: RGBColor = RGBColor(100, 100, 100);
const SERIES: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(90, 90, 90),
];
const FONT: &str = "sans-serif";
/// About the width of a character of a mark's label, in px.
const CHARACTER_PX: i32 = 7;

/// A line through points, in the order given.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Its name in the legend. There is a legend only if there are several series.
    pub label: String,
    /// Its points (x, y), all finite.
    pub points: Vec<(f64, f64)>,
}

/// A vertical line with a label above it.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// Where it is.
    pub x: f64,
    /// The label, left out where it would overlap the one before.
    pub label: String,
}

/// What to plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Plot {
    /// The title above the plot.
    pub title: String,
    /// The label below the horizontal axis.
    pub x_label: String,
    /// The label beside the vertical axis.
    pub y_label: String,
    /// How the vertical axis is divided; [`Scale::fitting`] chooses a scale.
    pub y_scale: Scale,
    /// The lines.
    pub series: Vec<Series>,
    /// Vertical lines across them.
    pub marks: Vec<Mark>,
}

impl Plot {
    /// The plot as SVG.
    ///
    /// # Errors
    /// [`Error::Internal`] if there is no point, or one that is not finite.
    pub fn svg(&self) -> Result<String> {
        let mut text = String::new();
        self.draw(&mut text).map_err(|reason| Error::Internal(format!("the plot `{}`: {reason}", self.title)))?;
        // A title may be the name of a file, which may hold any character.
        text.retain(is_xml);
        Ok(text)
    }

    fn draw(&self, text: &mut String) -> Result<(), String> {
        let points = || self.series.iter().flat_map(|series| &series.points);
        if points().next().is_none() || points().any(|(x, y)| !x.is_finite() || !y.is_finite()) {
            return Err("it has no points, or one that is not finite".to_owned());
        }
        let x_axis = Axis::over(Scale::Linear, points().map(|point| point.0));
        let y_axis = Axis::over(self.y_scale, points().map(|point| point.1)).with_room();
        let told = |error: &dyn std::fmt::Display| error.to_string();
        let area = SVGBackend::with_string(text, SIZE_PX).into_drawing_area();
        area.fill(&WHITE).map_err(|error| told(&error))?;
        let title = (FONT, 22).into_font().color(&INK);
        let below_title = area.margin(12, 0, 0, 0).titled(&self.title, title).map_err(|error| told(&error))?;
        let mut chart = ChartBuilder::on(&below_title)
            .margin(14)
            .margin_top(24)
            .margin_right(30)
            .x_label_area_size(46)
            .y_label_area_size(78)
            .build_cartesian_2d(x_axis, y_axis)
            .map_err(|error| told(&error))?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID)
            .axis_style(INK)
            .label_style((FONT, 15).into_font().color(&INK))
            .x_label_formatter(&|value| short_number(*value))
            .y_label_formatter(&|value| short_number(*value))
            .x_desc(&self.x_label)
            .y_desc(&self.y_label)
            .draw()
            .map_err(|error| told(&error))?;
        let (_, rows) = chart.plotting_area().get_pixel_range();
        let places = self.marks.iter().map(|mark| chart.backend_coord(&(mark.x, 1.0)).0);
        let marks: Vec<(i32, &str)> = places.zip(self.marks.iter().map(|mark| mark.label.as_str())).collect();
        draw_marks(&area, &marks, rows).map_err(|error| told(&error))?;
        for (series, color) in self.series.iter().zip(SERIES.iter().cycle()) {
            let line = LineSeries::new(series.points.iter().copied(), color.stroke_width(2));
            let drawn = chart.draw_series(line).map_err(|error| told(&error))?;
            drawn.label(&series.label).legend(|(x, y)| PathElement::new([(x, y), (x + 18, y)], color.stroke_width(3)));
        }
        if self.series.len() > 1 {
            chart
                .configure_series_labels()
                .background_style(WHITE.mix(0.85))
                .border_style(GRID)
                .label_font((FONT, 15).into_font().color(&INK))
                .position(SeriesLabelPosition::UpperRight)
                .margin(22)
                .draw()
                .map_err(|error| told(&error))?;
        }
        area.present().map_err(|error| told(&error))
    }
}

/// Whether XML 1.0 allows a character at all, escaped or not (section 2.2, production `Char`).
fn is_xml(character: char) -> bool {
    matches!(character, '\t' | '\n' | '\r' | ' '..='\u{fffd}' | '\u{10000}'..)
}

/// Draws marks at their columns across the rows of the plotting area, and their labels above it.
fn draw_marks<B: DrawingBackend>(
    area: &DrawingArea<B, plotters::coord::Shift>,
    marks: &[(i32, &str)],
    rows: std::ops::Range<i32>,
) -> Result<(), DrawingAreaErrorKind<B::ErrorType>> {
    let style = (FONT, 13).into_font().color(&MARK_INK).pos(Pos::new(HPos::Center, VPos::Bottom));
    let mut free_from = i32::MIN;
    for &(x, label) in marks {
        for top in rows.clone().step_by(8) {
            area.draw(&PathElement::new([(x, top), (x, (top + 4).min(rows.end))], MARK))?;
        }
        let half_px = label.len() as i32 * CHARACTER_PX / 2;
        if x - half_px >= free_from {
            area.draw(&Text::new(label, (x, rows.start - 4), style.clone()))?;
            free_from = x + half_px;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot() -> Plot {
        let points =
            |factor: f64| (0..50).map(|x| (f64::from(x) * 1_000.0, factor * 2.5e7 / f64::from(x + 1))).collect();
        Plot {
            title: "Stars & <stripes>".to_owned(),
            x_label: "births".to_owned(),
            y_label: "SAE".to_owned(),
            y_scale: Scale::Log,
            series: vec![
                Series { label: "current".to_owned(), points: points(1.0) },
                Series { label: "best".to_owned(), points: points(0.9) },
            ],
            marks: vec![
                Mark { x: 20_000.0, label: "restart 1".to_owned() },
                Mark { x: 20_500.0, label: "restart 2".to_owned() },
            ],
        }
    }

    #[test]
    fn a_plot_is_svg_with_its_words_and_without_labels_that_overlap() {
        let svg = plot().svg().expect("there are points");
        assert_eq!(svg, plot().svg().expect("there are points"), "the same points, the same text");
        let tree = resvg::usvg::Tree::from_str(&svg, &resvg::usvg::Options::default()).expect("it parses");
        assert_eq!((tree.size().width(), tree.size().height()), (960.0, 540.0));
        for words in ["births", "SAE", "current", "best", "restart 1", "10M", "40k", "Stars &amp; &lt;stripes&gt;"] {
            assert!(svg.contains(words), "{words}");
        }
        assert!(!svg.contains("restart 2"), "its label would lie over the first one");
    }

    #[test]
    fn a_plot_parses_whatever_its_words_hold() {
        let named = Plot { title: "a\u{1}b\u{1b}[1mc\u{0}\u{ffff}\u{7f}\td".to_owned(), ..plot() };
        let svg = named.svg().expect("there are points");
        resvg::usvg::Tree::from_str(&svg, &resvg::usvg::Options::default()).expect("it parses");
        assert!(svg.contains("ab[1mc"), "what may stay stays");
    }

    #[test]
    fn one_point_and_equal_points_can_be_plotted_and_none_cannot() {
        let with = |points| Plot { series: vec![Series { label: String::new(), points }], ..plot() };
        for points in [vec![(0.0, 0.0)], vec![(5.0, 7.0), (5.0, 7.0)], vec![(0.0, 1.0), (1.0, 1e12)]] {
            for y_scale in [Scale::Linear, Scale::Log] {
                let plotted = Plot { y_scale, ..with(points.clone()) };
                assert!(plotted.svg().is_ok(), "{points:?} {y_scale:?}");
            }
        }
        assert!(with(Vec::new()).svg().is_err());
        assert!(with(vec![(0.0, f64::NAN)]).svg().is_err());
    }
}
