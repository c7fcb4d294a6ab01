//! What the options of reweighting do to the weights.

use super::*;
use crate::config::Preset;
use crate::critic::Task;
use crate::data::Sorted;
use crate::model::Model;
use crate::normaliser::Normaliser;
use crate::reweight::WeightSummary;
use crate::testing::{dataset, fill, recording};

/// The weights and `w_cf` after a refresh by a random critic, and the share that it raised.
fn refreshed(options: &[&str]) -> (Weights, Vec<f32>, f64) {
    let data = recording(4, 30, |_| 0.0, |row| if row < 60 { 0.0 } else { 1.0 });
    let mut config = Preset::Paper.config("own", 1.0);
    let small = [
        "trunk=8",
        "head=8",
        "batch=16",
        "sigma=1",
        "counterfactual_reference=realised",
        "counterfactual_tolerance=0.3",
    ];
    small.iter().chain(options).for_each(|option| config.set(option).unwrap());
    let model = Model::new(&config, 2, 1);
    let critic = fill(model.critic.size(), 3);
    let normaliser = Normaliser::new(&data, false);
    // Half of the transitions without a cost to come lie above the bound, half below.
    let mut batch: Batch<f64> = Source::new(&config, &data, &normaliser).room(60);
    (0..60).for_each(|row| Source::new(&config, &data, &normaliser).fill(&mut batch, row, row, 0.0));
    let mut tape = model.critic.tape(60);
    let recorded = (&batch.state, &batch.kappa[..], &batch.action);
    model.critic.forward(&critic, &[Task::ShortCost], recorded, &mut tape, false);
    config.counterfactual_tolerance = Sorted::new(tape.pessimistic(Task::ShortCost)).quantile(0.5);

    let mut reweighting = Reweighting::new(&config, &data);
    let mut counterfactual = vec![1.0; data.len()];
    let source = Source::new(&config, &data, &normaliser);
    let critic = (&model.critic, &critic[..]);
    let active = reweighting.refresh(&source, critic, (Noise::new(1), 0), &mut counterfactual);
    (reweighting.weights, counterfactual, active)
}

#[test]
fn each_scale_can_be_off_alone() {
    let moves = |weights: &[f32]| weights.iter().any(|weight| *weight != weights[0]);
    for (reweight, trajectory, transition) in
        [("both", true, true), ("trajectory", true, false), ("counterfactual", false, true)]
    {
        let (weights, counterfactual, active) = refreshed(&[&format!("reweight={reweight}")]);
        assert_eq!(moves(&weights.trajectory), trajectory, "{reweight}");
        assert_eq!((moves(&counterfactual), active > 0.0), (transition, transition), "{reweight}");
        assert!(moves(&weights.combined), "{reweight}");
    }
    let mut config = Preset::Paper.config("own", 1.0);
    config.reweight = Scales::Off;
    let reweighting = Reweighting::new(&config, &dataset());
    assert!(!(0..100_000).any(|step| reweighting.is_due(step)));
    assert_eq!(reweighting.refreshes(u64::MAX), 0);
}

#[test]
fn activity_is_the_share_with_a_margin_at_this_refresh() {
    let (weights, counterfactual, active) = refreshed(&[]);
    // All weights were 1 before.
    let raised = counterfactual.iter().filter(|weight| **weight > 1.0).count();
    assert_eq!(active, raised as f64 / 120.0);
    assert_eq!(WeightSummary::new(&weights).active, active);
}

#[test]
fn a_refresh_may_look_at_a_share_of_the_data() {
    let [(_, _, all), (_, part, active)] = [refreshed(&[]), refreshed(&["refresh_share=0.25"])];
    let raised = part.iter().filter(|weight| **weight > 1.0).count();
    assert!(raised > 0 && raised <= 30 && active < all);
}

/// Four shares of a worker's size, of which three have no row to look at.
#[test]
fn a_refresh_of_one_row_leaves_all_others_as_they_are() {
    let data = recording(4, 120, |_| 0.0, |_| 0.0);
    let mut config = Preset::Paper.config("own", 1.0);
    ["trunk=8", "head=8", "refresh_share=1e-9"].iter().for_each(|option| config.set(option).unwrap());
    let model = Model::new(&config, 2, 1);
    let normaliser = Normaliser::new(&data, false);
    let source = Source::new(&config, &data, &normaliser);
    let critic: Vec<f32> = fill(model.critic.size(), 3).into_iter().map(|value| value as f32).collect();
    let mut counterfactual = vec![1.0; data.len()];
    let mut reweighting = Reweighting::new(&config, &data);
    reweighting.refresh(&source, (&model.critic, &critic), (Noise::new(1), 0), &mut counterfactual);
    assert!(counterfactual.iter().filter(|weight| **weight != 1.0).count() <= 1);
}

/// Eq. 9 divides by the mean margin of each mini-batch, or of all.
#[test]
fn margins_have_their_mean_over_a_mini_batch_or_the_data() {
    let [batch, data] = ["batch", "data"].map(|mean| refreshed(&[&format!("margin_mean={mean}"), "weight_max=100"]).1);
    assert_ne!(batch, data);
    let excess = data.iter().map(|weight| f64::from(weight - 1.0) / 0.3).sum::<f64>();
    assert!((excess / 120.0 - 1.0).abs() < 1e-2, "m / E[m] has mean 1 over the data");
}

/// The final weights lie between 1, where they start, and what Eq. 10 says of this refresh alone.
#[test]
fn the_moving_average_may_be_of_the_final_weights() {
    let [(alone, ..), (averaged, kept, _)] = [&["reweight_ema=1"][..], &["reweight_averaged=weight"]].map(refreshed);
    assert_eq!(averaged.combined, kept);
    for (averaged, alone) in averaged.combined.iter().zip(&alone.combined) {
        assert!((averaged - (0.7 + 0.3 * alone)).abs() < 1e-6, "{averaged}, {alone}");
    }
    assert!(averaged.combined.iter().any(|weight| *weight != 1.0));
}

/// The larger twin raises what its mean does, and more.
#[test]
fn a_mean_of_twins_is_less_cautious_than_the_worse_one() {
    let [(.., worse), (.., mean)] = [&[][..], &["counterfactual_twins=mean"]].map(refreshed);
    assert_ne!(worse, mean);
}

#[test]
fn a_feasible_mass_replaces_beta() {
    let mut config = Preset::Paper.config("own", 1.0);
    assert_eq!(beta(&config, &dataset()), 0.5);
    // One of the two trajectories is feasible, so a mass of 0.8 is 1 + beta = 4.
    config.feasible_mass = 0.8;
    assert!((beta(&config, &dataset()) - 3.0).abs() < 1e-12);
}

#[test]
fn sigma_counts_in_deviations_where_asked() {
    let mut config = Preset::Paper.config("own", 1.0);
    assert_eq!(sigma(&config, &dataset()), [0.1]);
    config.sigma_per_entry = true;
    // The actions are 0.1 .. 0.6.
    let expected = 0.1 * 0.1 * (35.0f64 / 12.0).sqrt();
    assert!((sigma(&config, &dataset())[0] - expected).abs() < 1e-8);
}
