//! Tables of an experiment, as Markdown.

use super::{Experiment, Run};
use crate::path_space::Kind;
use std::collections::BTreeMap;
use std::fmt;

/// Mean and standard deviation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spread {
    pub mean: f64,
    pub deviation: f64,
}

impl Spread {
    pub(super) fn of(values: &[f64]) -> Self {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        Self { mean, deviation: (squares / (n - 1.0)).sqrt() }
    }
}

impl Experiment {
    /// Names of the scenes, in the recipe's order.
    pub(super) fn scenes(&self) -> Vec<String> {
        self.recipe.scenes.iter().map(|scene| scene.name()).collect()
    }

    /// The mean squared errors of a variant on a scene after a time.
    pub(super) fn errors(&self, scene: &str, variant: &str, time: f64) -> Spread {
        self.spread(scene, variant, time, |run| run.mse)
    }

    /// An error of a variant on a scene after a time.
    fn spread(&self, scene: &str, variant: &str, time: f64, error: fn(&Run) -> f64) -> Spread {
        let is_of = |run: &&Run| run.scene == scene && run.variant == variant && run.time == time;
        Spread::of(&self.runs.iter().filter(is_of).map(error).collect::<Vec<_>>())
    }

    /// Accepted over proposed of a kind of mutation, summed over runs, by length.
    pub(super) fn acceptance(&self, scene: &str, variant: &str, kind: &str) -> BTreeMap<usize, [u64; 2]> {
        let mut sums = BTreeMap::new();
        for run in self.runs.iter().filter(|run| run.scene == scene && run.variant == variant) {
            for one in run.acceptance.get(kind).into_iter().flatten() {
                let [accepted, proposed] = sums.entry(one.length).or_insert([0; 2]);
                *accepted += one.accepted;
                *proposed += one.proposed;
            }
        }
        sums
    }

    fn write_errors(&self, f: &mut fmt::Formatter<'_>, error: fn(&Run) -> f64) -> fmt::Result {
        write!(f, "| scene | seconds |")?;
        self.recipe.variants.iter().try_for_each(|variant| write!(f, " {} |", variant.name))?;
        writeln!(f, "\n|---|---|{}", "---|".repeat(self.recipe.variants.len()))?;
        for scene in self.scenes() {
            for time in &self.recipe.times {
                write!(f, "| {scene} | {time} |")?;
                for variant in &self.recipe.variants {
                    let Spread { mean, deviation } = self.spread(&scene, &variant.name, *time, error);
                    write!(f, " {mean:.3e} ± {deviation:.1e} |")?;
                }
                writeln!(f)?;
            }
        }
        Ok(())
    }

    fn write_acceptance(&self, f: &mut fmt::Formatter<'_>, kind: &str) -> fmt::Result {
        let all: Vec<_> = self
            .scenes()
            .into_iter()
            .flat_map(|scene| self.recipe.variants.iter().map(move |variant| (scene.clone(), variant)))
            .map(|(scene, variant)| (self.acceptance(&scene, &variant.name, kind), scene, variant))
            .filter(|(sums, ..)| sums.values().any(|[_, proposed]| *proposed > 0))
            .collect();
        let lengths: std::collections::BTreeSet<usize> =
            all.iter().flat_map(|(sums, ..)| sums.keys().copied()).collect();
        if lengths.is_empty() {
            return Ok(());
        }
        write!(f, "\nAccepted, {} (by path length; 0 for all):\n\n| scene | variant |", kind.replace('_', " "))?;
        lengths.iter().try_for_each(|length| write!(f, " {length} |"))?;
        writeln!(f, "\n|---|---|{}", "---|".repeat(lengths.len()))?;
        for (sums, scene, variant) in &all {
            write!(f, "| {scene} | {} |", variant.name)?;
            for length in &lengths {
                match sums.get(length) {
                    Some([accepted, proposed]) if *proposed > 0 => {
                        write!(f, " {:.4} |", *accepted as f64 / *proposed as f64)?;
                    }
                    _ => write!(f, " – |")?,
                }
            }
            writeln!(f)?;
        }
        Ok(())
    }

    fn write_speed(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "\n| scene | variant | samples per s | rays per s | failed inversions |\n|---|---|---|---|---|")?;
        for scene in self.scenes() {
            for variant in &self.recipe.variants {
                let runs = || self.runs.iter().filter(|run| run.scene == scene && run.variant == variant.name);
                let time: f64 = runs().map(|run| run.cpu_s).sum();
                let sum = |value: fn(&Run) -> u64| runs().map(value).sum::<u64>() as f64 / time;
                let failed: u64 = runs().flat_map(|run| &run.chains).map(|chains| chains.failed_inversions).sum();
                let (samples, rays) = (sum(|run| run.samples), sum(|run| run.rays));
                writeln!(f, "| {scene} | {} | {samples:.3e} | {rays:.3e} | {failed} |", variant.name)?;
            }
        }
        Ok(())
    }
}

impl fmt::Display for Experiment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "Mean squared error, mean ± standard deviation of {} runs:\n", self.recipe.seeds)?;
        self.write_errors(f, |run| run.mse)?;
        writeln!(f, "\nThe same of the relative squared error:\n")?;
        self.write_errors(f, |run| run.relmse)?;
        let kinds = ["large_step", "small_step", "technique_change"].into_iter();
        kinds.chain(Kind::ALL.map(Kind::name)).try_for_each(|kind| self.write_acceptance(f, kind))?;
        self.write_speed(f)
    }
}
