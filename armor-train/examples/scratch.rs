use armor_train::{config::Preset, data::Dataset, learner::Learner};
fn main() {
    let data = Dataset::read(std::path::Path::new("data/ball-run-bullet.hdf5")).unwrap();
    let mut config = Preset::Quick.config("ball-run", 5.0);
    for a in std::env::args().skip(1) { config.set(&a).unwrap(); }
    config.check().unwrap();
    let n = config.steps;
    let mut l = Learner::<f32>::new(config, &data);
    let t = std::time::Instant::now();
    for i in 0..n {
        let m = l.step();
        if i % (n / 10).max(1) == 0 || i + 1 == n {
            println!("{i} {:.1}s {:?}", t.elapsed().as_secs_f64(), m);
        }
    }
    let act = l.weights().counterfactual.iter().filter(|w| **w > 1.0001).count();
    println!("active {}", act as f64 / data.len() as f64);
}
