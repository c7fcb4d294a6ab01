//! What every option means: the source of `docs/config.md` and `armor-train options`.

use std::fmt::Write;

use super::Preset;
use super::preset::POINT_CIRCLE;
use crate::study::{ABLATION, Study, Variant};

/// An option of [`Config`](super::Config): its key, and its meaning with equation or reason.
pub type Entry = (&'static str, &'static str);

/// All options, by what they are about. `O-n` are the choices that the paper
/// leaves open; the meaning says what was chosen and why.
pub const OPTIONS: [(&str, &[Entry]); 6] = [
    (
        "Run",
        &[
            ("preset", "named set of choices that the other keys started from: `paper`, `quick` or `tuned`"),
            ("data", "path of the recorded data; given by --data"),
            ("task", "task that was recorded, such as ball-run; given by --task"),
            (
                "limit",
                "cost limit d of an episode, in units of recorded cost (Eq. 1); given by --limit, else the paper's for the task",
            ),
            ("seed", "seed of everything random; given by --seed"),
            ("steps", "training steps (Table 2); given by --steps"),
            ("batch", "transitions of a training step, drawn with replacement (Table 2)"),
            (
                "sampling",
                "what is drawn with equal chances: a transition, `uniform`; a `trajectory` and then a transition of it; or one of ten bins of cost return, `cost_bins`, then a trajectory and a transition of it (O-31)",
            ),
            (
                "selection",
                "the actor that flies: the `last` one, or the one after the 500 steps with the smallest mean `cloning_loss`, counted once the weights are in use; no simulator is asked (O-24)",
            ),
        ],
    ),
    (
        "Data",
        &[
            (
                "unfinished",
                "rows after the last end mark: `drop`, or `keep` them as an episode that costs what it cost until then (O-1)",
            ),
            (
                "done_mask",
                "last steps that no value follows (Eq. 3): `any`, by the task's rule or by the time limit, or `terminal`, by the task's rule alone (O-3)",
            ),
            (
                "reward_unit",
                "what decides reward_scale: it is `given`, or it becomes T / (R_max - R_min) of the data's returns, `return_range`, as in FISOR (O-4)",
            ),
            ("reward_scale", "factor on recorded rewards; 0.1 is what public code for these tasks takes (O-4)"),
            ("cost_scale", "factor on recorded costs and on kappa (O-4)"),
            (
                "kappa_unit",
                "what decides kappa_scale: it is `given`, or it becomes 1 over the cost `limit`, or over the `largest` kappa of the data (O-8)",
            ),
            (
                "kappa_scale",
                "factor on kappa where it enters a network; 1 over the cost limit or over the largest kappa brings the input near 1 (O-8)",
            ),
            (
                "normalize_states",
                "whether the networks see states with mean 0 and variance 1; the image carries the constants (O-5)",
            ),
            (
                "reward_noise",
                "standard deviation of noise put on the recorded rewards, in their standard deviations; a study of sensors that are not accurate (section 5)",
            ),
            (
                "cost_errors",
                "share of steps whose recorded cost is misread, missed or seen where there is none; the same study",
            ),
        ],
    ),
    (
        "Networks",
        &[
            (
                "policy",
                "what the policy's distribution is: `diffusion`, or `gaussian`, a single step around the network's answer, which needs diffusion_steps = target_steps = 1 (section 4.5)",
            ),
            ("diffusion_steps", "denoising steps N of the policy (Eq. 11, Table 2)"),
            (
                "noise_schedule",
                "noise schedule: `vp`, variance-preserving with beta from 0.1 to 10, or `cosine` (O-25)",
            ),
            (
                "reverse_variance",
                "variance of a DDPM step: `posterior`, or `beta`, the larger one of the forward step (O-27)",
            ),
            (
                "x0_clip",
                "where a chain clips its estimate of the clean action to the bounds: at `each_step`, where \
                 clipped entries pass no gradient, or at the `last_step` alone (O-26)",
            ),
            ("temperature", "factor on the noise that DDPM steps add; below 1 the policy is less random (O-27)"),
            ("gaussian_std", "standard deviation of a gaussian policy, in units of the action's bounds"),
            ("hidden", "units of the denoiser's three hidden layers (Appendix B)"),
            ("kappa_hidden", "hidden units of the kappa embedding, whose width the paper leaves open (O-8)"),
            ("kappa_embedding", "entries of the kappa embedding (O-8)"),
            (
                "time_frequencies",
                "frequencies of that code: `geometric`, over four decades, or `learned` Fourier features, as in FISOR (O-9)",
            ),
            ("time_code", "entries of the sinusoidal code of a denoising step; even (O-9)"),
            ("time_hidden", "hidden units of the time embedding (O-9)"),
            ("time_embedding", "entries of the time embedding (O-9)"),
            ("trunk", "units of the critic's two shared layers (Appendix B)"),
            ("head", "hidden units of a critic head (Appendix B)"),
            (
                "head_layers",
                "hidden layers of a critic head, 1 or 2; the paper's \"2-layer\" can be read as either (O-6)",
            ),
            (
                "critic_trunk",
                "what the critic's estimates share: `shared`, one trunk, or `separate`, independent critics with a trunk each, on which gradient surgery has nothing to do (section 4.5)",
            ),
            (
                "cost_heads",
                "heads that estimate costs: `per_horizon`, or `single`, one pair that learns the targets of both horizons (section 4.5)",
            ),
            (
                "cost_output",
                "what follows the last layer of a cost head: `linear`, or `softplus`, with which no estimate is 0, so that the indicator of Eq. 8 never holds at kappa 0 (O-7)",
            ),
            ("dual_hidden", "units of the dual network's two hidden layers (Appendix B)"),
        ],
    ),
    (
        "Learning",
        &[
            ("actor_rate", "learning rate of the actor, Adam (Table 2)"),
            ("critic_rate", "learning rate of the critic, Adam (Table 2)"),
            ("dual_rate", "learning rate of the dual network, Adam (Appendix B)"),
            ("target_rate", "soft update of the target critic at every step, tau (Appendix B)"),
            ("twin_loss", "how the losses of a critic's twins are joined: `sum` or `mean` (Eq. 4, O-11)"),
            (
                "pcgrad",
                "gradient surgery on the shared trunk (Eq. 5): each task meets the others in `random` or `fixed` order, or `off`, not at all (O-17, section 4.5)",
            ),
            ("trunk_gradient", "how the tasks' trunk gradients become one: `mean` or `sum` (Eq. 5, O-17)"),
            ("reward_discount", "discount of the reward, gamma_r (Eq. 3, Table 2)"),
            ("long_cost_discount", "discount of the long-term cost, gamma_cL (Eq. 3, Table 2)"),
            ("short_cost_discount", "discount of the short-term cost, gamma_cS (Eq. 3, Table 2)"),
            ("eta", "reward guidance coefficient (Eq. 14, Table 2)"),
            (
                "guidance",
                "what eta counts in: `raw`, scaled reward, or `normalized`, mean |Q_r| of the batch, so that one eta serves tasks with other returns (O-14)",
            ),
            (
                "cloning_norm",
                "how the squared error of a predicted noise is taken over action entries (Eq. 13): `sum`, or `mean`, which weakens cloning against guidance by their number (O-12)",
            ),
            (
                "policy_gradient",
                "how the gradient of Eq. 15 reaches the actor: `full`, through all steps of a sampled chain, `last_k`, through its last gradient_steps alone, or `one_step`, through the estimate of the clean action from the noised one, several times cheaper (O-13)",
            ),
            (
                "gradient_steps",
                "last steps of the sampled chain that `last_k` differentiates, at most diffusion_steps (O-13)",
            ),
            (
                "target_sampler",
                "sampler of the next action in the targets (Eq. 3): `ddpm`, or the deterministic `ddim`",
            ),
            ("target_steps", "steps of that sampler, at most diffusion_steps; fewer are cheaper"),
            (
                "relabel_share",
                "share of samples whose kappa is relabelled with a larger budget, up to the data's largest; recorded kappa always ends at 0, so a clone learns to spend it all",
            ),
            (
                "threshold",
                "what Q_cL is held against (Eqs. 14 to 16): `kappa`, or `discounted`, kappa as it would be discounted if it were spent evenly over the rest of the episode",
            ),
            (
                "dual_slack",
                "added to that, in units of recorded cost; noise in Q_cL otherwise keeps the constraint violated at kappa 0",
            ),
            ("dual_normalize", "whether the violation is counted in limits instead of units of cost"),
            ("log_lambda_min", "smallest log lambda (Appendix B)"),
            ("log_lambda_max", "largest log lambda (Appendix B)"),
            (
                "dual_clip",
                "what the clip to that range passes back: `zero_gradient` outside, or `straight_through`, with which lambda can come back from beyond (O-16)",
            ),
            (
                "dual_decay",
                "factor on the squared norm of the dual's weights in its loss, which keeps lambda near 1; CCAC takes 0.01 (O-16)",
            ),
            ("dual_zero_start", "whether the dual's last layer starts at 0, and so lambda at 1 everywhere (O-16)"),
            ("final_rate", "learning rates at the last step as a share of the first, along half a cosine (O-30)"),
            ("gradient_clip", "largest Euclidean norm of a network's gradient; 0 is no limit (O-30)"),
            (
                "weight_decay",
                "decoupled decay of the weights of actor and critics, times their learning rates, as in AdamW; 0 is none (O-30)",
            ),
            (
                "actor_average",
                "decay of a moving average of the actor's weights, which is exported in their place; 0 is none (O-10)",
            ),
            (
                "target_actor",
                "the actor that takes the next action of the targets (Eq. 3): `live`, or `average`, the moving average where one is kept (O-10)",
            ),
            ("policy_critic", "the critic that judges the policy's actions (Eq. 15): `live` or `target` (O-15)"),
            (
                "policy_twins",
                "which of its twins: `pessimistic`, the smaller reward and the larger cost; `minimum`, the smaller one of both, as CCAC; their `mean`; or a `random` one each step, as Diffusion-QL (O-15)",
            ),
        ],
    ),
    (
        "In-sample learning",
        &[
            (
                "bootstrap",
                "what the critics' targets bootstrap from: `policy`, the target critic at an action of the policy (Eq. 3), or `in_sample`, state values learnt by expectile regression at recorded actions alone, so that no value of an action that the data lacks is ever asked",
            ),
            (
                "critic_sees_kappa",
                "whether the critics see kappa; recorded data meet every budget by construction, so a critic that sees kappa finds nearly all of it feasible",
            ),
            (
                "reward_expectile",
                "expectile of the state values of reward; 0.5 is the mean, above it leans towards the best action",
            ),
            (
                "cost_expectile",
                "expectile of the state values of cost; 0.5 is the mean, below it leans towards the cheapest action",
            ),
            (
                "critic_steps",
                "training steps of the critics alone; they are frozen then, and the actor learns for the rest; 0 trains both at once, which only bootstrap = policy needs",
            ),
            (
                "extraction",
                "how the actor takes up what the critics know: `guidance`, by their gradient at its actions (Eq. 15), or `weighted`, by cloning each recorded action with weight exp(min(cap, alpha (A_r - lambda A_cL))), A the advantage divided by its mean size over the data, times w of Eq. 10, divided by its mean over the batch",
            ),
            (
                "advantage",
                "by what those weights judge an action: `critics`, their Q - V, or `recorded`, what its trajectory went on with against the state values (generalised advantage estimation), which tells the drivers of a mixed recording apart",
            ),
            (
                "advantage_decay",
                "how far `recorded` looks ahead: 0 is one step, 1 the trajectory's whole discounted return",
            ),
            ("advantage_temperature", "inverse temperature alpha of those weights"),
            ("advantage_lambda", "price lambda of cost in those weights"),
            ("advantage_cap", "largest logarithm of those weights"),
            (
                "safest_share",
                "share of the trajectories within the limit (of all, where none is) that weighted extraction clones: those whose states have the least mean V_cL, for what a trajectory itself cost is in part luck; each has an equal chance then, whatever sampling says; 1 clones all that was recorded",
            ),
            (
                "state_noise",
                "standard deviation of noise on the states that weighted extraction clones from, in units of what the networks see, so that few drivers teach what to do near their states, too",
            ),
            (
                "condition",
                "what the actor is conditioned on, beside the state: `kappa` (the paper), `lambda`, the price of cost in its weights, drawn log-uniformly for each sample, to which the command calibrate maps the remaining budget, or `none`; the last two need weighted extraction",
            ),
            ("lambda_min", "smallest price that is drawn"),
            ("lambda_max", "largest price that is drawn"),
        ],
    ),
    (
        "Reweighting",
        &[
            (
                "reweight",
                "which scales of reweighting are on: `both`, `trajectory` (Eq. 6), `counterfactual` (Eqs. 8 and 9), or `off`, all weights 1 (section 4.5)",
            ),
            ("reweight_warmup", "training steps before the weights are active (Table 2)"),
            ("reweight_interval", "training steps between refreshes of the weights (Table 2)"),
            (
                "refresh_share",
                "share of the transitions, drawn at random, that a refresh looks at; fewer are cheaper (O-18)",
            ),
            (
                "reweight_averaged",
                "what the moving average over refreshes is of: `counterfactual` weights, or the final `weight` of Eq. 10 (O-21)",
            ),
            ("reweight_ema", "share of the new value in that moving average (Table 2, O-21)"),
            ("beta", "trajectory weight control coefficient: feasible trajectories weigh 1 + beta (Eq. 6, Table 2)"),
            (
                "feasible_mass",
                "share of the weight that feasible trajectories get together (Eq. 7), in place of beta; 0 leaves it to beta",
            ),
            ("perturbations", "counterfactual samples K of a transition (Eq. 8, Table 2)"),
            ("sigma", "standard deviation of counterfactual noise, in units of the action's bounds (Eq. 8, Table 2)"),
            ("sigma_per_entry", "whether sigma counts in standard deviations of each recorded action entry"),
            (
                "counterfactual_reference",
                "what Q_cS is held against in Eq. 8: `kappa`, which leaves a margin at kappa 0 and 1 only, or `realised`, the short-horizon cost that the trajectory itself incurred",
            ),
            ("counterfactual_tolerance", "added to that, in units of recorded cost"),
            ("counterfactual_critic", "the critic of Eq. 8: `live` or `target` (O-19)"),
            ("counterfactual_twins", "which of its twins: `pessimistic`, `minimum` or `mean`, as policy_twins (O-19)"),
            ("margin_mean", "over what the margins of Eq. 9 have their mean: a `batch`, or the `data` (O-22)"),
            (
                "weight_mean",
                "over what the weights of Eq. 10 have their mean: all `data`, or the `batch` of a training step (O-22)",
            ),
            ("weight_min", "smallest weight, w_min (Eq. 10, Table 2)"),
            ("weight_max", "largest weight, w_max (Eqs. 9 and 10, Table 2)"),
        ],
    ),
];

