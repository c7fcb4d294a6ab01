//! Policies from elsewhere: the tensors and actions of an independent PyTorch
//! program, `tests/interchange/diffusion_ql.py`, which is run by hand.

use armor_core::image::PolicyImage;
use armor_core::units::CostLimit;
use armor_infer::Policy;
use armor_train::import::{DescriptionError, ImportError, TensorError, import};
use firmware_sim::host::HostController;
use firmware_sim::verify::verify;
use safetensors::tensor::{TensorView, serialize};
use safetensors::{Dtype, SafeTensors};
use serde_json::Value;

const TENSORS: &[u8] = include_bytes!("interchange/policy.safetensors");
const DESCRIPTION: &str = include_str!("interchange/policy.toml");

fn rows(value: &Value) -> Vec<Vec<f64>> {
    let row = |row: &Value| row.as_array().unwrap().iter().map(|entry| entry.as_f64().unwrap()).collect();
    value.as_array().unwrap().iter().map(row).collect()
}

/// From the tensors that PyTorch saved to the actions that PyTorch takes, by
/// the full stochastic chain and by a short deterministic one.
#[test]
fn an_imported_policy_takes_the_actions_of_its_pytorch_program() {
    let expected: Value = serde_json::from_str(include_str!("interchange/expected.json")).unwrap();
    let bytes = import(TENSORS, DESCRIPTION).unwrap();
    let image = PolicyImage::new_checked(bytes.as_slice()).unwrap();
    let policy = Policy::load(&image).unwrap();
    let (limit, seed) = (CostLimit::new(5.0).unwrap(), expected["seed"].as_u64().unwrap());
    for (name, steps) in [("ddpm_20", 20), ("ddim_5", 5)] {
        let mut controller = HostController::new(policy, limit, seed).unwrap();
        // The program's tick is the row, and so is the controller's; the budget is not seen.
        for (row, (state, action)) in rows(&expected["states"]).iter().zip(rows(&expected[name])).enumerate() {
            let state: Vec<f32> = state.iter().map(|&entry| entry as f32).collect();
            let step = controller.step_within(&state, row as f32 / 2.0, steps);
            assert_eq!(step.fault, None);
            for (flown, expected) in step.action.iter().zip(action) {
                assert!((f64::from(*flown) - expected).abs() < 1e-5, "{name}, row {row}: {flown} is not {expected}");
            }
        }
    }
}

#[test]
fn an_imported_image_passes_every_check_and_keeps_what_was_described() {
    let bytes = import(TENSORS, DESCRIPTION).unwrap();
    let verification = verify(bytes.as_slice(), 1);
    assert!(verification.passed, "{verification}");
    assert_eq!(verification.golden_rows, 32);
    let image = PolicyImage::new_checked(bytes.as_slice()).unwrap();
    assert_eq!(image.manifest().task, "elsewhere");
    assert_eq!(image.manifest().kappa.trained_max.to_f32(), 5.0);
    let numbers = image.sections();
    assert_eq!(numbers.state_mean, [0.5, -1.0, 0.0, 2.0, 0.25]);
    assert_eq!(numbers.state_factor, [0.5, 2.0, 1.0, 0.25, 8.0]);
    assert_eq!((numbers.action_low, numbers.action_high), (&[-1.0, -0.5, -2.0][..], &[1.0, 0.75, 2.0][..]));
    assert_eq!(numbers.action_fallback, [0.0, 0.0, 0.5]);
}

