//! From what was measured to a document.

mod motion;

use super::chart::{bars, number};
use super::document::Document;
use super::spread::Spread;
use super::{Blocks, Numerics, Report};

/// Whether the bundles are of the flow model, and so have latents, samplers and noise.
fn has_latents(report: &Report) -> bool {
    report.numerics.candidates.iter().flat_map(|c| &c.blocks).any(|b| b.round_trip_mm.is_some())
}

/// Head of the column that says what made the motion.
fn maker(report: &Report) -> &'static str {
    if has_latents(report) { "sampler" } else { "generator" }
}

/// The whole report.
pub(super) fn document(report: &Report) -> Document {
    let mut d = Document::default();
    d.heading(1, "Accuracy of quantised bundles");
    let levels = format!("{} ({})", report.numerics.level, report.numerics.arch);
    let (noise, told) = if has_latents(report) {
        let told = ", with each sampler. The quantiser rounds for the sample conversation with other noise; the exchanged voices are new to it.";
        (", with the same noise", told)
    } else {
        ("", ". These bundles are deterministic: they have no latents, samplers or noise.")
    };
    let heard = match report.numerics.sounds {
        0 => String::new(),
        n => format!(" The bundles hear: {n} sounds around the agent were played to them."),
    };
    d.text(format!(
        "Reference: {} (matrices {}), {}. CPU level {levels}. Sizes are against {:.2} MB, the reference's parameters as f32. \
         Errors are teacher-forced: every block is computed from the reference's past{noise}, over {} blocks of the \
         sample conversation and as many with its voices exchanged{told}{heard}",
        report.reference,
        report.reference_schemes,
        report.made_by,
        report.f32_bytes as f64 / 1e6,
        report.numerics.blocks,
    ));
    in_short(report, &mut d);
    targets(report, &mut d);
    motion::blocks(report, &mut d);
    motion::free(report, &mut d);
    motion::judged(report, &mut d);
    speed(report, &mut d);
    machines(report, &mut d);
    tensors(report, &mut d);
    d
}

fn in_short(report: &Report, d: &mut Document) {
    d.heading(2, "In short");
    let mut rows = Vec::new();
    for (i, c) in report.numerics.candidates.iter().enumerate() {
        let verdicts: Vec<_> = report.targets[i].iter().map(super::Target::verdict).collect();
        let count = |what| verdicts.iter().filter(|v| **v == what).count();
        for b in &c.blocks {
            let speed = report.speed.get(i + 1).and_then(|s| s.samplers.iter().find(|s| b.sampler.starts_with(&s.0)));
            rows.push(vec![
                c.name.clone(),
                b.sampler.clone(),
                format!("{:.3}", report.sizes[i]),
                number(b.mm.mean),
                number(b.mm.p99),
                number(b.degrees.mean),
                number(b.gaze.mean),
                speed.map_or_else(|| "-".into(), |s| format!("{:.2}", s.3)),
                format!("{} of {} met, {} not measured", count("met"), verdicts.len(), count("not measured")),
            ]);
        }
    }
    let head = [
        "bundle",
        maker(report),
        "size / f32",
        "joints, mean mm",
        "p99 mm",
        "rotations, mean deg",
        "gaze error",
        "time / reference",
        "targets",
    ];
    d.table(&head, rows);
}

fn targets(report: &Report, d: &mut Document) {
    d.heading(2, "Targets");
    let mut rows = Vec::new();
    for (c, targets) in report.numerics.candidates.iter().zip(&report.targets) {
        for t in targets {
            let measured = t.measured.map_or_else(|| "-".to_owned(), number);
            rows.push(vec![c.name.clone(), t.what.clone(), number(t.target), measured, t.verdict().to_owned()]);
        }
    }
    d.table(&["bundle", "figure", "at most", "measured", "verdict"], rows);
    d.text(
        "The worst of all rows counts. The change of FGD is that of the distance to recorded motion, either way, of the sampler where it is \
         largest; evaluations below tell its standard error. Where no evaluation was given, the free runs tell each candidate's distance from the reference's motion beside what another seed alone changes.",
    );
}

