//! tract's side of `bench/latency.py`: `tract MODEL PROBLEM` serves the whole chain as one optimised graph.

use std::error::Error;

use serde_json::Value;
use tract_onnx::prelude::*;

fn main() -> Result<(), Box<dyn Error>> {
    let [model, problem]: [String; 2] =
        std::env::args().skip(1).collect::<Vec<_>>().try_into().map_err(|_| "tract MODEL PROBLEM")?;
    let model = tract_onnx::onnx().model_for_path(model)?.into_optimized()?.into_runnable()?;
    let problem: Value = serde_json::from_str(&std::fs::read_to_string(problem)?)?;
    let floats = |value: &Value| -> Vec<f32> {
        let numbers = |value: &Value| value.as_f64().unwrap_or(f64::NAN) as f32;
        value.as_array().map_or_else(|| vec![numbers(value)], |list| list.iter().map(numbers).collect())
    };
    let tensor = |shape: &[usize], values: &[f32]| Tensor::from_shape(shape, values);
    let (state, condition) = (floats(&problem["state"]), floats(&problem["condition"]));
    let rows = problem["noise"].as_array().ok_or("no noise")?;
    let noise: Vec<f32> = rows.iter().flat_map(floats).collect();
    let (state, condition) = (tensor(&[1, state.len()], &state)?, tensor(&[1, 1], &condition)?);
    let noise = tensor(&[rows.len(), noise.len() / rows.len()], &noise)?;
    armor_bench_peers::serve(|| {
        let inputs = tvec!(state.clone().into(), condition.clone().into(), noise.clone().into());
        let outputs = model.run(inputs)?;
        Ok(outputs[0].to_plain_array_view::<f32>()?.iter().copied().collect())
    })
}