/// The tensors with one of them changed, or gone.
fn changed(name: &str, change: impl FnOnce(TensorView<'_>) -> Option<(Dtype, Vec<usize>, Vec<u8>)>) -> Vec<u8> {
    let file = SafeTensors::deserialize(TENSORS).unwrap();
    let replacement = change(file.tensor(name).unwrap());
    let tensors = file.tensors().into_iter().filter_map(|(found, view)| match (&replacement, found == name) {
        (_, false) => Some((found, view)),
        (Some((dtype, shape, data)), true) => Some((found, TensorView::new(*dtype, shape.clone(), data).unwrap())),
        (None, true) => None,
    });
    serialize(tensors, None).unwrap()
}

#[test]
fn what_is_wrong_with_tensors_is_named() {
    let error = |tensors: &[u8]| match import(tensors, DESCRIPTION).unwrap_err() {
        ImportError::Tensor(error) => error,
        other => panic!("{other}"),
    };
    assert!(matches!(error(b"not a file of tensors"), TensorError::File(_)));
    assert!(matches!(error(&TENSORS[..TENSORS.len() - 1]), TensorError::File(_)));
    for name in ["model.time_mlp.1.weight", "model.mid_layer.4.bias", "model.final_layer.weight"] {
        let TensorError::Missing { name: missing, .. } = error(&changed(name, |_| None)) else { panic!("{name}") };
        assert_eq!(missing, name);
    }
    let half =
        changed("model.mid_layer.2.weight", |view| Some((Dtype::F16, view.shape().into(), vec![0; 2 * 24 * 24])));
    assert!(matches!(error(&half), TensorError::Type { found: Dtype::F16, .. }));
    let flat = changed("model.mid_layer.0.weight", |view| Some((Dtype::F32, vec![24 * 24], view.data().into())));
    assert!(matches!(error(&flat), TensorError::Shape { .. }));
    // Wide enough for action and time, but with nothing left for a state.
    let narrow = changed("model.mid_layer.0.weight", |_| Some((Dtype::F32, vec![24, 19], vec![0; 4 * 24 * 19])));
    assert!(matches!(error(&narrow), TensorError::Shape { .. }));
    let other = changed("model.mid_layer.2.weight", |_| Some((Dtype::F32, vec![24, 23], vec![0; 4 * 24 * 23])));
    let TensorError::Shape { name, found, expected } = error(&other) else { panic!() };
    assert_eq!((name.as_str(), found, expected.as_str()), ("model.mid_layer.2.weight", vec![24, 23], "[24, 24]"));
    let nan = changed("model.final_layer.bias", |_| Some((Dtype::F32, vec![3], f32::NAN.to_le_bytes().repeat(3))));
    assert!(matches!(error(&nan), TensorError::NotFinite(name) if name == "model.final_layer.bias"));
}

#[test]
fn what_is_wrong_with_a_description_is_named() {
    let error = |from: &str, to: &str| {
        assert!(DESCRIPTION.contains(from));
        import(TENSORS, &DESCRIPTION.replace(from, to)).unwrap_err()
    };
    let description = |from, to| match error(from, to) {
        ImportError::Description(error) => error,
        other => panic!("{other}"),
    };
    assert!(matches!(description("steps = 20", "stps = 20"), DescriptionError::Toml { line: 3, .. }));
    assert!(matches!(description("steps = 20", "steps = 65"), DescriptionError::Steps(65)));
    assert!(matches!(description("steps = 20", "steps = 0"), DescriptionError::Steps(0)));
    assert!(matches!(description("\"vp\"", "\"linear\""), DescriptionError::Toml { line: 4, .. }));
    assert!(matches!(
        description("[2.0, 0.5, 1.0, 4.0, 0.125]", "[2.0, 0.5]"),
        DescriptionError::Length { found: 2, .. }
    ));
    assert!(matches!(description("[2.0, 0.5,", "[2.0, 0.0,"), DescriptionError::Deviation(1)));
    assert!(matches!(error("cost_limit_max = 5.0", "cost_limit_max = -1.0"), ImportError::Limit(_)));
    assert!(matches!(error("prefix = \"model.\"", "prefix = \"\""), ImportError::Tensor(TensorError::Missing { .. })));
    // Bounds the wrong way round make no image.
    assert!(matches!(error("action_low = [-1.0,", "action_low = [2.0,"), ImportError::Export(_)));
}
