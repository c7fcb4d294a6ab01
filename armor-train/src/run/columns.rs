//! The columns of `metrics.csv` and `speed.csv`: name, unit, meaning, and where the number comes from.

use super::metrics::Row;

/// A column of `metrics.csv`.
#[derive(Clone, Copy, Debug)]
pub struct Column {
    /// Its name in the first line.
    pub name: &'static str,
    /// Unit of its numbers.
    pub unit: &'static str,
    /// What it says, in a sentence without an end mark.
    pub meaning: &'static str,
    pub(super) value: fn(&Row) -> f64,
}

const fn column(name: &'static str, unit: &'static str, meaning: &'static str, value: fn(&Row) -> f64) -> Column {
    Column { name, unit, meaning, value }
}

const REWARD: &str = "scaled reward";
const COST: &str = "scaled cost";
const SHARE: &str = "share";
const GRADIENT: &str = "norm";
const LAMBDA: &str = "scaled reward per scaled cost";

/// The columns of `metrics.csv`, in order.
pub const COLUMNS: &[Column] = &[
    column("step", "steps", "training steps done", |r| r.step as f64),
    column(
        "critic_loss_reward",
        "scaled reward squared",
        "loss of the reward heads, summed over the twins (Eq. 4)",
        |r| r.critic_loss[0],
    ),
    column("critic_loss_long_cost", "scaled cost squared", "loss of the long-term cost heads (Eq. 4)", |r| {
        r.critic_loss[1]
    }),
    column("critic_loss_short_cost", "scaled cost squared", "loss of the short-term cost heads (Eq. 4)", |r| {
        r.critic_loss[2]
    }),
    column(
        "value_loss_reward",
        "scaled reward squared",
        "expectile loss of the state values of reward; 0 where targets bootstrap from the policy, as the next two",
        |r| r.value_loss[0],
    ),
    column("value_loss_long_cost", "scaled cost squared", "the same of long-term cost", |r| r.value_loss[1]),
    column("value_loss_short_cost", "scaled cost squared", "the same of short-term cost", |r| r.value_loss[2]),
    column(
        "conflicts_0",
        SHARE,
        "steps without a pair of trunk gradients in conflict; the paper has .50 (Table A1)",
        |r| r.conflicts[0],
    ),
    column("conflicts_1", SHARE, "steps with one pair in conflict; the paper has .12", |r| r.conflicts[1]),
    column("conflicts_2", SHARE, "steps with two pairs in conflict; the paper has .38", |r| r.conflicts[2]),
    column("conflicts_3", SHARE, "steps with three pairs in conflict; the paper has .0003", |r| r.conflicts[3]),
    column(
        "cloning_loss",
        "noise variance",
        "weighted behaviour cloning (Eq. 13); a net that predicts no noise at all has the number of action entries",
        |r| r.cloning,
    ),
    column(
        "q_reward_min",
        REWARD,
        "smallest Q_r over all batches of the row, at the policy's actions, or at the recorded ones where the critics train alone; 0 where no critic is asked, as all q columns",
        |r| r.q_reward[0],
    ),
    column("q_reward", REWARD, "mean Q_r", |r| r.q_reward[1]),
    column("q_reward_max", REWARD, "largest Q_r", |r| r.q_reward[2]),
    column("q_long_cost_min", COST, "smallest Q_cL at the same actions", |r| r.q_long_cost[0]),
    column("q_long_cost", COST, "mean Q_cL", |r| r.q_long_cost[1]),
    column("q_long_cost_max", COST, "largest Q_cL", |r| r.q_long_cost[2]),
    column("lambda", LAMBDA, "mean dual variable at the budgets of the batch", |r| r.lambda),
    column("penalty", REWARD, "mean lambda (Q_cL - kappa) (Eq. 15)", |r| r.penalty),
    column(
        "lambda_kappa_0",
        LAMBDA,
        "lambda where no budget is left; at the row's last step, as all lambda_kappa; 0 where no dual learns",
        |r| r.lambda_by_kappa[0],
    ),
    column("lambda_kappa_half", LAMBDA, "lambda at half the cost limit", |r| r.lambda_by_kappa[1]),
    column("lambda_kappa_limit", LAMBDA, "lambda at the cost limit d", |r| r.lambda_by_kappa[2]),
    column("lambda_kappa_max", LAMBDA, "lambda at the largest kappa of the data", |r| r.lambda_by_kappa[3]),
    column("gradient_trunk_reward", GRADIENT, "trunk gradient of the reward loss, before surgery (Eq. 5)", |r| {
        r.trunk_norms[0]
    }),
    column("gradient_trunk_long_cost", GRADIENT, "trunk gradient of the long-term cost loss, before surgery", |r| {
        r.trunk_norms[1]
    }),
    column("gradient_trunk_short_cost", GRADIENT, "trunk gradient of the short-term cost loss, before surgery", |r| {
        r.trunk_norms[2]
    }),
    column("gradient_critic", GRADIENT, "gradient of the whole critic, after surgery", |r| r.gradient_norms[0]),
    column("gradient_actor", GRADIENT, "gradient of the actor (Eq. 15)", |r| r.gradient_norms[1]),
    column("gradient_dual", GRADIENT, "gradient of the dual network (Eq. 16)", |r| r.gradient_norms[2]),
    column(
        "counterfactual_active",
        SHARE,
        "transitions with a margin above 0 (Eq. 8), which the last refresh of counterfactual weights raised",
        |r| r.weights.active,
    ),
    column(
        "weight_min",
        "weight",
        "smallest weight w of Eq. 10 over the data; all are 1 before the first refresh",
        |r| r.weights.quantiles[0],
    ),
    column("weight_p10", "weight", "10 % quantile of w", |r| r.weights.quantiles[1]),
    column("weight_p50", "weight", "median of w", |r| r.weights.quantiles[2]),
    column("weight_p90", "weight", "90 % quantile of w", |r| r.weights.quantiles[3]),
    column("weight_p95", "weight", "95 % quantile of w", |r| r.weights.quantiles[4]),
    column("weight_p99", "weight", "99 % quantile of w", |r| r.weights.quantiles[5]),
    column("weight_max", "weight", "largest w", |r| r.weights.quantiles[6]),
    column(
        "advantage_weight_mean",
        "weight",
        "mean advantage weight times w of a batch, before it is divided out; 0 while none are in use, as the next three",
        |r| r.batch_weights.mean,
    ),
    column(
        "advantage_weight_effective",
        SHARE,
        "effective sample size (sum w)^2 / sum w^2 of the weights of a batch, as a share of it",
        |r| r.batch_weights.effective,
    ),
    column("advantage_scale_reward", REWARD, "mean size of the advantage of reward over the data", |r| {
        r.advantage_scales[0]
    }),
    column("advantage_scale_cost", COST, "mean size of the advantage of long-term cost over the data", |r| {
        r.advantage_scales[1]
    }),
];

