//! Plots of an experiment, as SVG.

use super::table::Spread;
use super::{Experiment, ReportError};
use plotters::prelude::*;
use std::path::Path;

/// Width and height of a plot.
const SIZE: (u32, u32) = (560, 360);

/// Colours of the variants, in their order.
const COLOURS: [RGBColor; 6] = [
    RGBColor(52, 101, 164),
    RGBColor(214, 109, 26),
    RGBColor(60, 140, 70),
    RGBColor(150, 60, 140),
    RGBColor(120, 90, 60),
    RGBColor(90, 90, 90),
];

fn colour(index: usize) -> RGBColor {
    COLOURS[index % COLOURS.len()]
}

/// A line, with a band around it where there is one.
struct Series {
    name: String,
    colour: RGBColor,
    points: Vec<(f64, f64)>,
    /// Lower and upper edge at each point.
    band: Vec<(f64, [f64; 2])>,
}

impl Experiment {
    /// Draws, for each scene, the error over time and the acceptance of each kind of mutation by length.
    pub(super) fn draw(&self, folder: &Path) -> Result<(), ReportError> {
        for scene in self.scenes() {
            if self.recipe.times.len() > 1 {
                self.draw_errors(&scene, folder)?;
            }
            self.draw_acceptance(&scene, folder)?;
        }
        Ok(())
    }

    /// Mean squared error over time, with a band of one standard deviation.
    fn draw_errors(&self, scene: &str, folder: &Path) -> Result<(), ReportError> {
        let series = self.recipe.variants.iter().enumerate().map(|(index, variant)| {
            let at = |time: &f64| (*time, self.errors(scene, &variant.name, *time));
            let errors: Vec<(f64, Spread)> = self.recipe.times.iter().map(at).collect();
            let edges = |spread: &Spread| {
                // What is below a logarithmic axis is cut off.
                let low = (spread.mean - spread.deviation).max(0.1 * spread.mean);
                [low.log10(), (spread.mean + spread.deviation).log10()]
            };
            Series {
                name: variant.name.clone(),
                colour: colour(index),
                points: errors.iter().map(|(time, spread)| (time.log10(), spread.mean.log10())).collect(),
                band: errors.iter().map(|(time, spread)| (time.log10(), edges(spread))).collect(),
            }
        });
        let titles = [&format!("{scene}: mean squared error"), "log10 of seconds", "log10 of the error"];
        let corner = SeriesLabelPosition::UpperRight;
        chart(&folder.join(format!("{scene}-error.svg")), titles, corner, &series.collect::<Vec<_>>())
    }

    /// Accepted share by length, of all kinds of mutations.
    fn draw_acceptance(&self, scene: &str, folder: &Path) -> Result<(), ReportError> {
        let mut series = Vec::new();
        for kind in ["small_step", "technique_change"] {
            for variant in &self.recipe.variants {
                let shares = self.acceptance(scene, &variant.name, kind).into_iter();
                let share = |(length, [accepted, proposed]): (usize, [u64; 2])| {
                    (length > 0 && proposed > 0).then(|| (length as f64, accepted as f64 / proposed as f64))
                };
                let points: Vec<_> = shares.filter_map(share).collect();
                if !points.is_empty() {
                    let name = format!("{}, {}", variant.name, kind.replace('_', " "));
                    series.push(Series { name, colour: colour(series.len()), points, band: Vec::new() });
                }
            }
        }
        if series.is_empty() {
            return Ok(());
        }
        // The axis of shares has both its ends.
        let span = series[0].points[0].0;
        let corners = vec![(span, [0.0, 0.0]), (span, [1.0, 1.0])];
        series.push(Series { name: String::new(), colour: WHITE, points: Vec::new(), band: corners });
        let titles = [&format!("{scene}: accepted"), "path length", "share"];
        chart(&folder.join(format!("{scene}-acceptance.svg")), titles, SeriesLabelPosition::LowerLeft, &series)
    }
}

/// Draws lines with their names at the place `legend`. Titles are those of the chart and of both axes.
fn chart(path: &Path, titles: [&str; 3], legend: SeriesLabelPosition, series: &[Series]) -> Result<(), ReportError> {
    let fail = |error: &dyn std::fmt::Display| ReportError::Plot {
        name: path.display().to_string(),
        message: error.to_string(),
    };
    let xs = || series.iter().flat_map(|one| one.points.iter().map(|point| point.0));
    let ys = || {
        let edges = series.iter().flat_map(|one| one.band.iter().flat_map(|(_, edges)| *edges));
        series.iter().flat_map(|one| one.points.iter().map(|point| point.1)).chain(edges)
    };
    let range = |values: &mut dyn Iterator<Item = f64>| {
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        let margin = 0.04 * (high - low).max(1e-3);
        low - margin..high + margin
    };
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        root.fill(&WHITE).map_err(|error| fail(&error))?;
        let mut chart = ChartBuilder::on(&root)
            .caption(titles[0], ("sans-serif", 18))
            .margin(10)
            .x_label_area_size(40)
            .y_label_area_size(60)
            .build_cartesian_2d(range(&mut xs()), range(&mut ys()))
            .map_err(|error| fail(&error))?;
        let mut mesh = chart.configure_mesh();
        mesh.x_desc(titles[1]).y_desc(titles[2]).light_line_style(WHITE).draw().map_err(|error| fail(&error))?;
        for Series { name, colour, points, band } in series.iter().filter(|one| !one.name.is_empty()) {
            let colour = *colour;
            if !band.is_empty() {
                let lower = band.iter().map(|(x, [low, _])| (*x, *low));
                let upper = band.iter().rev().map(|(x, [_, high])| (*x, *high));
                let outline: Vec<_> = lower.chain(upper).collect();
                let area = std::iter::once(Polygon::new(outline, colour.mix(0.18)));
                chart.draw_series(area).map_err(|error| fail(&error))?;
            }
            let line = LineSeries::new(points.iter().copied(), colour.stroke_width(2));
            let drawn = chart.draw_series(line).map_err(|error| fail(&error))?;
            drawn.label(name).legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour.stroke_width(2)));
        }
        let mut labels = chart.configure_series_labels();
        labels
            .position(legend)
            .background_style(WHITE.mix(0.8))
            .border_style(BLACK.mix(0.3))
            .draw()
            .map_err(|error| fail(&error))?;
        root.present().map_err(|error| fail(&error))?;
    }
    crate::image::write_whole(path, |out| {
        let io = |source| crate::image::ImageError::Io { path: path.to_owned(), action: "write", source };
        std::io::Write::write_all(out, text.as_bytes()).map_err(io)
    })?;
    Ok(())
}
