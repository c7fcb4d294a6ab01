//! scratch
use armor_core::image::PolicyImage;
use armor_core::units::CostLimit;
use armor_infer::Policy;
use armor_train::data::Dataset;
use armor_train::{
    config::Preset,
    export::export,
    learner::Learner,
    run::{Checkpoint, Window},
};
use firmware_sim::{
    host::HostController,
    plant::{BallRun, Plant},
    task::Task,
};
fn main() {
    let data = Dataset::read(std::path::Path::new("data/ball-run-bullet.hdf5")).unwrap();
    let mut config = Preset::Quick.config("ball-run", 5.0);
    for a in std::env::args().skip(1) {
        config.set(&a).unwrap();
    }
    config.check().unwrap();
    let n = config.steps;
    let mut l = Learner::<f32>::new(config.clone(), &data);
    let t = std::time::Instant::now();
    for i in 0..n {
        let m = l.step();
        if (i + 1) % 1000 == 0 {
            let act = l.weights().counterfactual.iter().filter(|w| **w > 1.0001).count() as f64 / data.len() as f64;
            print!(
                "{} {:.0}s bc {:.3} qr {:.2} ql {:.2} lam {:.3} pen {:.2} act {act:.4} | ",
                i + 1,
                t.elapsed().as_secs_f64(),
                m.actor.cloning,
                m.actor.reward,
                m.actor.long_cost,
                m.actor.lambda,
                m.actor.penalty
            );
            let cp = Checkpoint {
                config: config.clone(),
                data_sha256: [0; 32],
                state: l.state().clone(),
                window: Window::default(),
            };
            let e = export(&cp, &data).unwrap();
            let image = PolicyImage::new_checked(e.bytes.as_slice()).unwrap();
            let policy = Policy::load(&image).unwrap();
            let task = Task::named("ball-run").unwrap();
            let (mut r, mut c, mut cmax) = (0.0, 0.0, 0.0f64);
            for ep in 0..20u64 {
                let mut plant = BallRun::default();
                plant.reset(ep);
                let mut ctl = HostController::new(policy, CostLimit::new(5.0).unwrap(), 1000 + ep).unwrap();
                let mut inc = 0.0;
                let mut ec = 0.0;
                for _ in 0..100 {
                    let mut s = [0.0; 7];
                    plant.observe(&mut s);
                    let a = ctl.step(&s, inc);
                    let o = plant.step(&a.action.as_slice()[..2]);
                    r += o.reward / 20.0;
                    ec += o.cost;
                    inc = o.cost as f32;
                }
                c += ec / 20.0;
                cmax = cmax.max(ec);
            }
            println!(
                "R {:.3} C {:.2} max {:.0} agree {:.1e}",
                task.reward_normalized(r),
                c / 5.0,
                cmax,
                e.agreement.agreement_max_abs
            );
        }
    }
}