/// Columns of `speed.csv`: name, unit, meaning.
pub const SPEED_COLUMNS: [(&str, &str, &str); 2] = [
    ("step", "steps", "training steps done"),
    ("steps_per_second", "1/s", "training steps by the wall clock since the row before, or since the run went on"),
];

/// The value of a named column in a row of numbers in the order of [`COLUMNS`]; NaN if there is none.
pub(super) fn value(row: &[f64], name: &str) -> f64 {
    let place = COLUMNS.iter().position(|column| column.name == name);
    place.and_then(|place| row.get(place)).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use std::fmt::Write;

    use super::*;
    use crate::run::Cause;

    /// `docs/metrics.md`.
    fn document() -> String {
        let mut text = String::from(
            "# What a run measures\n\n\
             `armor-train fit` writes one row every 100 steps, and `armor-train report DIR -o FILE.html` draws them. \
             This page is generated; `armor-train/src/run/columns.rs` is its source.\n\n\
             Scaled reward and cost are the recorded ones times `reward_scale` and `cost_scale`. \
             A number is the mean over the steps of its row that trained its network, 0 if none did, unless its meaning says otherwise.\n\n\
             ## metrics.csv\n\n\
             A resumed run writes the same bits as one never stopped.\n\n\
             | column | unit | meaning |\n|---|---|---|\n",
        );
        for Column { name, unit, meaning, .. } in COLUMNS {
            let _ = writeln!(text, "| `{name}` | {unit} | {meaning} |");
        }
        text.push_str(
            "\n## speed.csv\n\n\
             What depends on the machine and the hour is kept apart.\n\n\
             | column | unit | meaning |\n|---|---|---|\n",
        );
        for (name, unit, meaning) in SPEED_COLUMNS {
            let _ = writeln!(text, "| `{name}` | {unit} | {meaning} |");
        }
        text.push_str(
            "\n## alarms.log\n\n\
             One line for each alarm, at its first occurrence; empty if there is none. The same line goes to stderr. \
             Alarms but the last do not stop a run.\n\n\
             | alarm | raised when | usual reason | what to try |\n|---|---|---|---|\n",
        );
        for cause in Cause::ALL {
            let _ =
                writeln!(text, "| {} | {} | {} | {} |", cause.title(), cause.rule(), cause.reason(), cause.remedy());
        }
        text.push_str(
            "\n## provenance.json\n\n\
             Version of the program and the commit it was built from, SHA-256 of the data, seed, sizes, and the range of the data's discounted sums of \
             scaled reward and cost from each row to the end of its trajectory, with the discounts of `Q_r` and `Q_cL`: \
             where a sound critic's values lie.\n",
        );
        text
    }

    #[test]
    fn the_document_of_metrics_is_what_the_table_says() {
        crate::testing::assert_document("docs/metrics.md", &document());
    }

    #[test]
    fn column_names_differ_and_can_stand_in_a_csv() {
        for (place, column) in COLUMNS.iter().enumerate() {
            assert!(column.name.bytes().all(|byte| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_'));
            assert!(COLUMNS[..place].iter().all(|other| other.name != column.name), "{}", column.name);
            assert!(!column.meaning.contains('|') && !column.unit.is_empty());
        }
    }
}
