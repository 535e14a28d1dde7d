//! Sections about blocks and motion.

use super::super::chart::{bars, lines, number};
use super::super::document::Document;
use super::super::{Blocks, Judged, Measures, Report};
use super::{db, four, has_latents, maker};

pub(super) fn blocks(report: &Report, d: &mut Document) {
    d.heading(2, "Teacher-forced blocks");
    let mut rows = Vec::new();
    for c in &report.numerics.candidates {
        for b in &c.blocks {
            let mut row = vec![c.name.clone(), b.sampler.clone(), b.frames.to_string()];
            row.extend(four(&b.mm));
            row.extend(four(&b.degrees));
            row.extend([number(b.gaze.mean), number(b.gaze.p99), db(b.latent_sqnr_db)]);
            row.extend(b.round_trip_mm.iter().flat_map(|mm| [number(mm.mean), number(mm.p99)]));
            rows.push(row);
        }
    }
    let latents = has_latents(report);
    let mut head = vec!["bundle", maker(report), "frames"];
    head.extend(["mm mean", "p50", "p99", "max", "deg mean", "p50", "p99", "max", "gaze mean", "p99"]);
    head.extend(if latents { &["latents dB", "VAE mm mean", "p99"][..] } else { &["poses dB"] });
    d.table(&head, rows);
    let vae = " VAE: the reference's motion through encoder and decoder, against the reference's own, which is what re-anchoring sees.";
    d.text(format!(
        "Joints: distance and angle to the reference's, over all joints and frames.{}",
        if latents { vae } else { "" }
    ));
    let first: Vec<(&String, &Blocks)> =
        report.numerics.candidates.iter().filter_map(|c| Some((&c.name, c.blocks.first()?))).collect();
    let Some((_, some)) = first.first() else { return };
    let names: Vec<String> = some.joints.iter().map(|j| j.joint.clone()).collect();
    let series: Vec<_> =
        first.iter().map(|(n, b)| ((*n).clone(), b.joints.iter().map(|j| j.mm.mean).collect())).collect();
    d.picture(bars(&names, &series, "mean mm"), format!("Mean position error by joint, {}", some.sampler));
    for (name, b) in first {
        d.heading(3, format!("{name} by joint, {}", b.sampler));
        let rows = b.joints.iter().map(|j| {
            let mut row = vec![j.joint.clone()];
            row.extend(four(&j.mm));
            row.extend(four(&j.degrees));
            row
        });
        d.table(&["joint", "mm mean", "p50", "p99", "max", "deg mean", "p50", "p99", "max"], rows.collect());
    }
}

pub(super) fn free(report: &Report, d: &mut Document) {
    let f = &report.free;
    d.heading(2, "Free-running sessions");
    let latents = has_latents(report);
    let (with, equal) =
        if latents { (", with the default sampler and re-anchoring", " from equal noise") } else { ("", "") };
    let seed = if latents { "tells how much chance alone changes" } else { "has nothing to change" };
    d.text(format!(
        "{:.1} minutes of the sample conversation, repeated{with}. Sessions{equal} part because each block builds on the one before; \
         their distributions have to agree. FGD is the Frechet distance of poses (m²) and of accelerations ((m/s²)²) from the \
         reference's run. The row with another seed {seed}.",
        f.minutes
    ));
    let all: Vec<&Measures> = [&f.reference, &f.other_seed].into_iter().chain(&f.candidates).collect();
    let opt = |v: Option<f64>| v.map_or_else(|| "-".to_owned(), number);
    let rows = all.iter().map(|m| {
        let s = &m.summary;
        vec![
            m.name.clone(),
            opt(m.fgd),
            opt(m.fgd_acceleration),
            opt(s.head_angle),
            opt(s.wrist_speed),
            opt(s.speaking.and_then(|s| s.wrist_speed)),
            opt(s.non_speaking.and_then(|s| s.wrist_speed)),
            opt(s.foot_slide),
            opt(s.support_foot_speed),
            opt(s.seam),
            opt(s.max_fit_error),
            number(m.posture_mm.mean),
            m.anchorings.to_string(),
        ]
    });
    let head = [
        "run",
        "FGD",
        "FGD acc",
        "gaze",
        "wrist m/s",
        "speaking",
        "not",
        "foot slide",
        "support m/s",
        "seam",
        "max fit m",
        "posture apart, mm",
        "re-anchored",
    ];
    d.table(&head, rows.collect());
    let series: Vec<_> = all[1..].iter().map(|m| (m.name.clone(), m.divergence_mm.clone())).collect();
    d.picture(
        lines(&series, f.minutes, "minutes", "mean mm apart"),
        "Distance of the joints from the reference's over time",
    );
}

pub(super) fn judged(report: &Report, d: &mut Document) {
    d.heading(2, "Evaluations on recorded conversations");
    let Some(judged) = &report.judged else {
        d.text("Not given in this run: `visavis eval --model FILE --clips DIR --motion-only --json FILE.json` for each bundle, then --eval here.");
        return;
    };
    fgd(report, judged, d);
    let rows = judged.metrics.iter().map(|(name, values)| {
        let value = |v: &Option<f64>| v.map_or_else(|| "-".to_owned(), number);
        std::iter::once(name.clone()).chain(values.iter().map(value)).collect()
    });
    let files = judged.files.iter().map(String::as_str);
    d.table(&std::iter::once("metric").chain(files).collect::<Vec<_>>(), rows.collect());
}

/// Change of the Frechet distance to the corpus, beside what another seed changes.
fn fgd(report: &Report, judged: &Judged, d: &mut Document) {
    d.heading(3, "Change of FGD");
    let names = report.numerics.candidates.iter().map(|c| c.name.as_str());
    let rows = names.zip(&judged.fgd).chain(judged.chance.iter().map(|c| ("reference, another seed", c)));
    let rows = rows.flat_map(|(name, changes)| {
        changes.iter().map(move |c| {
            let percent = |v: f64| format!("{:+.1} %", 100.0 * v);
            let error = c.error.map_or_else(|| "-".to_owned(), |e| format!("{:.1} %", 100.0 * e));
            vec![name.to_owned(), c.sampler.clone(), number(1e4 * c.reference), percent(c.change), error]
        })
    });
    d.table(&["bundle", "sampler", "reference's FGD, cm²", "change", "standard error"], rows.collect());
    d.text(
        "FGD is the Frechet distance of free-running motion from the recorded motion of the same windows. Equal noise does not keep two \
         bundles together for long, so the change of a bundle holds that of chance as well: the standard error, from batches of 8 windows that both \
         bundles ran, tells how much, and the reference with another seed shows it. A change below about two standard errors is not told from none.",
    );
    d.heading(3, "All metrics");
}
