//! The numbers of the recording that ships with the project.

use armor_core::units::CostLimit;
use armor_train::data::{Dataset, StateMoments, Stats, Warning, check, feasible_mass};

use crate::{fixture, shipped_file};

fn dataset() -> Dataset {
    Dataset::read(&shipped_file()).unwrap()
}

fn stats(limit: f32) -> Stats {
    Stats::new(&dataset(), CostLimit::new(limit).unwrap(), 0.5)
}

#[track_caller]
fn close(actual: f64, expected: f64) {
    assert!((actual - expected).abs() <= 1e-9 * expected.abs().max(1.0), "{actual} is not {expected}");
}

/// Printed by `shipped.py`: h5py 3.16.0, numpy 1.26.4.
#[test]
fn statistics_are_those_of_an_independent_program() {
    let stats = stats(5.0);
    assert_eq!((stats.transitions, stats.trajectories), (94_000, 940));
    assert_eq!((stats.horizon_min, stats.horizon_max), (100, 100));
    close(stats.p_nz, 0.3630531914893617);
    close(stats.p_feas, 0.12978723404255318);
    close(stats.reward_return_p5, 115.61168153528125);
    close(stats.reward_return_p50, 388.54309049108997);
    close(stats.reward_return_p95, 714.2098660847171);
    close(stats.reward_return_max, 1151.4534805435687);
    close(stats.cost_return_p25, 13.0);
    close(stats.cost_return_p50, 31.0);
    close(stats.cost_return_p75, 61.0);
    close(stats.cost_return_max, 80.0);
    close(stats.best_feasible_return.unwrap(), 436.36158350110054);
    close(stats.feasible_mass, feasible_mass(stats.p_feas, 0.5));
}

#[test]
fn states_have_the_moments_of_an_independent_program() {
    let moments = StateMoments::new(&dataset());
    let mean = [0.2834616788391584, 0.11061679377088367, 0.4231364016120038, 0.20475664520908538];
    let std = [0.2642040923958522, 0.2785422716017142, 0.29346888049982234, 0.4520606516785804];
    for entry in 0..4 {
        assert_eq!(moments.mean[entry], mean[entry] as f32);
        assert_eq!(moments.std[entry], std[entry] as f32);
    }
    // The last entry is rounding noise around 0, of 5e-14.
    assert_eq!((moments.std[6], moments.constant), (1.0, vec![6]));
}

#[test]
fn kappa_falls_by_the_cost_exactly() {
    let dataset = dataset();
    let mut sum = 0.0;
    for row in 0..dataset.len() {
        assert_eq!(dataset.kappa_next(row), dataset.kappa(row) - dataset.cost(row), "row {row}");
        if dataset.done(row) {
            assert_eq!(dataset.kappa_next(row), 0.0);
        } else {
            assert_eq!(dataset.kappa_next(row), dataset.kappa(row + 1));
        }
        sum += f64::from(dataset.kappa(row));
    }
    assert_eq!(sum, 2_358_218.0); // shipped.py
    assert_eq!(dataset.max_kappa(), 80.0);
}

#[test]
fn the_validator_finds_it_sound() {
    let report = check(&shipped_file());
    assert!(report.is_sound(), "{report}");
    assert_eq!(report.warnings, [Warning::ConstantState { entries: vec![6] }]);
}

#[test]
fn a_limit_that_nothing_meets_has_no_best_feasible_return() {
    let file = fixture("small.hdf5"); // cost returns 2 and 1
    let dataset = Dataset::read(&file).unwrap();
    let at = |limit| Stats::new(&dataset, CostLimit::new(limit).unwrap(), 0.5);
    assert_eq!((at(0.5).p_feas, at(0.5).feasible_mass, at(0.5).best_feasible_return), (0.0, 0.0, None));
    assert_eq!((at(1.0).p_feas, at(1.0).best_feasible_return), (0.5, Some(7.5)));
    assert_eq!((at(2.0).p_feas, at(2.0).feasible_mass), (1.0, 1.0));
    assert_eq!((at(2.0).horizon_min, at(2.0).horizon_max), (4, 5));
}

/// Eq. 7's mass at beta 0.5 for the feasible shares of the paper's Table 1.
#[test]
fn feasible_mass_at_the_shares_of_table_1() {
    for (task, p, mass) in [
        ("Ball-Run", 0.0447, 0.066),
        ("Ant-Run", 0.0804, 0.116),
        ("CarCircle1", 0.0739, 0.107),
        ("PointGoal1", 0.4525, 0.554),
    ] {
        assert!((feasible_mass(p, 0.5) - mass).abs() < 5e-4, "{task}");
        assert_eq!(feasible_mass(p, 0.0), p);
    }
}

#[test]
fn the_table_fits_a_terminal() {
    let table = stats(5.0).to_string();
    assert!(table.lines().all(|line| line.len() <= 80 && line.trim_end() == line), "{table}");
    for number in ["94000", "940", "0.363", "0.130", "0.183", "436.4", "1151.5"] {
        assert!(table.split_whitespace().any(|word| word == number), "{number} in {table}");
    }
}

#[test]
fn statistics_are_plain_json() {
    let json = serde_json::to_value(stats(5.0)).unwrap();
    assert_eq!(json["transitions"], 94_000);
    assert_eq!(json["cost_limit"], 5.0);
    assert_eq!(json["cost_return_max"], 80.0);
    assert!(json.as_object().unwrap().values().all(|value| value.is_number()));
}
