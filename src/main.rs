//! The command line.
use smalti::{cpu::CpuEvaluator, engine::*, evolve::*, model::*};
use std::sync::Arc;
fn main() {
    for name in ["star", "yin_yang", "hats", "parrots", "woman"] {
        let im = image::open(format!("/tmp/j/i256/{name}.png")).unwrap().to_rgb8();
        let (w, h) = im.dimensions();
        let t = Target::new(w, h, im.pixels().map(|p| p.0).collect()).unwrap();
        let s = Scene { target: Arc::new(t), masks: Arc::default(), background: [0; 3], fly_count: 2500 };
        let e = Evolution::new(PaperScheme::default(), 0, w, h, evolution::random_population(w, h, 2500, 0));
        let mut en = Engine::new(Box::new(CpuEvaluator::new(vec![s])), vec![e]);
        let t0 = std::time::Instant::now();
        en.run(&mut Undisturbed).unwrap();
        println!(
            "{name} {:?} {:?} {:?} mae {}",
            t0.elapsed(),
            en.evolutions()[0].best_sae(),
            en.evolutions()[0].outcome(),
            en.evolutions()[0].best_sae().unwrap() as f64 / 196608.0
        );
    }
}
