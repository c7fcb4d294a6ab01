//! `firmware-sim inspect`

use std::fmt::{self, Write};
use std::path::PathBuf;

use armor_core::image::{Layout, Manifest, PolicyImage, Precision, Quality, SectionKind, VERSION};
use armor_core::shape::Shape;
use serde::Serialize;

use super::output::{CommandResult, Output};
use super::sampler_name;
use crate::image_file::ImageFile;

/// Print what an image says of itself.
#[derive(Debug, clap::Args)]
pub(super) struct Inspect {
    /// The policy image.
    image: PathBuf,
}

#[derive(Serialize)]
struct Report {
    task: String,
    release: u32,
    format_version: u16,
    image_bytes: usize,
    precision: Precision,
    layout: Layout,
    #[serde(flatten)]
    shape: Shape,
    rungs: Vec<Rung>,
    kappa_scale: f32,
    kappa_trained_max: f32,
    provenance: Provenance,
    agreement_max_abs: f32,
    golden_rows: usize,
    quality: Vec<Flown>,
    sections: Vec<Section>,
}

#[derive(Serialize)]
struct Rung {
    sampler: &'static str,
    steps: u16,
    macs_per_action: u64,
}

#[derive(Serialize)]
struct Provenance {
    version: String,
    preset: String,
    seed: u64,
    steps: u64,
    data_sha256: String,
    config_sha256: String,
}

#[derive(Serialize)]
struct Flown {
    rung: u8,
    candidates: u8,
    cost_limit: f32,
    episodes: u16,
    reward_normalized: f32,
    cost_normalized: f32,
}

#[derive(Serialize)]
struct Section {
    kind: SectionKind,
    offset: u32,
    bytes: u32,
}

impl Inspect {
    pub(super) fn run(self, output: Output) -> CommandResult {
        let file = ImageFile::read(&self.image)?;
        output.report(&Report::new(&file.image()?))
    }
}

impl Report {
    fn new(image: &PolicyImage<'_>) -> Self {
        let Manifest { task, release, shape, precision, layout, kappa, provenance, agreement_max_abs, .. } =
            *image.manifest();
        let manifest = image.manifest();
        let rung = |rung: &armor_core::image::Rung| Rung {
            sampler: sampler_name(rung.sampler),
            steps: rung.steps,
            macs_per_action: shape.macs_once() + u64::from(rung.steps) * shape.macs_per_step(),
        };
        let flown = |quality: &Quality| Flown {
            rung: quality.rung,
            candidates: quality.candidates,
            cost_limit: quality.limit.to_f32(),
            episodes: quality.episodes,
            reward_normalized: quality.reward_normalized,
            cost_normalized: quality.cost_normalized,
        };
        let section = |section: &armor_core::image::Section| Section {
            kind: section.kind,
            offset: section.offset,
            bytes: section.length,
        };
        Self {
            task: task.into(),
            release,
            format_version: VERSION,
            image_bytes: image.bytes().len(),
            precision,
            layout,
            shape,
            rungs: manifest.rungs.iter().map(rung).collect(),
            kappa_scale: kappa.scale,
            kappa_trained_max: kappa.trained_max.to_f32(),
            provenance: Provenance {
                version: provenance.version.into(),
                preset: provenance.preset.into(),
                seed: provenance.seed,
                steps: provenance.steps,
                data_sha256: hexadecimal(&provenance.data_sha256),
                config_sha256: hexadecimal(&provenance.config_sha256),
            },
            agreement_max_abs,
            golden_rows: image.sections().golden.rows().len(),
            quality: manifest.quality.iter().map(flown).collect(),
            sections: manifest.sections.iter().map(section).collect(),
        }
    }
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { shape, provenance, .. } = self;
        writeln!(f, "task          {}, release {}", self.task, self.release)?;
        writeln!(f, "image         {} bytes, format {}", self.image_bytes, self.format_version)?;
        write!(f, "network       {} state, {} action entries, {:?}", shape.state, shape.action, self.precision)?;
        writeln!(f, "{}", if self.layout == Layout::Paired { ", weights in pairs" } else { "" })?;
        let Shape { hidden, kappa_hidden, kappa_embedding, steps, .. } = *shape;
        writeln!(f, "              3 layers of {hidden}, kappa 1-{kappa_hidden}-{kappa_hidden}-{kappa_embedding}")?;
        writeln!(f, "              {steps} noise levels")?;
        writeln!(f, "budget        trained up to {}, scaled by {}", self.kappa_trained_max, self.kappa_scale)?;
        for (number, rung) in self.rungs.iter().enumerate() {
            writeln!(f, "rung {number}        {} {}, {} MAC/action", rung.sampler, rung.steps, rung.macs_per_action)?;
        }
        let Provenance { version, preset, seed, steps, .. } = provenance;
        writeln!(f, "trained by    armor-train {version}, preset {preset}, seed {seed}, {steps} steps")?;
        writeln!(f, "data          {}", provenance.data_sha256)?;
        writeln!(f, "config        {}", provenance.config_sha256)?;
        let other = if self.precision == Precision::F32 { "trainer" } else { "the image in F32" };
        writeln!(f, "agreement     {:.1e} between {other} and image", self.agreement_max_abs)?;
        writeln!(f, "golden trace  {} rows", self.golden_rows)?;
        for flown in &self.quality {
            let Flown { rung, candidates, cost_limit, episodes, reward_normalized, cost_normalized } = flown;
            write!(f, "flown         rung {rung} in {:?}, limit {cost_limit}, {episodes} episodes", self.precision)?;
            if *candidates > 1 {
                write!(f, ", best of {candidates}")?;
            }
            writeln!(f)?;
            writeln!(f, "              reward {reward_normalized:.3}, cost {cost_normalized:.3} (normalised)")?;
        }
        write!(f, "section             offset     bytes")?;
        for section in &self.sections {
            write!(f, "\n  {:<18}{:>6}{:>10}", format!("{:?}", section.kind), section.offset, section.bytes)?;
        }
        Ok(())
    }
}
