//! Mutations per CPU second of one thread, and rays per mutation: `cargo bench --bench chains`.
//!
//! Each kind of mutation alone, on the box of this repository at 256×256 with paths of up to ten edges. All light but that
//! seen directly is found by chains; the path tracing of the latter is measured by itself and taken off. A path of some
//! edges takes as many rays: what is proposed may have fewer, where it finds no light.

use pathblend::integrators::{Acceptance, Budget, Method, Settings, render};
use pathblend::load;
use pathblend::markov::{LargeSteps, Mutations};
use pathblend::scene::Scene;
use std::path::Path;
use std::time::Duration;

fn measure(scene: &Scene, name: &str, method: Method, mutations: Mutations) {
    let settings = Settings {
        max_depth: 10,
        features: false,
        budget: Budget::Cpu(Duration::from_secs(3)),
        mutations: Mutations { separate_direct: false, ..mutations },
        ..Settings::default()
    };
    let outcome = render(scene, method, &settings, |_| {});
    let seen = Settings { max_depth: 1, budget: Budget::Passes(outcome.passes), ..settings };
    let seen = render(scene, Method::Path, &seen, |_| {});
    let mutations = (outcome.counts.samples - seen.counts.samples) as f64;
    let time = outcome.cpu.saturating_sub(seen.cpu).as_secs_f64();
    let rays = (outcome.counts.rays - seen.counts.rays) as f64;
    let tried = || outcome.counts.acceptance.values().flatten().filter(|one| one.length > 0);
    let sum = |value: fn(&Acceptance) -> u64| tried().map(value).sum::<u64>() as f64;
    let edges = sum(|one| one.proposed * one.length as u64) / sum(|one| one.proposed);
    let (rate, each) = (mutations / time / 1e6, rays / mutations);
    println!("| {name} | {} | {rate:.3} M | {each:.2} | {edges:.2} |", method.name());
}

fn main() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/box/scene.xml");
    let options = load::Options { size: Some([256, 256]), ..load::Options::default() };
    let Ok(loaded) = load::read(&file, &options) else { return eprintln!("the box does not load") };
    let Ok(pool) = rayon::ThreadPoolBuilder::new().num_threads(1).build() else { return eprintln!("no thread") };
    let usual = Mutations::default();
    let never = Mutations { large_step: 0.0, jump: 0.0, ..usual };
    let large = Mutations { large_step: 1.0, ..never };
    let cases = [
        ("usual", Method::Rjmlt, usual),
        ("usual", Method::Mmlt, usual),
        ("usual", Method::Pssmlt, usual),
        ("small steps", Method::Rjmlt, never),
        ("large steps", Method::Rjmlt, large),
        ("jumps", Method::Rjmlt, Mutations { jump: 1.0, ..never }),
        ("controlled steps", Method::Rjmlt, Mutations { controlled: true, ..never }),
        ("tries", Method::Rjmlt, Mutations { large_steps: LargeSteps::TriesFrom(0), ..large }),
    ];
    println!("| mutations | method | per CPU second | rays for each | edges |\n|---|---|---|---|---|");
    for (name, method, mutations) in cases {
        pool.install(|| measure(&loaded.scene, name, method, mutations));
    }
}