/// Columns of a terminal that a listing fits into.
const WIDTH: usize = 80;
/// Where the meanings of a listing start.
const INDENT: usize = 6;
/// The presets of a listing.
const PRESETS: [Preset; 3] = [Preset::Paper, Preset::Quick, Preset::Tuned];

/// What an option means.
pub fn meaning(key: &str) -> Option<&'static str> {
    let mut entries = OPTIONS.iter().flat_map(|(_, entries)| *entries);
    entries.find(|(other, _)| *other == key).map(|(_, meaning)| *meaning)
}

/// The value of a key in each preset, as it stands in `config.toml`; "given" for what belongs to a run.
fn values(key: &str) -> [String; PRESETS.len()] {
    PRESETS.map(|preset| {
        let options = preset.config("", 0.0).options();
        match options.get(key) {
            Some(value) if !["data", "task", "limit"].contains(&key) => plain(value),
            _ => "given".to_owned(),
        }
    })
}

/// A value without quotes.
pub fn plain(value: &toml::Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// `docs/config.md`.
pub fn document() -> String {
    let mut text = String::from(
        "# Options of a training run\n\n\
         `armor-train fit --preset paper|quick|tuned` starts from a preset. The file of `--config FILE.toml` replaces any of \
         its options, `--set key=value` those of the file, and the flags `--data`, `--task`, `--limit`, `--steps` and \
         `--seed` win over both. \
         `DIR/config.toml` keeps the effective values. `armor-train options` prints this list. \
         This page is generated; `armor-train/src/config/options.rs` is its source.\n\n\
         Equations, tables and appendices are the paper's. O-n are choices that the paper leaves open; \
         the preset `paper` takes what the public code that the paper builds on does.\n",
    );
    for (group, entries) in OPTIONS {
        let _ = write!(text, "\n## {group}\n\n| key | paper | quick | tuned | meaning |\n|---|---|---|---|---|\n");
        for (key, meaning) in entries {
            let [paper, quick, tuned] = values(key);
            let _ = writeln!(text, "| `{key}` | {paper} | {quick} | {tuned} | {meaning} |");
        }
    }
    text.push_str(&by_task());
    text.push_str(&ablation());
    text
}

/// What the preset `tuned` has otherwise on a task of its own.
fn by_task() -> String {
    let mut text = format!(
        "\n## `tuned` by task\n\n\
         The column above holds for most tasks. On {} `tuned` differs (`docs/simulators.md` says why):\n\n\
         | key | value |\n|---|---|\n",
        POINT_CIRCLE.map(|task| format!("`{task}`")).join(" and ")
    );
    for (key, value) in tuned_to_task() {
        let _ = writeln!(text, "| `{key}` | {value} |");
    }
    text
}

/// The options of `tuned` on [`POINT_CIRCLE`] that differ from those on most tasks.
fn tuned_to_task() -> Vec<(String, String)> {
    let [most, own] = ["", POINT_CIRCLE[0]].map(|task| Preset::Tuned.config(task, 0.0).options());
    let differs = |(key, value): &(String, toml::Value)| key != "task" && most.get(key) != Some(value);
    own.into_iter().filter(differs).map(|(key, value)| (key, plain(&value))).collect()
}

/// The variants of the paper's ablation as options.
fn ablation() -> String {
    let mut text = String::from(
        "\n## The paper's ablation\n\n\
         The eight variants of section 4.5, each on top of any preset; `armor-train study ablation` trains and \
         flies them all. A Gaussian policy needs one step alone, for it is one. \
         Where a horizon has no head of its own, one pair of heads learns the targets of both.\n\n\
         | variant | `--set` |\n|---|---|\n",
    );
    // The study is part of the program, and a test parses it.
    let variants = toml::from_str::<Study>(ABLATION).map(|study| study.variants).unwrap_or_default();
    for Variant { name, set } in variants {
        let options: Vec<String> = set.iter().map(|(key, value)| format!("`--set {key}={}`", plain(value))).collect();
        let options = if options.is_empty() { "nothing".to_owned() } else { options.join(" ") };
        let _ = writeln!(text, "| {name} | {options} |");
    }
    text
}

/// The same in 80 columns.
pub fn listing() -> String {
    let mut text = String::new();
    for (group, entries) in OPTIONS {
        let _ = writeln!(text, "{}{group}", if text.is_empty() { "" } else { "\n" });
        for (key, meaning) in entries {
            let [paper, quick, tuned] = values(key);
            let _ = if paper == quick && paper == tuned {
                writeln!(text, "  {key} = {paper}")
            } else {
                writeln!(text, "  {key} = {paper} (paper), {quick} (quick), {tuned} (tuned)")
            };
            wrap(&mut text, meaning);
        }
    }
    let _ = writeln!(text, "\n`tuned` on {}", POINT_CIRCLE.join(" and "));
    for (key, value) in tuned_to_task() {
        let _ = writeln!(text, "  {key} = {value}");
    }
    text.trim_end().to_owned()
}

/// Appends words in indented lines.
fn wrap(text: &mut String, words: &str) {
    let mut column = 0;
    for word in words.split_whitespace().map(|word| word.replace('`', "")) {
        if column == 0 || column + 1 + word.chars().count() > WIDTH {
            let _ = write!(text, "{}{:INDENT$}{word}", if column == 0 { "" } else { "\n" }, "");
            column = INDENT + word.chars().count();
        } else {
            let _ = write!(text, " {word}");
            column += 1 + word.chars().count();
        }
    }
    text.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_document_of_options_is_what_the_table_says() {
        crate::testing::assert_document("docs/config.md", &document());
    }

    #[test]
    fn every_option_is_described_once_and_nothing_else() {
        let mut described: Vec<&str> = OPTIONS.iter().flat_map(|(_, entries)| *entries).map(|entry| entry.0).collect();
        described.sort_unstable();
        let options = Preset::Paper.config("", 0.0).options();
        let mut keys: Vec<&str> = options.keys().map(String::as_str).collect();
        keys.sort_unstable();
        assert_eq!(described, keys);
    }

    #[test]
    fn every_choice_among_names_is_spelt_out() {
        let mut config = Preset::Paper.config("", 0.0);
        let named =
            config.options().into_iter().filter(|(key, value)| value.is_str() && !["data", "task"].contains(&&**key));
        for (key, _) in named {
            let names: Vec<&str> = meaning(&key).unwrap().split('`').skip(1).step_by(2).collect();
            assert!(names.len() >= 2, "{key}");
            for name in names {
                config.set(&format!("{key}={name}")).unwrap();
            }
        }
    }

    #[test]
    fn the_listing_fits_a_terminal_and_holds_every_key_and_word() {
        let listing = listing();
        assert!(listing.lines().all(|line| line.chars().count() <= WIDTH));
        let words = |text: &str| text.replace('`', "").split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        let flat = words(&listing).join(" ");
        for (key, meaning) in OPTIONS.iter().flat_map(|(_, entries)| *entries) {
            assert!(listing.contains(&format!("\n  {key} = ")), "{key}");
            assert!(flat.contains(&words(meaning).join(" ")), "{key}");
        }
        assert!(listing.contains("\n  batch = 512 (paper), 256 (quick), 256 (tuned)\n"));
    }
}
