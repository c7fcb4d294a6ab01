//! Several columns at once have the bits that each would have alone.

use super::*;

fn columns_are_alone<const K: usize>(inputs: usize, outputs: usize) -> Result<(), TestCaseError> {
    let (weights, x, start) = (normals(0, inputs * outputs), normals(1, K * inputs), normals(2, K * outputs));
    let (x, _) = x.as_chunks::<K>();
    let column = |rows: &[[f32; K]], k: usize| rows.iter().map(|row| row[k]).collect::<Vec<f32>>();
    for kernel in Kernel::available() {
        let mut actual = start.as_chunks::<K>().0.to_vec();
        kernel.accumulate_columns(&weights, x, &mut actual);
        for k in 0..K {
            let mut expected = column(start.as_chunks().0, k);
            naive(&weights, &column(x, k), &mut expected);
            prop_assert_eq!(bits_of(&column(&actual, k)), bits_of(&expected), "{} of {}", kernel.name(), K);
        }
    }
    Ok(())
}

proptest! {
    #[test]
    fn a_column_has_the_bits_that_it_would_have_alone(
        inputs in 0usize..40,
        outputs in prop_oneof![2 => 0usize..70, 1 => 120usize..150],
    ) {
        columns_are_alone::<2>(inputs, outputs)?;
        columns_are_alone::<4>(inputs, outputs)?;
        columns_are_alone::<5>(inputs, outputs)?;
        columns_are_alone::<8>(inputs, outputs)?;
        columns_are_alone::<16>(inputs, outputs)?;
        columns_are_alone::<19>(inputs, outputs)?;
    }

    #[test]
    fn a_column_of_integers_has_the_sums_that_it_would_have_alone(
        (weights, codes, bits, outputs) in rows(), seed in any::<u16>(),
    ) {
        const H: usize = MAX_TERMS;
        let inputs = codes.len();
        // The same codes in another order, for every column another.
        let columns: [[i16; H]; 3] = std::array::from_fn(|column| {
            std::array::from_fn(|at| codes.get((at + usize::from(seed) * column) % inputs).copied().unwrap_or_default())
        });
        for (kernel, layout) in Kernel::available().flat_map(|kernel| [(kernel, Layout::Rows), (kernel, Layout::Paired)]) {
            let mut arranged = vec![0; layout.bytes(outputs, inputs)];
            layout.arrange(&weights, inputs, &mut arranged);
            let mut actual = [[-1; H]; 3];
            kernel.sum_rows_columns((layout, &arranged), (&columns, bits), &mut actual, [inputs, outputs]);
            for (codes, actual) in columns.iter().zip(&actual) {
                let mut expected = [-1; H];
                integer::sum_rows(&weights, &codes[..inputs], &mut expected[..outputs]);
                prop_assert_eq!(actual, &expected, "{}", kernel.name());
            }
        }
    }
}
