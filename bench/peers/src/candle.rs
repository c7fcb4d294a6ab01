//! candle's side of `bench/latency.py`: `candle NETWORK` serves the chain on plain tensors.

use std::error::Error;

use candle_core::{Device, Result, Tensor};
use serde_json::Value;

fn main() -> std::result::Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("candle NETWORK")?;
    let network: Value = serde_json::from_str(&std::fs::read_to_string(path)?)?;
    let hidden = network["hidden"].as_u64().ok_or("no width")? as usize;
    let chain = network["chain"].as_array().ok_or("no chain")?;
    let problem = &network["problem"];

    let (mean, factor) = (row(&network["state_mean"])?, row(&network["state_factor"])?);
    let (low, high) = (row(&network["action_low"])?, row(&network["action_high"])?);
    let kappa = [0, 1, 2].map(|index| &network["kappa"][index]);
    let kappa = kappa.map(|layer| Layer::new(layer, floats(&layer["bias"]).len()));
    let [kappa_1, kappa_2, kappa_3] = kappa;
    let (kappa_1, kappa_2, kappa_3) = (kappa_1?, kappa_2?, kappa_3?);
    let context_state = Layer::new(&network["context_state"], hidden)?;
    let context_kappa = matrix(&network["context_kappa"], hidden)?;
    let time_table = matrix(&network["time_table"], hidden)?;
    let action_input = matrix(&network["action_input"], hidden)?;
    let hidden_2 = Layer::new(&network["hidden_2"], hidden)?;
    let hidden_3 = Layer::new(&network["hidden_3"], hidden)?;
    let output = Layer::new(&network["output"], floats(&network["output"]["bias"]).len())?;
    let (state, condition) = (row(&problem["state"])?, row(&problem["condition"])?);
    let noise = problem["noise"].as_array().ok_or("no noise")?.iter().map(row).collect::<Result<Vec<_>>>()?;
    let number = |step: &Value, key: &str| step[key].as_f64().unwrap_or(f64::NAN);
    let times = chain.iter().map(|step| time_table.narrow(0, step["n"].as_u64().unwrap_or(0) as usize - 1, 1));
    let times = times.collect::<Result<Vec<_>>>()?;

    armor_bench_peers::serve(|| {
        let embedding = kappa_3.of(&mish(&kappa_2.of(&mish(&kappa_1.of(&condition)?)?)?)?)?;
        let context = (context_state.of(&((&state - &mean)? * &factor)?)? + embedding.matmul(&context_kappa)?)?;
        let mut action = noise[0].clone();
        for (index, step) in chain.iter().enumerate() {
            let first = ((&times[index] + &context)? + action.matmul(&action_input)?)?;
            let eps = output.of(&mish(&hidden_3.of(&mish(&hidden_2.of(&mish(&first)?)?)?)?)?)?;
            let estimate = ((&action * number(step, "from_action"))? - (eps * number(step, "from_noise"))?)?;
            let x0 = estimate.maximum(&low)?.minimum(&high)?;
            action = ((x0 * number(step, "to_x0"))? + (action * number(step, "to_action"))?)?;
            if number(step, "sigma") != 0.0 {
                action = (action + (&noise[index + 1] * number(step, "sigma"))?)?;
            }
        }
        Ok(action.flatten_all()?.to_vec1()?)
    })
}

struct Layer {
    weights: Tensor,
    bias: Tensor,
}

impl Layer {
    fn new(layer: &Value, outputs: usize) -> Result<Self> {
        Ok(Self { weights: matrix(&layer["weights"], outputs)?, bias: row(&layer["bias"])? })
    }

    fn of(&self, x: &Tensor) -> Result<Tensor> {
        x.matmul(&self.weights)? + &self.bias
    }
}

/// `x n / (n + 2)` with `n = e (e + 2)`: fewer passes than softplus and tanh. No pre-activation here overflows it.
fn mish(x: &Tensor) -> Result<Tensor> {
    let e = x.exp()?;
    let n = (&e * (&e + 2.0)?)?;
    (x * &n)? / (n + 2.0)?
}

fn floats(value: &Value) -> Vec<f32> {
    let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN) as f32;
    value.as_array().map_or_else(|| vec![number(value)], |list| list.iter().map(number).collect())
}

fn matrix(value: &Value, columns: usize) -> Result<Tensor> {
    let values = floats(value);
    let rows = values.len() / columns;
    Tensor::from_vec(values, (rows, columns), &Device::Cpu)
}

fn row(value: &Value) -> Result<Tensor> {
    let values = floats(value);
    let columns = values.len();
    Tensor::from_vec(values, (1, columns), &Device::Cpu)
}