fn speed(report: &Report, d: &mut Document) {
    d.heading(2, "Speed and memory");
    let mb = |bytes: usize| format!("{:.2}", bytes as f64 / 1e6);
    let mut rows = Vec::new();
    for s in &report.speed {
        for (sampler, read, ms, ratio) in &s.samplers {
            let memory = [mb(s.file_bytes), mb(s.weight_bytes), mb(s.cache_bytes)];
            let mut row = vec![s.name.clone(), sampler.clone()];
            row.extend(memory);
            row.extend([mb(*read), number(*ms), format!("{ratio:.2}")]);
            rows.push(row);
        }
    }
    let head = [
        "bundle",
        maker(report),
        "file MB",
        "weights MB",
        "caches MB",
        "read a block, MB",
        "block p50, ms",
        "time / reference",
    ];
    d.table(&head, rows);
    d.text(
        "Blocks of all bundles were timed in turns in this run, one thread; on a machine with other work the ratios mean more than the \
         milliseconds. Weights are resident as packed for the CPU, caches are those of one session.",
    );
}

fn machines(report: &Report, d: &mut Document) {
    d.heading(2, "Other machines");
    let Some([other, here]) = &report.machines else {
        d.text(
            "Not compared in this run: make a file with --numerics-only there and give it with --other-machine here.",
        );
        return;
    };
    d.text(format!(
        "The same {} blocks on {} ({}) and on {} ({}). Integer sums are exact and float sums have a fixed order on every level, so the \
         bits of the latents, or of the poses where there are none, are to be the same.",
        other.blocks, other.arch, other.level, here.arch, here.level
    ));
    let mut rows = Vec::new();
    for (b, name, a) in pairs(other, here) {
        let same = if a.bits == b.bits { "same" } else { "different" };
        rows.push(vec![
            name.to_owned(),
            a.sampler.clone(),
            number(a.mm.mean),
            number(b.mm.mean),
            number((a.mm.mean - b.mm.mean).abs()),
            number(a.mm.p99),
            number(b.mm.p99),
            number((a.mm.p99 - b.mm.p99).abs()),
            same.to_owned(),
        ]);
    }
    let (a, b) = (format!("mm here ({})", here.arch), format!("there ({})", other.arch));
    d.table(&["bundle", maker(report), &a, &b, "difference", "p99 here", "there", "difference", "bits"], rows);
}

/// Blocks of the same candidate and sampler on both machines: there, its name, here.
fn pairs<'a>(there: &'a Numerics, here: &'a Numerics) -> impl Iterator<Item = (&'a Blocks, &'a str, &'a Blocks)> {
    here.candidates.iter().flat_map(move |c| {
        let other = there.candidates.iter().find(|o| o.name == c.name);
        let blocks = c.blocks.iter().filter_map(move |a| {
            let b = other?.blocks.iter().find(|b| b.sampler == a.sampler)?;
            Some((b, c.name.as_str(), a))
        });
        blocks.collect::<Vec<_>>()
    })
}

fn tensors(report: &Report, d: &mut Document) {
    d.heading(2, "Tensors and layers");
    d.text(
        "Weights against the reference's, and each layer's outputs on inputs that the reference run gave it (cosine, signal to noise).",
    );
    for c in &report.numerics.candidates {
        d.heading(3, &c.name);
        let outputs: Vec<_> = c.tensors.iter().filter(|t| t.output.is_some_and(|o| o.sqnr_db.is_some())).collect();
        let names: Vec<String> = outputs.iter().map(|t| t.name.clone()).collect();
        let values = outputs.iter().filter_map(|t| t.output?.sqnr_db).collect();
        if !names.is_empty() {
            d.picture(bars(&names, &[("outputs".to_owned(), values)], "dB"), "Signal to noise of layer outputs");
        }
        let rows = c.tensors.iter().map(|t| {
            vec![
                t.name.clone(),
                t.scheme.to_string(),
                t.activation_bits.map_or_else(|| "float".to_owned(), |bits| format!("int{bits}")),
                format!("{} x {}", t.shape[0], t.shape[1]),
                t.bytes.to_string(),
                db(t.sqnr_db),
                number(t.max_error),
                t.output.map_or_else(|| "-".into(), |o| format!("{:.6}", o.cosine)),
                t.output.map_or_else(|| "-".into(), |o| db(o.sqnr_db)),
            ]
        });
        let head =
            ["layer", "weights", "inputs", "shape", "bytes", "weights dB", "max error", "output cosine", "output dB"];
        d.table(&head, rows.collect());
    }
}

fn four(s: &Spread) -> [String; 4] {
    [s.mean, s.p50, s.p99, s.max].map(number)
}

fn db(v: Option<f64>) -> String {
    v.map_or_else(|| "equal".to_owned(), |v| format!("{v:.1}"))
}
