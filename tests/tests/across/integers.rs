//! A policy in integers is the one in single precision, as far as 8-bit
//! weights can say it, and passes every check that the other passes.

use armor_core::image::{Layout, PolicyImage, Precision};
use armor_train::export::ExportError;
use armor_train::quantize::{Quantized, quantize};
use firmware_sim::host;
use firmware_sim::verify::verify;

use crate::fixture::{policy, shipped};

fn quantized(precision: Precision) -> Quantized {
    laid_out(precision, Layout::Rows)
}

fn laid_out(precision: Precision, layout: Layout) -> Quantized {
    let image = PolicyImage::new_checked(policy().exported.bytes.as_slice()).unwrap();
    quantize(&image, shipped(), precision, layout).unwrap()
}

#[test]
fn it_agrees_with_single_precision_and_more_bits_agree_better() {
    let [int16x8, int8] = [Precision::Int16x8, Precision::Int8].map(quantized);
    let rms = [&int16x8, &int8].map(|quantized| quantized.agreement.agreement_rms);
    assert!(0.0 < rms[0] && rms[0] < rms[1] && rms[1] < 0.05, "{rms:?}");
    // What was measured stands in the image.
    for quantized in [int16x8, int8] {
        let image = PolicyImage::new_checked(quantized.bytes.as_slice()).unwrap();
        assert_eq!(image.manifest().agreement_max_abs, quantized.agreement.agreement_max_abs);
        let cards = image.manifest().quality.iter().zip(&quantized.drift.0);
        assert_eq!(cards.len(), image.manifest().rungs.len());
        for (card, drift) in cards {
            assert_eq!((card.rung, card.reward_normalized), (drift.rung, drift.reward_normalized));
        }
    }
}

#[test]
fn it_passes_every_check_with_no_difference_at_all() {
    for precision in [Precision::Int16x8, Precision::Int8] {
        let quantized = quantized(precision);
        let verification = verify(quantized.bytes.as_slice(), 1);
        assert!(verification.passed, "{verification}");
        assert_eq!(verification.agreement_max_abs, Some(0.0));
        let flyable = host::check(quantized.bytes.as_slice()).unwrap();
        assert_eq!(flyable.image.manifest().precision, precision);
    }
}

/// The golden trace holds the bits of the actions, the quality card those of whole flights.
#[test]
fn weights_in_pairs_fly_the_same_actions() {
    for precision in [Precision::Int16x8, Precision::Int8] {
        let [rows, paired] = [Layout::Rows, Layout::Paired].map(|layout| laid_out(precision, layout));
        assert!(verify(paired.bytes.as_slice(), 1).passed);
        let [rows, paired] = [&rows, &paired].map(|quantized| host::check(quantized.bytes.as_slice()).unwrap().image);
        assert_eq!(paired.manifest().layout, Layout::Paired);
        assert_eq!(paired.manifest().quality, rows.manifest().quality);
        let trace = armor_core::image::SectionKind::Golden;
        assert_eq!(paired.words(trace), rows.words(trace));
    }
}

#[test]
fn what_is_in_integers_already_is_not_quantised_again() {
    let quantized = quantized(Precision::Int8);
    let image = PolicyImage::new_checked(quantized.bytes.as_slice()).unwrap();
    assert!(matches!(quantize(&image, shipped(), Precision::Int8, Layout::Rows), Err(ExportError::NotFloat)));
    let float = PolicyImage::new_checked(policy().exported.bytes.as_slice()).unwrap();
    assert!(matches!(quantize(&float, shipped(), Precision::F32, Layout::Rows), Err(ExportError::NotInteger)));
}
