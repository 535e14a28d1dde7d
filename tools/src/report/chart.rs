//! Small charts as SVG.

use super::document::escape;
use std::fmt::Write;

const COLOURS: [&str; 6] = ["#1f6fb4", "#d9541e", "#2b9348", "#8a4fbf", "#b08900", "#555555"];
const WIDTH: f64 = 860.0;

/// Named series over the same steps of `0 ..= end` on the horizontal axis, from zero up.
pub(super) fn lines(series: &[(String, Vec<f64>)], end: f64, x: &str, y: &str) -> String {
    let (height, left, bottom) = (280.0, 60.0, 40.0);
    let top = series.iter().flat_map(|(_, v)| v).fold(0.0f64, |m, &v| m.max(v)).max(1e-9) * 1.05;
    let mut svg = open(height);
    axes(&mut svg, (left, bottom, height), (end, top), (x, y));
    for (i, (name, values)) in series.iter().enumerate() {
        let n = values.len().max(2) as f64 - 1.0;
        let points: Vec<_> = (values.iter().enumerate())
            .map(|(k, v)| {
                let px = left + (WIDTH - left - 20.0) * k as f64 / n;
                format!("{px:.1},{:.1}", (height - bottom) * (1.0 - v / top) + 5.0)
            })
            .collect();
        let colour = COLOURS[i % COLOURS.len()];
        let _ = write!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.6\"/>",
            points.join(" ")
        );
        label(&mut svg, left + 12.0, 18.0 + 16.0 * i as f64, colour, name);
    }
    svg + "</svg>"
}

/// Named groups of bars: for each item a value of each series.
pub(super) fn bars(items: &[String], series: &[(String, Vec<f64>)], y: &str) -> String {
    let (height, left, bottom) = (320.0, 60.0, 110.0);
    let top = series.iter().flat_map(|(_, v)| v).fold(0.0f64, |m, &v| m.max(v)).max(1e-9) * 1.05;
    let mut svg = open(height);
    axes(&mut svg, (left, bottom, height), (0.0, top), ("", y));
    let slot = (WIDTH - left - 20.0) / items.len().max(1) as f64;
    let bar = slot * 0.8 / series.len().max(1) as f64;
    for (s, (name, values)) in series.iter().enumerate() {
        let colour = COLOURS[s % COLOURS.len()];
        for (i, v) in values.iter().enumerate() {
            let h = (height - bottom) * v / top;
            let (px, py) = (left + slot * i as f64 + bar * s as f64, height - bottom - h + 5.0);
            let _ = write!(
                svg,
                "<rect x=\"{px:.1}\" y=\"{py:.1}\" width=\"{bar:.1}\" height=\"{h:.1}\" fill=\"{colour}\"/>"
            );
        }
        label(&mut svg, left + 12.0, 18.0 + 16.0 * s as f64, colour, name);
    }
    // Labels of many items are thinned out.
    let every = items.len().div_ceil(60).max(1);
    for (i, item) in items.iter().enumerate().step_by(every) {
        let (px, py) = (left + slot * (i as f64 + 0.5), height - bottom + 16.0);
        let _ = write!(
            svg,
            "<text x=\"{px:.1}\" y=\"{py:.1}\" font-size=\"10\" text-anchor=\"end\" transform=\"rotate(-45 {px:.1} {py:.1})\">{}</text>",
            escape(item)
        );
    }
    svg + "</svg>"
}

fn open(height: f64) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" width=\"{WIDTH}\" height=\"{height}\" \
         font-family=\"sans-serif\" font-size=\"12\">"
    )
}

fn label(svg: &mut String, x: f64, y: f64, colour: &str, name: &str) {
    let _ = write!(svg, "<text x=\"{x}\" y=\"{y}\" fill=\"{colour}\">{}</text>", escape(name));
}

/// Frame, grid and numbers; `end` 0 leaves the horizontal axis without numbers.
fn axes(svg: &mut String, (left, bottom, height): (f64, f64, f64), (end, top): (f64, f64), (x, y): (&str, &str)) {
    for i in 0..=4 {
        let part = f64::from(i) / 4.0;
        let py = (height - bottom) * (1.0 - part) + 5.0;
        let right = WIDTH - 20.0;
        let _ = write!(svg, "<line x1=\"{left}\" y1=\"{py:.1}\" x2=\"{right}\" y2=\"{py:.1}\" stroke=\"#ddd\"/>");
        let value = number(top * part);
        let _ = write!(
            svg,
            "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"#555\">{value}</text>",
            left - 6.0,
            py + 4.0
        );
        if end > 0.0 {
            let (px, py, value) = (left + (right - left) * part, height - bottom + 22.0, number(end * part));
            let _ =
                write!(svg, "<text x=\"{px:.1}\" y=\"{py:.1}\" text-anchor=\"middle\" fill=\"#555\">{value}</text>");
        }
    }
    let _ = write!(svg, "<text x=\"{}\" y=\"{}\" fill=\"#555\">{}</text>", WIDTH / 2.0, height - 4.0, escape(x));
    let _ = write!(
        svg,
        "<text x=\"14\" y=\"{0}\" fill=\"#555\" transform=\"rotate(-90 14 {0})\">{1}</text>",
        (height - bottom) * 0.75,
        escape(y)
    );
}

/// A number with about three significant digits.
pub(super) fn number(v: f64) -> String {
    match v.abs() {
        0.0 => "0".to_owned(),
        a if a >= 100.0 => format!("{v:.0}"),
        a if a >= 10.0 => format!("{v:.1}"),
        a if a >= 1.0 => format!("{v:.2}"),
        a if a >= 0.01 => format!("{v:.3}"),
        a if a >= 1e-4 => format!("{v:.5}"),
        _ => format!("{v:.1e}"),
    }
}
