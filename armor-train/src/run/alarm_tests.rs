use super::*;
use crate::config::Preset;
use crate::run::COLUMNS;
use crate::testing::recording;

/// Alarms of a run on data whose largest discounted sums are 2 (reward, scaled) and 3 (cost).
fn alarms() -> Alarms {
    let mut config = Preset::Paper.config("test", 4.0);
    (config.reward_discount, config.long_cost_discount) = (0.0, 1.0);
    let data = recording(2, 3, |row| if row == 1 { -20.0 } else { 1.0 }, |_| 1.0);
    Alarms::new(&config, &Provenance::new(&config, &data))
}

/// A sound row, but for the named values.
fn row(changes: &[(&str, f64)]) -> Vec<f64> {
    let mut row: Vec<f64> = COLUMNS.iter().map(|_| 0.5).collect();
    for (name, value) in changes {
        row[COLUMNS.iter().position(|column| column.name == *name).unwrap()] = *value;
    }
    row
}

#[test]
fn a_sound_run_raises_none() {
    let mut alarms = alarms();
    for step in 0..300 {
        assert_eq!(alarms.look(&row(&[("step", 1000.0 * f64::from(step))])), []);
    }
    assert_eq!(alarms.text(), "");
}

#[test]
fn a_critic_beyond_three_times_the_data_is_raised_once() {
    for (cause, column, largest) in [
        (Cause::RewardCritic, "q_reward_max", 2.0),
        (Cause::RewardCritic, "q_reward_min", -2.0),
        (Cause::CostCritic, "q_long_cost_max", 3.0),
        (Cause::CostCritic, "q_long_cost_min", -3.0),
    ] {
        let mut alarms = alarms();
        assert_eq!(alarms.look(&row(&[(column, 2.99 * largest)])), []);
        let found = alarms.look(&row(&[("step", 700.0), (column, 3.01 * largest)])).to_vec();
        assert_eq!(found.iter().map(|alarm| (alarm.step, alarm.cause)).collect::<Vec<_>>(), [(700, cause)]);
        assert_eq!(alarms.look(&row(&[(column, 9.0 * largest)])), []);
    }
}

#[test]
fn an_alarm_says_what_when_how_much_and_what_to_try() {
    let mut alarms = alarms();
    let found = alarms.look(&row(&[("step", 700.0), ("q_reward_max", 50.0)]))[0].to_string();
    let expected =
        "step 700: the reward critic explodes: Q_r reaches 50.0, 25.0 times the largest of the data, 2.0; values of ";
    assert!(found.starts_with(expected), "{found}");
    assert_eq!(alarms.text(), found + "\n");
}

#[test]
fn lambda_must_stay_at_its_cap_for_five_rows() {
    let mut alarms = alarms();
    let (at_cap, below) = (row(&[("lambda_kappa_0", 148.4), ("lambda_kappa_max", 148.0)]), row(&[]));
    for row in [&at_cap, &at_cap, &at_cap, &at_cap, &below, &at_cap, &at_cap, &at_cap, &at_cap] {
        assert_eq!(alarms.look(row), []);
    }
    let found = alarms.look(&at_cap);
    assert_eq!(found[0].cause, Cause::LambdaCap);
    assert_eq!(found[0].finding, "148.4 at kappa 0 and 3");
}

#[test]
fn weights_are_called_dead_only_after_two_refreshes() {
    let dead = |step: f64| row(&[("step", step), ("counterfactual_active", 0.009)]);
    let mut alarms = alarms();
    assert_eq!(alarms.look(&dead(25_000.0)), []);
    assert_eq!(alarms.look(&dead(25_100.0))[0].cause, Cause::DeadWeights);
}

#[test]
fn weights_that_are_off_are_not_dead() {
    for reweight in ["off", "trajectory"] {
        let mut config = Preset::Paper.config("test", 4.0);
        config.set(&format!("reweight={reweight}")).unwrap();
        let data = recording(2, 3, |_| 1.0, |_| 1.0);
        let mut alarms = Alarms::new(&config, &Provenance::new(&config, &data));
        assert_eq!(alarms.look(&row(&[("step", 1e5), ("counterfactual_active", 0.0)])), [], "{reweight}");
    }
}

#[test]
fn data_without_cost_leaves_the_cost_critic_its_noise() {
    let config = Preset::Paper.config("test", 4.0);
    let data = recording(1, 3, |_| 0.0, |_| 0.0);
    let mut alarms = Alarms::new(&config, &Provenance::new(&config, &data));
    let noise = [("q_long_cost_max", 2.9), ("q_long_cost_min", -2.9), ("q_reward_min", -0.29), ("q_reward_max", 0.29)];
    assert_eq!(alarms.look(&row(&noise)), []);
}

#[test]
fn every_option_that_a_remedy_names_exists() {
    let options = Preset::Paper.config("test", 4.0).options();
    for cause in Cause::ALL {
        let names: Vec<&str> = cause.remedy().split('`').skip(1).step_by(2).collect();
        assert!(!names.is_empty());
        for name in names {
            assert!(options.contains_key(name), "{name}");
        }
    }
}
