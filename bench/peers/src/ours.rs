//! Our side of `bench/latency.py`.
//!
//! ```text
//! ours network IMAGE     the network, the chain and a problem, as one line of JSON
//! ours fly IMAGE         serves the actions of the problem
//! ours read IMAGE        serves nothing but reading as many weights, as fast as this processor can
//! ```

use std::error::Error;
use std::hint::black_box;

use armor_core::image::{Network, PolicyImage, SECTION_ALIGNMENT};
use armor_core::noise::Noise;
use armor_core::schedule::ChainStep;
use armor_core::units::CostLimit;
use armor_infer::{Controller, Policy};
use serde_json::{Value, json};

const LIMIT: f32 = 3.0;
const SEED: u64 = 1;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Result<[String; 2], _> = std::env::args().skip(1).collect::<Vec<_>>().try_into();
    let [request, path] = arguments.map_err(|_| "usage: ours network|fly|read IMAGE")?;
    let bytes = std::fs::read(&path)?;
    let mut memory = vec![0; bytes.len() + SECTION_ALIGNMENT];
    let start = memory.as_ptr().align_offset(SECTION_ALIGNMENT);
    memory[start..][..bytes.len()].copy_from_slice(&bytes);
    let image = PolicyImage::new_checked(&memory[start..])?;
    match request.as_str() {
        "network" => println!("{}", network(&image).ok_or("the network is not in single precision")?),
        "fly" => {
            let policy = Policy::load(&image)?;
            let mut controller = Controller::<96, 8, 256>::new(policy, CostLimit::new(LIMIT)?, SEED)?;
            eprintln!("{}: kernel {}", path, policy.kernel().name());
            armor_bench_peers::serve(|| {
                // The episode starts again, so that every action is the problem's.
                controller.new_episode(CostLimit::new(LIMIT)?, SEED)?;
                Ok(controller.step(black_box(&state(&image)), 0.0).action.as_slice()[..2].to_vec())
            })?;
        }
        "read" => {
            let steps = image.sections().chain_words(image.manifest(), 0).len();
            let (Network::Float(network), rows) = (image.sections().network, steps) else { return Err("not f32".into()) };
            armor_bench_peers::serve(|| {
                for _ in 0..rows {
                    for weights in [network.action_input, network.hidden_2.weights, network.hidden_3.weights, network.output.weights] {
                        black_box(read(black_box(weights)));
                    }
                }
                Ok(Vec::new())
            })?;
        }
        _ => return Err("a request is network, fly or read".into()),
    }
    Ok(())
}

/// Every word of the weights, in 32 sums that do not wait for each other.
fn read(weights: &[f32]) -> u32 {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx512f") {
        // SAFETY: the processor has AVX-512.
        return unsafe { read_wide(weights) };
    }
    any(weights)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn read_wide(weights: &[f32]) -> u32 {
    use std::arch::x86_64::*;
    let (blocks, rest) = weights.as_chunks::<128>();
    let mut sums = [_mm512_setzero_si512(); 8];
    for block in blocks {
        for (sum, lanes) in sums.iter_mut().zip(block.as_chunks::<16>().0) {
            // SAFETY: 64 bytes, and no alignment is needed.
            *sum = _mm512_or_si512(*sum, unsafe { _mm512_loadu_si512(lanes.as_ptr().cast()) });
        }
    }
    let all = sums.into_iter().fold(_mm512_setzero_si512(), |all, sum| _mm512_or_si512(all, sum));
    _mm512_reduce_or_epi32(all) as u32 | any(rest)
}

fn any(weights: &[f32]) -> u32 {
    weights.iter().fold(0, |all, weight| all | weight.to_bits())
}

/// A state as the network was trained to see them, normal after normalisation.
fn state(image: &PolicyImage<'_>) -> Vec<f32> {
    let numbers = image.sections();
    let mut state = vec![0.0; numbers.state_mean.len()];
    Noise::new(SEED).fill_normal(u32::MAX, 0, &mut state);
    for ((entry, mean), factor) in state.iter_mut().zip(numbers.state_mean).zip(numbers.state_factor) {
        *entry = mean + if *factor == 0.0 { 0.0 } else { *entry / factor };
    }
    state
}

/// Matrices input by input; the draws of the first control step, `a^N` first.
fn network(image: &PolicyImage<'_>) -> Option<Value> {
    let (manifest, numbers) = (image.manifest(), image.sections());
    let Network::Float(network) = &numbers.network else { return None };
    let chain: Vec<ChainStep> =
        numbers.chain_words(manifest, 0).iter().map(|words| ChainStep::from_words(*words)).collect();
    let draw = |stream: usize| {
        let mut draw = vec![0.0; manifest.shape.action.into()];
        Noise::new(SEED).fill_normal(stream as u32, 0, &mut draw);
        draw
    };
    let layer = |weights: &[f32], bias: &[f32]| json!({ "weights": weights, "bias": bias });
    Some(json!({
        "hidden": manifest.shape.hidden,
        "state_mean": numbers.state_mean,
        "state_factor": numbers.state_factor,
        "action_low": numbers.action_low,
        "action_high": numbers.action_high,
        "kappa": numbers.kappa.map(|dense| layer(dense.weights, dense.bias)),
        "context_state": layer(network.context_state.weights, network.context_state.bias),
        "context_kappa": network.context_kappa,
        "time_table": network.time_table,
        "action_input": network.action_input,
        "hidden_2": layer(network.hidden_2.weights, network.hidden_2.bias),
        "hidden_3": layer(network.hidden_3.weights, network.hidden_3.bias),
        "output": layer(network.output.weights, network.output.bias),
        "chain": chain.iter().map(|step| json!({
            "n": step.n,
            "from_action": step.from_action,
            "from_noise": step.from_noise,
            "to_x0": step.to_x0,
            "to_action": step.to_action,
            "sigma": step.sigma,
        })).collect::<Vec<_>>(),
        "problem": {
            "state": state(image),
            "condition": manifest.kappa.scale * LIMIT,
            "noise": (0..=chain.len()).map(draw).collect::<Vec<_>>(),
        },
    }))
}
