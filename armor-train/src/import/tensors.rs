//! The tensors of a denoiser, by the names that PyTorch gives them.

use armor_core::shape::MAX_ACTION;
use safetensors::{Dtype, SafeTensorError, SafeTensors};
use sha2::{Digest, Sha256};

use super::Description;
use crate::actor::denoiser::{Denoiser, Widths};
use crate::nn::Linear;

/// The layers in the order of a forward pass.
const TIME: [&str; 2] = ["time_mlp.1", "time_mlp.3"];
const BODY: [&str; 4] = ["mid_layer.0", "mid_layer.2", "mid_layer.4", "final_layer"];
/// Largest width of a layer, state or action that an image holds.
const MAX_WIDTH: usize = 1024;

/// A file of tensors.
#[derive(Debug)]
pub struct Tensors<'a> {
    file: SafeTensors<'a>,
    prefix: String,
    sha256: [u8; 32],
}

/// Why tensors make no denoiser.
#[derive(Debug, thiserror::Error)]
pub enum TensorError {
    /// The file is no safetensors.
    #[error("no safetensors file: {0}; save the policy's state_dict with safetensors.torch.save_file")]
    File(#[from] SafeTensorError),
    /// A layer is not there.
    #[error("tensor {name} is missing; the file has {found}")]
    Missing {
        /// The tensor.
        name: String,
        /// Names that are there.
        found: String,
    },
    /// A tensor is not of 32-bit floats.
    #[error("tensor {name} is {found:?}, not F32; convert it with .float()")]
    Type {
        /// The tensor.
        name: String,
        /// Its type.
        found: Dtype,
    },
    /// A tensor has not the shape that the others ask for.
    #[error("tensor {name} is {found:?}, expected {expected}")]
    Shape {
        /// The tensor.
        name: String,
        /// Its shape.
        found: Vec<usize>,
        /// The shape that it should have.
        expected: String,
    },
    /// A weight is NaN or infinite.
    #[error("tensor {0} holds a NaN or an infinity; the training diverged")]
    NotFinite(String),
}

impl<'a> Tensors<'a> {
    pub(super) fn read(bytes: &'a [u8], prefix: &str) -> Result<Self, TensorError> {
        let file = SafeTensors::deserialize(bytes)?;
        Ok(Self { file, prefix: prefix.into(), sha256: Sha256::digest(bytes).into() })
    }

    /// SHA-256 of the file.
    pub(super) const fn sha256(&self) -> [u8; 32] {
        self.sha256
    }

    /// The widths that the tensors' shapes give.
    pub(super) fn widths(&self, given: &Description) -> Result<Widths, TensorError> {
        let [time_hidden, time_code] = self.matrix(TIME[0], "[hidden, code] of a time embedding")?;
        let [time_embedding, _] = self.matrix(TIME[1], "[embedding, hidden] of a time embedding")?;
        let [hidden, inputs] = self.matrix(BODY[0], "[hidden, action + time + state]")?;
        let [action, _] = self.matrix(BODY[3], "[action, hidden]")?;
        if time_code < 4 || !time_code.is_multiple_of(2) {
            return Err(self.shape(TIME[0], "[hidden, code] with an even code of at least 4"));
        }
        let state = inputs.saturating_sub(action + time_embedding);
        let within = [hidden, state, time_hidden, time_embedding].iter().all(|width| (1..=MAX_WIDTH).contains(width));
        if !within || action > MAX_ACTION {
            let rest = action + time_embedding;
            return Err(self.shape(BODY[0], &format!("[1 to 1024, {rest} + 1 to 1024 state entries]")));
        }
        Ok(Widths {
            state,
            action,
            hidden,
            kappa_hidden: 0,
            kappa_embedding: 0,
            time_code,
            time_hidden,
            time_embedding,
            steps: given.steps,
        })
    }

