//! One denoising step as an ONNX graph, for other runtimes: `eps(a^n, n | s, kappa)`
//! of Appendix B, from the numbers of an image in single precision.
//!
//! | input | shape | |
//! |---|---|---|
//! | `action` | `batch x A` | the noisy action |
//! | `state` | `batch x S` | as the sensors give it: the graph normalises |
//! | `kappa` | `batch x 1` | what is left of the budget, or what the image's budget map makes of it |
//! | `level` | `batch` | the noise level `n`, 1 to `N`, int64 |
//!
//! The output `eps` is `batch x A`. The operators are of opset 13; Mish is
//! spelt out, so that runtimes without it run the graph too.

mod schema;

use armor_core::image::{Dense, Manifest, Network, PolicyImage};
use prost::Message;

use crate::export::ExportError;
use schema::{
    AttributeProto, Dimension, FLOAT, GraphProto, INT64, ModelProto, NodeProto, OperatorSetIdProto, TensorProto,
    TensorShapeProto, TensorType, TypeProto, ValueInfoProto,
};

/// The operators' version: the one in which Softplus, Gather and Gemm last changed is no later.
const OPSET: i64 = 13;
/// Version of the file format that brought opset 13.
const IR_VERSION: i64 = 7;

/// The bytes of an `.onnx` file.
///
/// # Errors
/// [`ExportError::NotFloat`] for an image in integers.
pub fn onnx(image: &PolicyImage<'_>) -> Result<Vec<u8>, ExportError> {
    let Network::Float(network) = &image.sections().network else { return Err(ExportError::NotFloat) };
    let (numbers, Manifest { task, shape, kappa, .. }) = (image.sections(), image.manifest());
    let [s, a, h, e, n] =
        [shape.state, shape.action, shape.hidden, shape.kappa_embedding, shape.steps].map(usize::from);
    let mut graph = Graph::default();

    graph.float("state_mean", &[s], numbers.state_mean);
    graph.float("state_factor", &[s], numbers.state_factor);
    graph.node("Sub", &["state", "state_mean"], "state_centred");
    graph.node("Mul", &["state_centred", "state_factor"], "state_normalised");

    graph.float("kappa_scale", &[], &[kappa.scale]);
    graph.node("Mul", &["kappa", "kappa_scale"], "kappa_0");
    let [one, two, three] = &numbers.kappa;
    graph.dense(one, "kappa_0", "kappa_1");
    graph.mish("kappa_1", "kappa_1_mish");
    graph.dense(two, "kappa_1_mish", "kappa_2");
    graph.mish("kappa_2", "kappa_2_mish");
    graph.dense(three, "kappa_2_mish", "kappa_embedding");

    graph.float("time_table", &[n, h], network.time_table);
    graph.integer("one", 1);
    graph.node("Sub", &["level", "one"], "row");
    graph.node("Gather", &["time_table", "row"], "time");

    let first = [network.action_input, network.context_state.weights, network.context_kappa].concat();
    debug_assert_eq!(first.len(), (a + s + e) * h);
    graph.node("Concat", &["action", "state_normalised", "kappa_embedding"], "input").attribute("axis", 1);
    graph.dense(&Dense { weights: &first, bias: network.context_state.bias }, "input", "timeless");
    graph.node("Add", &["timeless", "time"], "hidden_1");
    graph.mish("hidden_1", "hidden_1_mish");
    graph.dense(&network.hidden_2, "hidden_1_mish", "hidden_2");
    graph.mish("hidden_2", "hidden_2_mish");
    graph.dense(&network.hidden_3, "hidden_2_mish", "hidden_3");
    graph.mish("hidden_3", "hidden_3_mish");
    graph.dense(&network.output, "hidden_3_mish", "eps");

    let condition = if numbers.budget_map.is_some() { "the image's budget map of kappa" } else { "remaining budget" };
    let model = ModelProto {
        ir_version: IR_VERSION,
        producer_name: "armor-train".into(),
        producer_version: env!("CARGO_PKG_VERSION").into(),
        doc_string: format!("one denoising step of an ARMOR policy for {task}, {n} noise levels"),
        graph: Some(GraphProto {
            name: "denoiser".into(),
            input: vec![
                value("action", FLOAT, Some(a), "noisy action"),
                value("state", FLOAT, Some(s), "state as sensed"),
                value("kappa", FLOAT, Some(1), condition),
                value("level", INT64, None, "noise level, 1 to N"),
            ],
            output: vec![value("eps", FLOAT, Some(a), "the noise in the action")],
            ..graph.0
        }),
        opset_import: vec![OperatorSetIdProto { domain: String::new(), version: OPSET }],
    };
    Ok(model.encode_to_vec())
}

/// A graph as it grows.
#[derive(Default)]
struct Graph(GraphProto);

impl Graph {
    fn node(&mut self, operator: &str, inputs: &[&str], output: &str) -> &mut NodeProto {
        self.0.node.push(NodeProto {
            input: inputs.iter().map(|&input| input.into()).collect(),
            output: vec![output.into()],
            name: output.into(),
            op_type: operator.into(),
            attribute: Vec::new(),
        });
        let last = self.0.node.len() - 1;
        &mut self.0.node[last]
    }

    /// `output = x W + b` under the names of the output.
    fn dense(&mut self, layer: &Dense<'_>, x: &str, output: &str) {
        let [weights, bias] = ["weights", "bias"].map(|part| format!("{output}_{part}"));
        let outputs = layer.bias.len();
        self.float(&weights, &[layer.weights.len() / outputs, outputs], layer.weights);
        self.float(&bias, &[outputs], layer.bias);
        self.node("Gemm", &[x, &weights, &bias], output);
    }

    /// `x tanh(ln(1 + e^x))`.
    fn mish(&mut self, x: &str, output: &str) {
        let [softplus, tanh] = ["softplus", "tanh"].map(|part| format!("{x}_{part}"));
        self.node("Softplus", &[x], &softplus);
        self.node("Tanh", &[&softplus], &tanh);
        self.node("Mul", &[x, &tanh], output);
    }

    fn float(&mut self, name: &str, dims: &[usize], values: &[f32]) {
        let raw_data = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.tensor(name, FLOAT, dims, raw_data);
    }

    fn integer(&mut self, name: &str, value: i64) {
        self.tensor(name, INT64, &[], value.to_le_bytes().into());
    }

    fn tensor(&mut self, name: &str, data_type: i32, dims: &[usize], raw_data: Vec<u8>) {
        let dims = dims.iter().map(|&dim| dim as i64).collect();
        self.0.initializer.push(TensorProto { dims, data_type, name: name.into(), raw_data });
    }
}

impl NodeProto {
    fn attribute(&mut self, name: &str, value: i64) {
        const INTEGER: i32 = 2;
        self.attribute.push(AttributeProto { name: name.into(), i: value, r#type: INTEGER });
    }
}

/// A tensor of a batch, with so many entries a sample or one without an axis of its own.
fn value(name: &str, elem_type: i32, entries: Option<usize>, doc_string: &str) -> ValueInfoProto {
    let batch = Dimension { dim_value: None, dim_param: Some("batch".into()) };
    let entries = entries.map(|entries| Dimension { dim_value: Some(entries as i64), dim_param: None });
    let shape = TensorShapeProto { dim: [batch].into_iter().chain(entries).collect() };
    ValueInfoProto {
        name: name.into(),
        r#type: Some(TypeProto { tensor_type: Some(TensorType { elem_type, shape: Some(shape) }) }),
        doc_string: doc_string.into(),
    }
}
