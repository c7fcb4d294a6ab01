use super::*;
use crate::testing::{assert_gradient, fill};

fn check(activation: Activation, output: Option<Activation>) {
    let mlp = Mlp::new(&[3, 8, 7, 2], 0, activation, output);
    let parameters: Vec<f64> = fill(mlp.end(), 1);
    let input = DMatrix::from_vec(3, 6, fill(18, 2));
    let seed = DMatrix::from_vec(2, 6, fill(12, 3));
    let mut tape = mlp.tape(6);

    let loss = |parameters: &[f64], input: &DMatrix<f64>| {
        let mut tape = mlp.tape(6);
        mlp.forward(parameters, input, &mut tape, false);
        tape.output().dot(&seed)
    };
    let mut gradient = vec![0.0; mlp.end()];
    let mut input_gradient = DMatrix::zeros(3, 6);
    mlp.forward(&parameters, &input, &mut tape, true);
    tape.output_gradient().copy_from(&seed);
    mlp.backward(&parameters, &input, &mut tape, Some(&mut gradient), Some((&mut input_gradient, Update::Replace)));

    assert_gradient(&parameters, &gradient, |parameters| loss(parameters, &input));
    assert_gradient(input.as_slice(), input_gradient.as_slice(), |values| {
        loss(&parameters, &DMatrix::from_column_slice(3, 6, values))
    });
}

#[test]
fn gradients_are_those_of_finite_differences() {
    check(Activation::Mish, None);
    check(Activation::Mish, Some(Activation::Mish));
    check(Activation::Mish, Some(Activation::Softplus));
    check(Activation::Relu, None);
}

#[test]
fn a_second_backward_pass_adds_to_the_gradient() {
    let mlp = Mlp::new(&[2, 3, 1], 0, Activation::Mish, None);
    let parameters: Vec<f64> = fill(mlp.end(), 1);
    let input = DMatrix::from_vec(2, 4, fill(8, 2));
    let mut tape = mlp.tape(4).repeatable();
    let mut gradient = vec![0.0; mlp.end()];
    mlp.forward(&parameters, &input, &mut tape, true);
    tape.output_gradient().fill(1.0);
    mlp.backward(&parameters, &input, &mut tape, Some(&mut gradient), None);
    let once = gradient.clone();
    tape.output_gradient().fill(1.0);
    mlp.backward(&parameters, &input, &mut tape, Some(&mut gradient), None);
    for (twice, once) in gradient.iter().zip(&once) {
        assert!((twice - 2.0 * once).abs() < 1e-12);
    }
}