    /// The parameters of `denoiser`, with zeros where the tensors have nothing.
    pub(super) fn parameters(&self, denoiser: &Denoiser) -> Result<Vec<f32>, TensorError> {
        let mut parameters = vec![0.0; denoiser.size()];
        for (name, layer) in TIME.iter().zip(denoiser.time().layers()) {
            self.fill(name, layer, layer.inputs, |input| input, &mut parameters)?;
        }
        // The tensors' order is action, time, state.
        let [of_action, of_state, _, of_time] = denoiser.blocks();
        let (a, t) = (of_action.len(), of_time.len());
        let place = |input: usize| match input {
            input if input < a => input,
            input if input < a + t => of_time.start + input - a,
            input => of_state.start + input - a - t,
        };
        self.fill(BODY[0], denoiser.first(), a + t + of_state.len(), place, &mut parameters)?;
        for (name, layer) in BODY[1..].iter().zip(denoiser.body().layers()) {
            self.fill(name, layer, layer.inputs, |input| input, &mut parameters)?;
        }
        Ok(parameters)
    }

    /// Puts a layer of `inputs` into its place; the tensor's `i`-th input is the layer's `place(i)`-th.
    fn fill(
        &self,
        name: &str,
        layer: &Linear,
        inputs: usize,
        place: impl Fn(usize) -> usize,
        parameters: &mut [f32],
    ) -> Result<(), TensorError> {
        let weights = self.numbers(&format!("{name}.weight"), &[layer.outputs, inputs])?;
        let bias = self.numbers(&format!("{name}.bias"), &[layer.outputs])?;
        for (output, row) in weights.chunks_exact(inputs).enumerate() {
            for (input, weight) in row.iter().enumerate() {
                parameters[layer.offset + place(input) * layer.outputs + output] = *weight;
            }
        }
        layer.bias_mut(parameters).copy_from_slice(&bias);
        Ok(())
    }

    /// The shape of a layer's weights, outputs by inputs.
    fn matrix(&self, layer: &str, expected: &str) -> Result<[usize; 2], TensorError> {
        let name = format!("{layer}.weight");
        let shape = self.tensor(&name)?.shape().to_vec();
        <[usize; 2]>::try_from(shape).map_err(|_| self.shape(layer, expected))
    }

    fn shape(&self, layer: &str, expected: &str) -> TensorError {
        let name = format!("{layer}.weight");
        let found = self.tensor(&name).map(|tensor| tensor.shape().to_vec()).unwrap_or_default();
        TensorError::Shape { name: self.full(&name), found, expected: expected.into() }
    }

    fn full(&self, name: &str) -> String {
        format!("{}{name}", self.prefix)
    }

    fn tensor(&self, name: &str) -> Result<safetensors::tensor::TensorView<'a>, TensorError> {
        let name = self.full(name);
        self.file.tensor(&name).map_err(|_| {
            let mut names = self.file.names();
            names.sort_unstable();
            const SHOWN: usize = 8;
            let more = if names.len() > SHOWN { ", ..." } else { "" };
            names.truncate(SHOWN);
            let found = if names.is_empty() { "none".into() } else { format!("{}{more}", names.join(", ")) };
            TensorError::Missing { name, found }
        })
    }

    fn numbers(&self, name: &str, expected: &[usize]) -> Result<Vec<f32>, TensorError> {
        let tensor = self.tensor(name)?;
        let name = self.full(name);
        if tensor.dtype() != Dtype::F32 {
            return Err(TensorError::Type { name, found: tensor.dtype() });
        }
        if tensor.shape() != expected {
            let found = tensor.shape().to_vec();
            return Err(TensorError::Shape { name, found, expected: format!("{expected:?}") });
        }
        let (words, _) = tensor.data().as_chunks();
        let numbers: Vec<f32> = words.iter().map(|word| f32::from_le_bytes(*word)).collect();
        if numbers.iter().any(|number| !number.is_finite()) {
            return Err(TensorError::NotFinite(name));
        }
        Ok(numbers)
    }
}
